//! One decision, and the driver of a list of them.

use super::workspace::Workspace;
use crate::bars::ErrorSource;
use crate::error::IdentificationError;
use nalgebra::DMatrix;

/// What the driver does after a decision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Next {
    /// Goes on with the next decision of the list.
    Proceed,
    /// Starts again at the top of the list, because a choice was revised.
    StartAgain,
}

/// One thing that the training logs decide.
pub(crate) trait Decision: Sync {
    /// Makes the choice if it is open, or revises it if the fit under the choices so far requires it.
    ///
    /// # Errors
    /// Recordings that cannot be read, rows that do not determine an estimate.
    fn decide(&self, work: &mut Workspace<'_, '_>) -> Result<Next, IdentificationError>;

    /// Covariance that the remaining uncertainty of the choice adds to the estimate of the last fit.
    fn error(&self, _work: &Workspace<'_, '_>) -> Option<(ErrorSource, DMatrix<f64>)> {
        None
    }
}

/// Makes the decisions of a list until none revises a choice.
///
/// # Errors
/// As [`Decision::decide`].
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
