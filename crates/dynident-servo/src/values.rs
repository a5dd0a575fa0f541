//! Fitted values with their error bars, in physical units.

use crate::fit::Search;
use crate::parameters::{FreeParameter, ServoRobot, VariedRobot, robot_at, robot_value};
use crate::quantity::Quantity;
use dynident_model::ModelError;
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;

/// A fitted value of a joint's drive or of a body.
#[derive(Clone, Debug, PartialEq)]
pub struct ServoValue {
    /// The quantity.
    pub quantity: Quantity,
    /// Index of the joint; for a mass or a centre of mass, index of the body.
    pub index: usize,
    /// The value, in the quantity's unit.
    pub value: f64,
    /// Standard deviation of the value.
    pub std: f64,
    /// Standard deviation of the value if the common factor of torques, inertias and masses were known.
    pub std_at_scale: f64,
    /// Standard deviation of the value before the fit.
    pub prior_std: f64,
}

/// The common factor of all torques, inertias and masses, which positions alone do not determine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Total mass of the moving bodies, kg.
    pub mass_kg: f64,
    /// Relative standard deviation of the factor.
    pub std: f64,
    /// Relative standard deviation of the factor before the fit.
    pub prior_std: f64,
}

/// All values that the search could change with their error bars, and the common factor of torques, inertias and
/// masses.
///
/// # Errors
/// The coordinates give bodies with values that are not finite.
pub fn values(
    nominal: &ServoRobot,
    parameters: &[FreeParameter],
    search: &Search,
) -> Result<(Vec<ServoValue>, Scale), ModelError> {
    let varied = VariedRobot::new(nominal, parameters, &search.coordinates)?;
    let robot = robot_at(nominal, parameters, &search.coordinates)?;
    let columns = parameters.len();
    let masses: Vec<f64> =
        varied.robot.model.inertials().iter().map(dynident_model::InertialParameters::mass_kg).collect();
    let total: f64 = masses.iter().sum();
    let mut rows: BTreeMap<(Quantity, usize), DVector<f64>> = BTreeMap::new();
    let mut add = |key: (Quantity, usize), column: usize, derivative: f64| {
        rows.entry(key).or_insert_with(|| DVector::zeros(columns))[column] += derivative;
    };
    for effect in &varied.effects {
        add((effect.quantity, effect.index), effect.column, effect.derivative);
    }
    for (column, parameter) in parameters.iter().enumerate() {
        for &body in &parameter.members {
            match parameter.quantity {
                Quantity::Mass => add((Quantity::Mass, body), column, masses[body]),
                quantity @ Quantity::Centre(_) => add((quantity, body), column, 1.0),
                _ => {}
            }
        }
    }
    without_mean_read_delay(&mut rows, parameters, columns);
    let prior = DVector::from_iterator(columns, parameters.iter().map(|parameter| parameter.prior_sd.powi(2)));
    let direction = scale_direction(parameters, robot.model.dof());
    let variance = variance_along(&search.covariance, &direction);
    let at_scale = &search.covariance - &direction * direction.transpose() * variance;
    let list = rows
        .iter()
        .map(|(&(quantity, index), row)| ServoValue {
            quantity,
            index,
            value: robot_value(&robot, quantity, index),
            std: deviation(&search.covariance, row),
            std_at_scale: deviation(&at_scale, row),
            prior_std: row.component_mul(row).dot(&prior).sqrt(),
        })
        .collect();
    let scale = Scale {
        mass_kg: total,
        std: variance.sqrt(),
        prior_std: variance_along(&DMatrix::from_diagonal(&prior), &direction).sqrt(),
    };
    Ok((list, scale))
}

/// Subtracts the mean of the read delays from all delays, as [`robot_at`] does, because the motion does not determine
/// this mean.
fn without_mean_read_delay(
    rows: &mut BTreeMap<(Quantity, usize), DVector<f64>>,
    parameters: &[FreeParameter],
    columns: usize,
) {
    let is_read = |parameter: &FreeParameter| parameter.quantity == Quantity::ReadDelay;
    let count = parameters.iter().filter(|parameter| is_read(parameter)).count();
    let share = |parameter: &FreeParameter| if is_read(parameter) { 1.0 / count as f64 } else { 0.0 };
    let mean = DVector::from_iterator(columns, parameters.iter().map(share));
    for ((quantity, _), row) in rows {
        if matches!(quantity, Quantity::Delay | Quantity::ReadDelay) {
            *row -= &mean;
        }
    }
}

fn deviation(covariance: &DMatrix<f64>, row: &DVector<f64>) -> f64 {
    row.dot(&(covariance * row)).max(0.0).sqrt()
}

/// Change of the coordinates that multiplies all torques, inertias and masses by the same factor. Common coordinates
/// are used where they exist.
fn scale_direction(parameters: &[FreeParameter], joints: usize) -> DVector<f64> {
    let is_common = |parameter: &FreeParameter| parameter.members.len() == joints && joints > 1;
    let has_common = |quantity: Quantity| parameters.iter().any(|own| own.quantity == quantity && is_common(own));
    let part = |parameter: &FreeParameter| {
        let quantity = parameter.quantity;
        let carries = quantity.has_scale() && (is_common(parameter) || !has_common(quantity));
        if carries { 1.0 } else { 0.0 }
    };
    DVector::from_iterator(parameters.len(), parameters.iter().map(part))
}

/// Variance of the component along a direction u in a normal distribution with covariance C: `1 / (uᵀ C⁻¹ u)`. Without
/// this component, the covariance is `C - u uᵀ / (uᵀ C⁻¹ u)`.
fn variance_along(covariance: &DMatrix<f64>, direction: &DVector<f64>) -> f64 {
    let solved = covariance.clone().cholesky().map(|factor| factor.solve(direction));
    solved.map_or(0.0, |solved| direction.dot(&solved)).recip().min(f64::MAX)
}
