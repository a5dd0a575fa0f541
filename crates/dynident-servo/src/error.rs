//! Errors of a fit to commands and positions.

use dynident_model::ModelError;
use thiserror::Error;

/// Reason why a fit cannot begin or cannot end.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ServoError {
    /// A setting of the fit to commands is outside its range. Write a positive number; for `step_s` and
    /// `physics_step_s`, a number within the range of the message.
    #[error("{setting} = {value}: give a positive number; for step_s and physics_step_s from 0.0001 to 0.05")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// Its value.
        value: f64,
    },
    /// A setting of the designed motion is outside its range. Write a value within the range that the message names.
    #[error("{setting} = {value}: give a number from {least} to {most}")]
    DesignSetting {
        /// Name of the setting.
        setting: &'static str,
        /// Its value.
        value: f64,
        /// Smallest permitted value.
        least: f64,
        /// Largest permitted value.
        most: f64,
    },
    /// All candidate motions exceed a limit of the joints or the workspace. Write another `start_posture` under
    /// `[design]`, with more free space around it, or wider limits.
    #[error(
        "none of {attempts} candidate motions keeps all limits: state a free start_posture in [design], or wider limits \
         in [design.limits]"
    )]
    NoMotion {
        /// Number of candidates.
        attempts: usize,
    },
    /// Every `[[log]]` of the study has `role = "validate"`. The fit needs at least one other log.
    #[error("no log to fit to: give at least one log with the role identify")]
    NoRuns,
    /// This log of commands and positions cannot be used. The text after its name has the cause; see the table *Logs of
    /// commands*.
    #[error("{run}: {fault}")]
    Run {
        /// Name of the run.
        run: String,
        /// The fault, and the fix.
        #[source]
        fault: RunFault,
    },
    /// With the first values of the search, the simulated motion diverges. State rough values of the drives in the
    /// study, and check the masses in the robot description.
    #[error("the simulation of {run} fails with the first values: state stiffness, damping and armature of the drives")]
    Start {
        /// Name of the run.
        run: String,
    },
    /// Bodies that cannot be simulated.
    #[error("{0}")]
    Model(#[from] ModelError),
}

/// Reason why a run cannot be used.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum RunFault {
    /// The log has commands and positions for another number of joints than the robot. Select one column for each joint
    /// under `[format]`, or lock joints.
    #[error("{found} joints, and the robot has {expected}: map each joint to one column")]
    Joints {
        /// Joints of the run.
        found: usize,
        /// Joints of the robot.
        expected: usize,
    },
    /// A program passed lists of times, commands and positions of different lengths. Correct the call.
    #[error("columns of different length: give each stamp a command and a position of each joint")]
    Lengths,
    /// `servo_gain` of a log is the gain of its servos relative to `stiffness`. Write one number, or one for each
    /// joint; 0 if the position controller was off.
    #[error("servo_gain needs one number that is not negative, or {joints} of them, one for each joint")]
    Gains {
        /// Joints of the robot.
        joints: usize,
    },
    /// The log is too short for a fit. Record a longer log, or select more rows.
    #[error("{found} samples: give at least {least}")]
    Samples {
        /// Samples of the run.
        found: usize,
        /// Least number of samples.
        least: usize,
    },
    /// A time stamp is equal to or earlier than the one before. Delete repeated rows, or select another time column.
    #[error("the stamp of sample {sample} is not above the one before: remove repeated rows, or map another clock")]
    Stamps {
        /// Index of the sample.
        sample: usize,
    },
    /// The recorder paused. The simulated robot cannot follow the real one across such a gap. Use two `[[log]]`
    /// entries, each with its `time_range_s`.
    #[error("a gap of {gap_s:.0} s before sample {sample}: split the log there, with time_range_s")]
    Gap {
        /// Index of the sample.
        sample: usize,
        /// Length, s.
        gap_s: f64,
    },
    /// A field of a command or position is empty, NaN or infinite. Delete this row of the log.
    #[error("a command or position of sample {sample} is not a number: remove the row")]
    NotANumber {
        /// Index of the sample.
        sample: usize,
    },
}
