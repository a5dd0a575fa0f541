//! Decision about the lag of the torque that is compensated in the rows of the fit.

use super::decision::{Decision, Next};
use super::workspace::Workspace;
use crate::bars::ErrorSource;
use crate::error::IdentificationError;
use crate::lag::{LagFit, lag_fit};
use crate::less_noise::Fit;
use nalgebra::DMatrix;

pub(super) struct Lag;

impl Decision for Lag {
    fn decide(&self, work: &mut Workspace<'_, '_>) -> Result<Next, IdentificationError> {
        if !work.is_lag_free {
            return Ok(Next::Proceed);
        }
        let training = work.training;
        let fit = work.fit()?;
        let (lags, estimate) = (free_lag(fit, training)?, fit.estimation.estimate.clone());
        if work.choices.lag.again(lags.as_ref(), &estimate) {
            work.revise_lag();
            return Ok(Next::StartAgain);
        }
        work.lag_fit = lags;
        Ok(Next::Proceed)
    }

    fn error(&self, work: &Workspace<'_, '_>) -> Option<(ErrorSource, DMatrix<f64>)> {
        let estimate = &work.fit.as_ref()?.estimation.estimate;
        let covariance = work.choices.lag.error(work.lag_fit.as_ref(), estimate)?;
        Some((ErrorSource::Lag, covariance))
    }
}

/// Estimates the lags of the joints together with all parameters. `None` if lags cannot be compensated: rows of some
/// joints are missing, or position noise biases the estimator and therefore the lag.
pub(super) fn free_lag(fit: &Fit<'_>, training: &[usize]) -> Result<Option<LagFit>, IdentificationError> {
    let Fit { logs, training: rows, estimation, settings } = fit;
    if rows.joints.len() != rows.model.dof() || !settings.estimation.estimator.reads_filtered_rows() {
        return Ok(None);
    }
    let gains = rows.gains.as_ref().map_or(&[][..], |(_, gains)| gains);
    let values = &estimation.estimate.values;
    Ok(lag_fit(logs, settings, &rows.model, &rows.columns, values, gains, training)?)
}
