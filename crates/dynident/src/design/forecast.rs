//! The forecast under the parameters' names.

use super::file::{DirectionForecast, ParameterForecast};
use crate::machine::Machine;
use dynident_excitation::forecast;
use nalgebra::DMatrix;

/// Worst directions that are told, and the terms of each.
const DIRECTIONS: usize = 3;
const TERMS: usize = 6;

/// A prior value below this share of the largest is zero.
const NEGLIGIBLE: f64 = 1e-9;

/// The forecast with the parameters' names, and with their sizes by the prior.
pub(super) fn named_forecast(
    machine: &Machine,
    information: &DMatrix<f64>,
) -> (Vec<ParameterForecast>, Vec<DirectionForecast>) {
    let columns = machine.layout.columns();
    let forecast = forecast(information, DIRECTIONS);
    // A prior that is zero but for the rounding of the description's angles has no relative error.
    let largest = machine.prior.iter().flatten().fold(0.0_f64, |largest, prior| largest.max(prior.abs()));
    let expressions = machine.base.expressions();
    let parameters = expressions.into_iter().enumerate().map(|(index, expression)| {
        let (std, prior) = (forecast.std[index], machine.prior.as_ref().map(|prior| prior[index]));
        let size = prior.map(f64::abs).filter(|size| *size > NEGLIGIBLE * largest);
        let relative = std.zip(size).map(|(std, size)| 100.0 * std / size);
        let (symbol, unit) = (columns[index].symbol(), columns[index].unit());
        ParameterForecast { symbol, expression, unit, std, relative_std_percent: relative, prior }
    });
    let directions = forecast.worst.iter().map(|direction| {
        let mut terms: Vec<(String, f64)> =
            columns.iter().zip(&direction.shares).map(|(column, share)| (column.symbol(), *share)).collect();
        terms.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
        terms.truncate(TERMS);
        DirectionForecast { inflation: direction.inflation, terms }
    });
    (parameters.collect(), directions.collect())
}
