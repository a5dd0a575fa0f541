//! Automatic selection of the estimator: weighted least squares, or instrumental variables if noise in the regressor
//! biases least squares.

use super::exogeneity::{examined, harmless};
use super::instrumental::InstrumentSettings;
use super::noise_in_regressor::{NoiseInRegressor, NoiseVerdict};
use super::{Estimation, EstimatorError, TrainingRows};
use dynident_estimation::{Estimate, EstimateStatus, InstrumentalEstimate};

/// The estimate by weighted least squares, or by instrumental variables if least squares is biased and the instruments
/// are strong.
pub(super) fn automatic(
    rows: &TrainingRows<'_>,
    settings: &InstrumentSettings,
    least_squares: Estimate,
) -> Result<Estimation, EstimatorError> {
    let (found, mut noise) = match examined_where_possible(rows, settings, &least_squares)? {
        Some((Some(found), noise)) => (found, noise),
        Some((None, noise)) => {
            return Ok(Estimation { noise_in_regressor: Some(noise), ..Estimation::plain(least_squares) });
        }
        None => return Ok(Estimation::plain(least_squares)),
    };
    let is_sound = !found.instruments.weak && found.estimate.status != EstimateStatus::IterationLimit;
    noise.instruments_taken = noise.verdict == NoiseVerdict::BiasesLeastSquares && is_sound;
    let estimate = if noise.instruments_taken { found.estimate } else { least_squares };
    Ok(Estimation { noise_in_regressor: Some(noise), ..Estimation::plain(estimate) })
}

/// Tests the effect of noise in the regressor on least squares, and returns the instrumental-variables estimate if it
/// was computed. `None` if the test is not possible. The test requires that all columns belong to the robot and are
/// free, that all joints have rows, and that the pieces of the logs are long enough for a filter with a lower cut-off.
pub(super) fn examined_where_possible(
    rows: &TrainingRows<'_>,
    settings: &InstrumentSettings,
    least_squares: &Estimate,
) -> Result<Option<(Option<InstrumentalEstimate>, NoiseInRegressor)>, EstimatorError> {
    let layout = rows.model.layout();
    let is_plain = rows.problem.columns().len() == layout.columns().len()
        && rows.problem.joints().len() == rows.model.dof()
        && rows.settings.held.is_empty();
    if !is_plain {
        return Ok(None);
    }
    let first = if settings.cutoff_hz.is_none() { harmless(rows, least_squares) } else { Ok(None) };
    let found = first.and_then(|harmless| match harmless {
        Some(noise) => Ok((None, noise)),
        None => examined(rows, settings, least_squares).map(|(found, noise)| (Some(found), noise)),
    });
    match found {
        Ok(found) => Ok(Some(found)),
        // If the test fails, the least-squares estimate is still valid.
        Err(EstimatorError::Estimation(_) | EstimatorError::Instruments { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}
