//! A run that was interrupted or failed. It is not used, its log is kept next to the runs, and the next call repeats
//! it.

use crate::robot::RobotRun;
use crate::setup::error::IterationError;
use crate::setup::status::IterationStatus;
use crate::storage::store::IterationStore;

/// Why a run ended early, with a description of its outcome.
#[derive(Clone, Debug)]
pub(crate) enum CutShort {
    Interrupted(String),
    Failed(String),
}

impl CutShort {
    /// Stores the recorded logs under run number `run`; `next` names the step with which a repeated command continues.
    pub(crate) fn kept(
        self,
        store: Option<&IterationStore>,
        run: usize,
        runs: &[RobotRun],
        next: &str,
    ) -> Result<IterationStatus, IterationError> {
        let (Self::Interrupted(how) | Self::Failed(how)) = &self;
        let kept = store.map_or(Ok(None), |store| store.keep_interrupted(run, runs, how))?;
        let kept = kept.map_or_else(String::new, |path| format!("; its recorded part: {}", path.display()));
        let reason = format!("{how}{kept}. Repeat the command to continue with {next}");
        Ok(match self {
            Self::Interrupted(_) => IterationStatus::Interrupted { reason },
            Self::Failed(_) => IterationStatus::Refused { reason },
        })
    }
}
