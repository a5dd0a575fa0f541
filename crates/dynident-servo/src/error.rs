//! Why a fit cannot begin or cannot end.

use dynident_model::ModelError;
use thiserror::Error;

/// Why a fit cannot begin or cannot end.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ServoError {
    /// A setting out of range.
    #[error("{setting} = {value}: give a positive number; for step_s from 0.0001 to 0.05")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// Its value.
        value: f64,
    },
    /// A setting of a design out of its range.
    #[error("{setting} = {value}: give a number from {least} to {most}")]
    DesignSetting {
        /// Name of the setting.
        setting: &'static str,
        /// Its value.
        value: f64,
        /// Least permitted value.
        least: f64,
        /// Largest permitted value.
        most: f64,
    },
    /// No candidate of a design keeps the limits.
    #[error(
        "none of {attempts} candidate motions keeps all limits: state a free start_posture in [design], or wider limits \
         in [design.limits]"
    )]
    NoMotion {
        /// Number of candidates.
        attempts: usize,
    },
    /// No run to fit to.
    #[error("no log to fit to: give at least one log with the role identify")]
    NoRuns,
    /// A run without enough samples, with stamps that do not rise, or without the robot's joints.
    #[error("{run}: {fault}")]
    Run {
        /// Name of the run.
        run: String,
        /// The fault, and the fix.
        #[source]
        fault: RunFault,
    },
    /// No simulation of the robot with the first values gives numbers.
    #[error("the simulation of {run} fails with the first values: state stiffness, damping and armature of the drives")]
    Start {
        /// Name of the run.
        run: String,
    },
    /// Bodies that cannot be simulated.
    #[error("{0}")]
    Model(#[from] ModelError),
}

/// What is wrong with a run.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum RunFault {
    /// Fewer joints than the robot has, or more.
    #[error("{found} joints, and the robot has {expected}: map each joint to one column")]
    Joints {
        /// Joints of the run.
        found: usize,
        /// Joints of the robot.
        expected: usize,
    },
    /// Columns of different length.
    #[error("columns of different length: give each stamp a command and a position of each joint")]
    Lengths,
    /// A wrong number of relative gains, or negative ones.
    #[error("servo_gain needs one number that is not negative, or {joints} of them, one for each joint")]
    Gains {
        /// Joints of the robot.
        joints: usize,
    },
    /// Too few samples.
    #[error("{found} samples: give at least {least}")]
    Samples {
        /// Samples of the run.
        found: usize,
        /// Least number of samples.
        least: usize,
    },
    /// Stamps that do not rise.
    #[error("the stamp of sample {sample} is not above the one before: remove repeated rows, or map another clock")]
    Stamps {
        /// Index of the sample.
        sample: usize,
    },
    /// A gap that would make the simulation endless.
    #[error("a gap of {gap_s:.0} s before sample {sample}: split the log there, with time_range_s")]
    Gap {
        /// Index of the sample.
        sample: usize,
        /// Length, s.
        gap_s: f64,
    },
    /// A value that is not a number.
    #[error("a command or position of sample {sample} is not a number: remove the row")]
    NotANumber {
        /// Index of the sample.
        sample: usize,
    },
}
