//! Decision about the cut-off with the smallest predicted parameter error, with friction as the study states it.

use super::choices::CutoffChoice;
use super::decision::{Decision, Next};
use super::workspace::Workspace;
use crate::bandwidth::choose_cutoff;
use crate::error::IdentificationError;

pub(super) struct Cutoff;

impl Decision for Cutoff {
    fn decide(&self, work: &mut Workspace<'_, '_>) -> Result<Next, IdentificationError> {
        if work.choices.cutoff.is_none() {
            let logs = work.logs_at(None)?;
            let by_error = choose_cutoff(&logs, &work.settings, &work.drives().robot.into(), work.training)?;
            work.choices.cutoff = Some(CutoffChoice { by_error });
        }
        Ok(Next::Proceed)
    }
}
