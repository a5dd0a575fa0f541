use dynident_simulation::{SimulationError, require};
use dynident_system::{PermittedProgram, ProgramPermission, ProgramPurpose, ProgramRefused, ProgramRequest};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Where the control loop runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum ProcessMode {
    /// The robot program runs the control loop, at its own rate, from the input files.
    #[default]
    Run,
    /// Dynident runs the control loop: it sends a torque and receives a state for each sample.
    Step,
}

/// Time limits of the robot program.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct ProcessLimits {
    /// Longest time from the start of the program to its `hello` message, s; later the program is killed. Default 30.
    pub hello_s: f64,
    /// Longest time from one message of the program to the next, s; later the program is killed. In mode `run` the
    /// remaining time of the motion is added, because a program may send its samples after the motion. Moving to the
    /// start and back is limited to this time, too. Default 60.
    pub message_s: f64,
    /// Longest time from one sample to the next in mode `run` while samples arrive in real time, s; a program that is
    /// silent for longer during a motion is stopped. Default ten sampling periods, at least 0.2 s. Not used for
    /// programs that send samples after the motion, in batches, or faster or slower than real time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub silence_s: Option<f64>,
    /// Longest duration of a run, s; later the program is killed. Default none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub run_s: Option<f64>,
    /// Longest time from a stop message to the program's `end` message, s; later the program is killed. Default 5.
    pub stop_s: f64,
    /// Longest time from Dynident's `bye` message to the end of the program, s; later the program is terminated, and
    /// killed after the same time again. Default 2.
    pub bye_s: f64,
}

impl Default for ProcessLimits {
    fn default() -> Self {
        Self { hello_s: 30.0, message_s: 60.0, silence_s: None, run_s: None, stop_s: 5.0, bye_s: 2.0 }
    }
}

/// Settings of a robot program.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ProcessSettings {
    /// Program and arguments.
    pub command: Vec<String>,
    /// Where the control loop runs; by default in the program.
    #[serde(default)]
    pub mode: ProcessMode,
    /// Time limits of the program.
    #[serde(default)]
    pub limits: ProcessLimits,
    /// Folder for the input files `run_k/trajectory.csv` and `run_k/controller.json`. Default a temporary folder,
    /// which is deleted at the end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub folder: Option<PathBuf>,
}

impl ProcessSettings {
    /// Returns the permission to start the command.
    ///
    /// # Errors
    /// [`ProgramRefused`] if it may not be started.
    pub fn permitted(&self, permission: ProgramPermission<'_>) -> Result<PermittedProgram, ProgramRefused> {
        permission.permit(ProgramRequest::new(ProgramPurpose::Robot, self.command.iter().cloned()))
    }

    /// Checks the settings.
    ///
    /// # Errors
    /// No program, limits that are not positive.
    pub fn validate(&self) -> Result<(), SimulationError> {
        require(!self.command.is_empty(), "command", 0.0, "give the program and its arguments")?;
        let limits = &self.limits;
        let all = [
            ("hello_s", limits.hello_s),
            ("message_s", limits.message_s),
            ("stop_s", limits.stop_s),
            ("bye_s", limits.bye_s),
        ];
        let optional = [limits.run_s.map(|value| ("run_s", value)), limits.silence_s.map(|value| ("silence_s", value))];
        for (what, value) in all.into_iter().chain(optional.into_iter().flatten()) {
            require(value > 0.0 && value <= 1e6, format!("limits.{what}"), value, "give more than 0, at most 1e6 s")?;
        }
        Ok(())
    }
}
