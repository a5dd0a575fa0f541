//! Errors of the physically consistent fit.

use dynident_estimation::EstimationError;
use dynident_estimation::consistent::PhysicalError;
use thiserror::Error;

/// An error of the physically consistent fit.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ConsistencyError {
    /// Two links that are joined by a fixed joint are one body, and only their sum can be identified. State their
    /// values together under the name in the message.
    #[error("bodies.{link}: this link is fixed to {body}: write bodies.{body} with the values of both links together")]
    MergedLink {
        /// The link.
        link: String,
        /// The body that contains it.
        body: String,
    },
    /// A key of `bodies` under `[estimator.physical]` is not a moving link of the robot. Use one of the listed names.
    #[error("bodies.{name}: unknown moving link; use one of {}", known.join(", "))]
    UnknownBody {
        /// The name.
        name: String,
        /// The robot's bodies.
        known: Vec<String>,
    },
    /// A key of `laws` under `[estimator.physical]` is not a friction parameter of this study. Use one of the listed
    /// symbols.
    #[error("laws.{symbol}: unknown law; [drive] has {}", known.join(", "))]
    UnknownTerm {
        /// The symbol.
        symbol: String,
        /// The robot's terms.
        known: Vec<String>,
    },
    /// Limits of a body that contradict each other, an inconsistent prior body, or values that are not finite.
    #[error("{0}")]
    Physical(#[from] PhysicalError),
    /// The triangular factors belong to another robot.
    #[error("{0}")]
    Estimation(#[from] EstimationError),
}
