//! A robot program and how it is spoken to.

use dynident_simulation::{SimulationError, require};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Who runs the control loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum ProcessMode {
    /// The client, at its own rate, from the files that it is handed.
    #[default]
    Run,
    /// The host: a torque there, a state back.
    Step,
}

/// How long the client may take.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct ProcessLimits {
    /// From its start to its hello, s. Default 30.
    pub hello_s: f64,
    /// From one message to the next, s. In the mode `run` what is left of the motion comes on top: a program may send
    /// its samples afterwards, and the way to the start and back may take this long. Default 60.
    pub message_s: f64,
    /// From one sample to the next in the mode `run`, s, while the samples come in real time: a program that falls
    /// silent in the middle of a motion is stopped after this. Default ten sample periods, at least 0.2 s. Of programs
    /// that send their samples afterwards, in batches, or faster or slower than real time it means nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub silence_s: Option<f64>,
    /// A whole run, s. Default none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub run_s: Option<f64>,
    /// From a stop message to the program's `end`, s; then it is killed. Default 5.
    pub stop_s: f64,
    /// From the host's bye to its end, s; then it is terminated, and killed after the same time again. Default 2.
    pub bye_s: f64,
}

impl Default for ProcessLimits {
    fn default() -> Self {
        Self { hello_s: 30.0, message_s: 60.0, silence_s: None, run_s: None, stop_s: 5.0, bye_s: 2.0 }
    }
}

/// A robot program and how it is spoken to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ProcessSettings {
    /// Program and arguments.
    pub command: Vec<String>,
    /// Who runs the control loop; default the client.
    #[serde(default)]
    pub mode: ProcessMode,
    /// How long it may take.
    #[serde(default)]
    pub limits: ProcessLimits,
    /// Folder for the files that are handed over, `run_k/trajectory.csv` and `run_k/controller.json`. Default a
    /// temporary folder, deleted with the robot.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub folder: Option<PathBuf>,
}

impl ProcessSettings {
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
