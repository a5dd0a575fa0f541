//! Why no physically consistent parameters could be found.

use dynident_estimation::EstimationError;
use dynident_estimation::consistent::PhysicalError;
use thiserror::Error;

/// Why there are no physically consistent parameters for an estimate.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ConsistencyError {
    /// Knowledge of a link that moves as one with another.
    #[error(
        "bodies.{link}: this link moves as one with {body}; what is known must hold for both together: write bodies.{body}"
    )]
    MergedLink {
        /// The link.
        link: String,
        /// The body that it belongs to.
        body: String,
    },
    /// Knowledge of a body that is not there.
    #[error("bodies.{name}: there is no such moving link; there are {}", known.join(", "))]
    UnknownBody {
        /// The name.
        name: String,
        /// The bodies that are there.
        known: Vec<String>,
    },
    /// Limits of a torque term that is not there.
    #[error("laws.{symbol}: [drive] has no such law; it has {}", known.join(", "))]
    UnknownTerm {
        /// The symbol.
        symbol: String,
        /// The terms that are there.
        known: Vec<String>,
    },
    /// Limits that exclude each other, a reference that is no body, numbers that are not finite.
    #[error(transparent)]
    Physical(#[from] PhysicalError),
    /// Factors that do not belong to the robot.
    #[error(transparent)]
    Estimation(#[from] EstimationError),
}
