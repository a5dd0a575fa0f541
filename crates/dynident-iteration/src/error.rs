//! What can be wrong with an iteration. How it went is its status, not an error: see
//! [`IterationStatus`](super::IterationStatus).

use dynident_dynamics::ParametricModelError;
use dynident_estimation::EstimationError;
use dynident_identification::IdentificationError;
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

impl IterationError {
    pub(crate) fn file(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::File { path, source }
    }
}
