//! A run that was cut short: it does not count, what was recorded of it is kept beside the runs, and the next call
//! makes it anew.

use crate::error::IterationError;
use crate::robot::RobotRun;
use crate::status::IterationStatus;
use crate::store::IterationStore;

/// By what a run was cut short, and how it ended, in words.
#[derive(Clone, Debug)]
pub(crate) enum CutShort {
    /// Somebody asked for a stop.
    Interrupted(String),
    /// The exchange with the robot failed.
    Failed(String),
}

impl CutShort {
    /// Keeps what was recorded, after run number `run` or of it; `next` is what the same command goes on with.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub(crate) fn kept(
        self,
        store: Option<&IterationStore>,
        run: usize,
        runs: &[RobotRun],
        next: &str,
    ) -> Result<IterationStatus, IterationError> {
        let (Self::Interrupted(how) | Self::Failed(how)) = &self;
        let kept = store.map_or(Ok(None), |store| store.keep_interrupted(run, runs, how))?;
        let kept = kept.map_or_else(String::new, |path| format!("; what was recorded of it: {}", path.display()));
        let reason = format!("{how}{kept}. The same command goes on with {next}");
        Ok(match self {
            Self::Interrupted(_) => IterationStatus::Interrupted { reason },
            Self::Failed(_) => IterationStatus::Refused { reason },
        })
    }
}
