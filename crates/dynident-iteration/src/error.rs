//! What can be wrong with an iteration. How it went is its status, not an error: see
//! [`IterationStatus`](super::IterationStatus).

use dynident_dynamics::ParametricModelError;
use dynident_estimation::EstimationError;
use dynident_identification::estimators::EstimatorError;
use dynident_identification::{IdentificationError, LogError};
use dynident_recording::FilterError;
use dynident_simulation::SimulationError;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why an iteration cannot be made or go on.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum IterationError {
    /// A robot, a controller or a setting.
    #[error(transparent)]
    Experiment(#[from] SimulationError),
    /// A robot whose parts do not fit.
    #[error(transparent)]
    Model(#[from] ParametricModelError),
    /// Friction that an earlier run is said to have chosen and that this robot cannot have.
    #[error(
        "the friction that run {run} chose does not fit this robot: {source}; start afresh, or give another folder"
    )]
    ChosenFriction {
        /// The run.
        run: usize,
        /// What is wrong.
        source: ParametricModelError,
    },
    /// Rows that do not carry a model.
    #[error(transparent)]
    Identification(#[from] IdentificationError),
    /// A differentiator or a filter.
    #[error(transparent)]
    Filter(#[from] FilterError),
    /// Rows that do not carry an estimate.
    #[error(transparent)]
    Estimation(#[from] EstimationError),
    /// A record that cannot be used.
    #[error("record of joints {}: {problem}", joints.join(", "))]
    Record {
        /// Its joints.
        joints: Vec<String>,
        /// What is wrong, and the fix.
        problem: String,
    },
    /// A run whose motion cannot be planned.
    #[error("run {run}: {problem}")]
    Planning {
        /// The run.
        run: usize,
        /// What is wrong, and the fix.
        problem: String,
    },
    /// A file of the iteration's folder that cannot be read or written. What was there before is untouched.
    #[error("{}: {source}; nothing that was there has changed", path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A file of the iteration's folder that holds something else.
    #[error("{}: {problem}", path.display())]
    State {
        /// The file.
        path: PathBuf,
        /// What is wrong, and the fix.
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
