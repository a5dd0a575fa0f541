//! Variation of parameters between logs, as a part of the error bars; friction, for example, varies from day to day.
//!
//! Each training log is also fitted alone. If the estimates of two logs differ by more than their error bars, the
//! parameters vary between the logs. For logs a and b, `z² = (θ_a − θ_b)² / (σ_a² + σ_b²)` is the squared difference of
//! a parameter in units of its variance. Let k² be the mean of z² over the pairs of logs and over all parameters of one
//! kind (bodies and drives, or friction). The variance of a parameter between logs is then `τ² = (k² − 1) σ̄²`, where
//! σ̄² is the mean variance of the parameter in fits to single logs. This is the method of moments of DerSimonian and
//! Laird, Controlled Clinical Trials 7 (1986) 177, with one k for parameters of one kind.
//!
//! The fit to all logs is a weighted mean of the fits to single logs, `θ̂ = Σ_l A_l θ_l`, with `A_l = N⁻¹ N_l`, the
//! information matrix N_l of log l and their sum N. The covariance T of the variation between logs adds
//! `Σ_l A_l T A_lᵀ` to the covariance of θ̂ as an estimate of the mean over all days. (If the motions of the logs
//! differ, varying friction also causes errors of bodies and drives.) As a prediction for a new day, θ̂ has an
//! additional error with covariance T. The error bars are for a new day: `Σ + Σ_l A_l T A_lᵀ + T`.

use crate::estimators::EstimationSettings;
use crate::friction_by_log::is_friction_column;
use crate::thresholds::LogVariationThresholds;
use crate::training::Training;
use dynident_estimation::{Estimate, EstimationError, LinearProblem, WeightedSettings, weighted_least_squares};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Differences of parameters between logs, in units of the error bars of fits to single logs (root mean square); 1
/// without variation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LogVariation {
    /// Ratio for bodies and drive inertias; `None` if single logs determine too few of them.
    pub bodies: Option<f64>,
    /// Ratio for friction, offsets and other joint torques; `None` if single logs determine too few of them.
    pub friction: Option<f64>,
}

/// Covariance that the variation between training logs adds to an estimate as a prediction for a new day, and the size
/// of the variation. `None` for a single log.
pub(crate) fn variation_of_logs(
    training: &Training,
    settings: &EstimationSettings,
    estimate: &Estimate,
) -> Option<(DMatrix<f64>, LogVariation)> {
    let problem = &training.problem;
    if problem.logs().len() < 2 || !training.columns.is_plain() {
        return None;
    }
    let count = training.columns.base();
    let weighted = settings.weighted();
    let alone: Vec<Estimate> =
        (0..problem.logs().len()).filter_map(|log| fit_alone(problem, log, &weighted, estimate).ok()).collect();
    let is_friction: Vec<bool> = training.model.layout().columns()[..count].iter().map(is_friction_column).collect();
    let [bodies, friction] = [false, true].map(|kind| {
        let columns: Vec<usize> = (0..count).filter(|&column| is_friction[column] == kind).collect();
        variation(&alone, &columns, &settings.thresholds.log_variation)
    });

    // Covariance T, with the correlations of the fits to single logs; then its effect on the fit to all logs.
    let k = |column: usize| if is_friction[column] { friction } else { bodies }.unwrap_or(1.0).max(1.0);
    let apart = |column: usize| (k(column).powi(2) - 1.0).sqrt();
    let of_one: DMatrix<f64> = alone.iter().fold(DMatrix::zeros(count, count), |sum, one| {
        sum + one.covariance.view((0, 0), (count, count)) / alone.len().max(1) as f64
    });
    let between = DMatrix::from_fn(count, count, |row, column| of_one[(row, column)] * apart(row) * apart(column));
    let of_mean = error_of_all(problem, estimate, &between).unwrap_or_else(|| &between / alone.len().max(1) as f64);
    Some((of_mean + between, LogVariation { bodies, friction }))
}

/// Covariance `Σ_l A_l T A_lᵀ` that the variation T (`between`) of parameters between logs causes in the fit to all
/// logs. `None` if the rows of all logs do not determine the free parameters of the estimate.
fn error_of_all(problem: &LinearProblem, estimate: &Estimate, between: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let count = between.nrows();
    let is_free = |column: &usize| estimate.rank.fixed.iter().all(|fixed| fixed.column != *column);
    let free: Vec<usize> = (0..count).filter(is_free).collect();
    let weights: Vec<f64> =
        estimate.joint_sigma.iter().map(|sigma| if *sigma > 0.0 { sigma.recip() } else { 1.0 }).collect();
    let triangle_of = |problem: &LinearProblem| {
        let factor = problem.combined(&weights).and_then(|factor| factor.selected(&free)).ok()?;
        Some(factor.regressor_triangle())
    };
    // Triangular factor R of all rows. The columns are scaled to equal length, because `N = RᵀR` squares the condition
    // number.
    let mut all = triangle_of(problem)?;
    let lengths: Vec<f64> = all.column_iter().map(|column| column.norm()).collect();
    let shorten = |triangle: &mut DMatrix<f64>| {
        for (mut column, length) in triangle.column_iter_mut().zip(&lengths) {
            column /= *length;
        }
    };
    if lengths.contains(&0.0) {
        return None;
    }
    shorten(&mut all);
    let varied = DMatrix::from_fn(free.len(), free.len(), |row, column| {
        between[(free[row], free[column])] * lengths[row] * lengths[column]
    });
    let mut error = DMatrix::zeros(free.len(), free.len());
    for log in 0..problem.logs().len() {
        let mut own = triangle_of(&rows_of(problem, log).ok()?)?;
        shorten(&mut own);
        let from_right = all.tr_solve_upper_triangular(&(own.transpose() * own))?;
        let influence = all.solve_upper_triangular(&from_right)?;
        error += &influence * &varied * influence.transpose();
    }
    let mut further = DMatrix::zeros(count, count);
    for (row, &to_row) in free.iter().enumerate() {
        for (column, &to_column) in free.iter().enumerate() {
            further[(to_row, to_column)] = error[(row, column)] / (lengths[row] * lengths[column]);
        }
    }
    further.iter().all(|value| value.is_finite()).then_some(further)
}

fn rows_of(problem: &LinearProblem, log: usize) -> Result<LinearProblem, EstimationError> {
    rows_of_logs(problem, |own| own == log)
}

fn rows_of_logs(problem: &LinearProblem, is_wanted: impl Fn(usize) -> bool) -> Result<LinearProblem, EstimationError> {
    let mut alone = LinearProblem::new(problem.columns().to_vec(), problem.joints().to_vec());
    for rows in problem.equations().iter().filter(|rows| is_wanted(rows.log)) {
        alone.add(&problem.logs()[rows.log], rows.joint, rows.columns.clone(), rows.factor.clone())?;
    }
    Ok(alone)
}

/// Fit to the rows of one log.
pub(crate) fn fit_alone(
    problem: &LinearProblem,
    log: usize,
    settings: &WeightedSettings,
    estimate: &Estimate,
) -> Result<Estimate, EstimationError> {
    fit_rows(rows_of(problem, log)?, problem, settings, estimate)
}

/// Fit to the rows of all other logs.
pub(crate) fn fit_without(
    problem: &LinearProblem,
    log: usize,
    settings: &WeightedSettings,
    estimate: &Estimate,
) -> Result<Estimate, EstimationError> {
    fit_rows(rows_of_logs(problem, |own| own != log)?, problem, settings, estimate)
}

fn fit_rows(
    rows: LinearProblem,
    problem: &LinearProblem,
    settings: &WeightedSettings,
    estimate: &Estimate,
) -> Result<Estimate, EstimationError> {
    let rows = rows.with_fallback(estimate.values.clone())?.with_unexcited(problem.unexcited().clone())?;
    weighted_least_squares(&rows, settings)
}

/// Root mean square of the parameter differences z over pairs of logs, corrected for Student's distribution: the ratio
/// k of the parameters in `columns`.
fn variation(alone: &[Estimate], columns: &[usize], thresholds: &LogVariationThresholds) -> Option<f64> {
    let is_fixed = |one: &Estimate, column: usize| one.rank.fixed.iter().any(|fixed| fixed.column == column);
    let mut squares = Vec::new();
    for (number, a) in alone.iter().enumerate() {
        for b in &alone[number + 1..] {
            for &column in columns {
                let freedoms = a.std_degrees_of_freedom[column].min(b.std_degrees_of_freedom[column]);
                let variance = a.std[column].powi(2) + b.std[column].powi(2);
                let is_unknown = freedoms < thresholds.min_degrees_of_freedom || variance <= 0.0;
                if is_fixed(a, column) || is_fixed(b, column) || is_unknown {
                    continue;
                }
                let z2 = (a.values[column] - b.values[column]).powi(2) / variance;
                squares.push(z2 * (freedoms - 2.0) / freedoms);
            }
        }
    }
    if squares.len() < thresholds.min_pairs {
        return None;
    }
    squares.sort_by(f64::total_cmp);
    // The median of the square of a standard normal variable is 0.455.
    let typical = (squares[squares.len() / 2] / 0.455).max(1.0);
    let bounded = squares.iter().map(|z2| z2.min(thresholds.max_relative_square * typical));
    Some((bounded.sum::<f64>() / squares.len() as f64).sqrt())
}
