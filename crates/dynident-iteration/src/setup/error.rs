//! Errors of an iteration. The outcome of an iteration is a status, not an error: see
//! [`IterationStatus`](crate::IterationStatus).

use dynident_dynamics::ParametricModelError;
use dynident_estimation::EstimationError;
use dynident_identification::estimators::EstimatorError;
use dynident_identification::{IdentificationError, LogError};
use dynident_recording::FilterError;
use dynident_simulation::SimulationError;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why an iteration cannot be created or continued.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum IterationError {
    /// Invalid robot, controller or setting.
    #[error("{0}")]
    Experiment(#[from] SimulationError),
    /// Parts of the robot that do not fit together.
    #[error("{0}")]
    Model(#[from] ParametricModelError),
    /// The folder contains runs of another robot or study. Use an empty folder for this robot.
    #[error(
        "the friction that run {run} selected does not fit this robot: {source}; start afresh, or use another folder"
    )]
    ChosenFriction {
        /// Number of the run.
        run: usize,
        /// Reason for the mismatch.
        source: ParametricModelError,
    },
    /// Rows that are not sufficient for a model.
    #[error("{0}")]
    Identification(#[from] IdentificationError),
    /// Invalid differentiator or filter.
    #[error("{0}")]
    Filter(#[from] FilterError),
    /// Rows that are not sufficient for an estimate.
    #[error("{0}")]
    Estimation(#[from] EstimationError),
    /// The samples that the robot returned cannot be fitted, for example because they are too few or not where the
    /// joints follow the motion. The text after the joints has the cause.
    #[error("the record of the run (joints {}): {problem}", joints.join(", "))]
    Record {
        /// Names of the joints.
        joints: Vec<String>,
        /// The problem and its fix.
        problem: String,
    },
    /// The next motion depends on a good earlier run, and all earlier runs were rejected. See the reasons in the output
    /// of these runs.
    #[error("run {run}: {problem}")]
    Planning {
        /// Number of the run.
        run: usize,
        /// The problem and its fix.
        problem: String,
    },
    /// A file in the output folder cannot be read or written. Check permissions and free space. Existing files are
    /// unchanged.
    #[error("{}: {source}; existing files are unchanged", path.display())]
    File {
        /// Path of the file or folder.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A file in the output folder was changed by hand, truncated, or written by another version or study. Restore it,
    /// or use an empty folder.
    #[error("{}: {problem}", path.display())]
    State {
        /// The file.
        path: PathBuf,
        /// The problem and its fix.
        problem: String,
    },
}

impl From<LogError> for IterationError {
    fn from(error: LogError) -> Self {
        Self::Identification(error.into())
    }
}

impl From<EstimatorError> for IterationError {
    fn from(error: EstimatorError) -> Self {
        Self::Identification(error.into())
    }
}

impl IterationError {
    pub(crate) fn file(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::File { path, source }
    }
}
