//! Forecast of error bars by the names of parameters.

use crate::result::{DirectionForecast, ParameterForecast};
use crate::study::StudyRobot;
use dynident_excitation::predicted_covariance;
use nalgebra::DMatrix;

const MAX_DIRECTIONS: usize = 3;
const MAX_TERMS: usize = 6;

/// Nominal values below this share of the largest are rounding errors of zero.
const MIN_RELATIVE_NOMINAL: f64 = 1e-9;

/// Predicted standard deviations from the information of the motion, also relative to the nominal values;
/// `with_prior` includes prior information. The directions with the largest uncertainty use all information.
pub(super) fn named_forecast(
    robot: &StudyRobot,
    information: &DMatrix<f64>,
    with_prior: Option<&DMatrix<f64>>,
) -> (Vec<ParameterForecast>, Vec<DirectionForecast>) {
    let columns = robot.layout().columns();
    let alone = predicted_covariance(information, MAX_DIRECTIONS);
    let all = with_prior.map(|information| predicted_covariance(information, MAX_DIRECTIONS));
    // Rounded angles in the robot description make some zero values nonzero; these have no relative error.
    let largest =
        robot.nominal_base().iter().copied().flatten().fold(0.0_f64, |largest, prior| largest.max(prior.abs()));
    let expressions = robot.base().expressions();
    let parameters = expressions.into_iter().enumerate().map(|(index, expression)| {
        let (std, prior) = (alone.std[index], robot.nominal_base().map(|prior| prior[index]));
        let size = prior.map(f64::abs).filter(|size| *size > MIN_RELATIVE_NOMINAL * largest);
        let relative = std.zip(size).map(|(std, size)| 100.0 * std / size);
        let (symbol, unit) = (columns[index].symbol(), columns[index].unit().to_owned());
        let std_with_prior = all.as_ref().and_then(|all| all.std[index]);
        ParameterForecast { symbol, expression, unit, std, std_with_prior, relative_std_percent: relative, prior }
    });
    let directions = all.as_ref().unwrap_or(&alone).worst.iter().map(|direction| {
        let mut terms: Vec<(String, f64)> =
            columns.iter().zip(&direction.shares).map(|(column, share)| (column.symbol(), *share)).collect();
        terms.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
        terms.truncate(MAX_TERMS);
        DirectionForecast { inflation: direction.inflation, terms }
    });
    (parameters.collect(), directions.collect())
}
