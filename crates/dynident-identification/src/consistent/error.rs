//! Errors of the physically consistent fit.

use dynident_estimation::EstimationError;
use dynident_estimation::consistent::PhysicalError;
use thiserror::Error;

/// An error of the physically consistent fit.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ConsistencyError {
    /// Knowledge of a link that is fixed to another link.
    #[error("bodies.{link}: this link is fixed to {body}: write bodies.{body} with the values of both links together")]
    MergedLink {
        /// The link.
        link: String,
        /// The body that contains it.
        body: String,
    },
    /// Knowledge of an unknown body.
    #[error("bodies.{name}: unknown moving link; use one of {}", known.join(", "))]
    UnknownBody {
        /// The name.
        name: String,
        /// The robot's bodies.
        known: Vec<String>,
    },
    /// Limits of an unknown torque term.
    #[error("laws.{symbol}: unknown law; [drive] has {}", known.join(", "))]
    UnknownTerm {
        /// The symbol.
        symbol: String,
        /// The robot's terms.
        known: Vec<String>,
    },
    /// Contradictory limits, an inconsistent prior body, values that are not finite.
    #[error("{0}")]
    Physical(#[from] PhysicalError),
    /// Factors of another robot.
    #[error("{0}")]
    Estimation(#[from] EstimationError),
}
