//! How an iteration ended.

use serde::{Deserialize, Serialize};

/// How an iteration ended, or why it stands still.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "end", rename_all = "kebab-case")]
pub enum IterationStatus {
    /// Nothing is left of what [`Shortfall`](super::Shortfall) names.
    Converged,
    /// Neither tracking nor parameters change any more, and something is not met: a further run of the same motion
    /// would not help.
    Settled,
    /// All runs allowed were made.
    RunsUsedUp,
    /// No run can be made under any controller that is left to try.
    Refused {
        /// Why.
        reason: String,
    },
    /// Somebody asked for a stop; the next call goes on from here.
    Interrupted {
        /// What became of the run that was under way, and how to go on.
        reason: String,
    },
    /// Somebody has to run the robot first; then the iteration goes on from here.
    Waiting {
        /// For what.
        reason: String,
    },
}

impl IterationStatus {
    /// Whether everything is met.
    pub fn is_converged(&self) -> bool {
        *self == Self::Converged
    }
}

impl core::fmt::Display for IterationStatus {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Converged => write!(f, "converged"),
            Self::Settled => write!(f, "not converged: nothing changes any more"),
            Self::RunsUsedUp => write!(f, "not converged: all runs allowed were made"),
            Self::Refused { reason } => write!(f, "refused: {reason}"),
            Self::Interrupted { reason } => write!(f, "interrupted: {reason}"),
            Self::Waiting { reason } => write!(f, "waiting: {reason}"),
        }
    }
}
