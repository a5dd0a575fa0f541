use serde::{Deserialize, Serialize};

/// How an iteration ended, or why it is paused.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "end", rename_all = "kebab-case")]
pub enum IterationStatus {
    /// All conditions are met: [`UnmetCondition`](crate::UnmetCondition) lists none.
    Converged,
    /// Tracking and parameters no longer change, but a condition is not met: a further run of the same motion would not
    /// help.
    Settled,
    /// The largest number of runs was reached.
    RunsUsedUp,
    /// No controller permits a further run.
    Refused {
        /// Why.
        reason: String,
    },
    /// A stop was requested; the next call continues from here.
    Interrupted {
        /// The result of the interrupted run, and how to continue.
        reason: String,
    },
    /// A person has to run the robot; then the iteration continues from here.
    Waiting {
        /// The missing input.
        reason: String,
    },
}

impl IterationStatus {
    /// Whether all conditions are met.
    pub fn is_converged(&self) -> bool {
        *self == Self::Converged
    }
}

impl core::fmt::Display for IterationStatus {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Converged => write!(f, "converged"),
            Self::Settled => write!(f, "not converged: tracking and parameters no longer change"),
            Self::RunsUsedUp => write!(f, "not converged: the largest number of runs was reached"),
            Self::Refused { reason } => write!(f, "refused: {reason}"),
            Self::Interrupted { reason } => write!(f, "interrupted: {reason}"),
            Self::Waiting { reason } => write!(f, "waiting: {reason}"),
        }
    }
}
