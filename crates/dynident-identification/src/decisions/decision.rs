//! Interface of a decision, and the loop that makes a list of decisions.

use super::workspace::Workspace;
use crate::bars::ErrorSource;
use crate::error::IdentificationError;
use nalgebra::DMatrix;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Next {
    Proceed,
    /// Start again at the first decision of the list, because a choice was revised.
    StartAgain,
}

pub(crate) trait Decision: Sync {
    /// Makes the choice if it is still open, or revises it if the current fit requires this.
    ///
    /// # Errors
    /// Recordings cannot be read, or rows do not determine an estimate.
    fn decide(&self, work: &mut Workspace<'_, '_>) -> Result<Next, IdentificationError>;

    /// Covariance that the remaining uncertainty of the choice adds to the estimate of the last fit.
    fn error(&self, _work: &Workspace<'_, '_>) -> Option<(ErrorSource, DMatrix<f64>)> {
        None
    }
}

/// Makes the decisions of a list repeatedly, until no decision revises a choice.
pub(crate) fn decide_all(decisions: &[&dyn Decision], work: &mut Workspace<'_, '_>) -> Result<(), IdentificationError> {
    'from_top: loop {
        for decision in decisions {
            if decision.decide(work)? == Next::StartAgain {
                continue 'from_top;
            }
        }
        return Ok(());
    }
}
