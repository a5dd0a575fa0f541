//! Detection of a load that only one of several training logs carries.

use super::parts::{Part, parts};
use crate::between_logs::{fit_alone, fit_without};
use crate::thresholds::LogLoadThresholds;
use crate::training::Training;
use dynident_estimation::changes::{ChangeSettings, explanations};
use dynident_estimation::{Estimate, EstimationError, WeightedSettings, weighted_least_squares};
use nalgebra::{DMatrix, DVector};

/// A load that one training log carries and the other training logs do not.
#[derive(Clone, Debug, PartialEq)]
pub struct LogLoad {
    /// Index of the recording.
    pub log: usize,
    /// Index of the body.
    pub body: usize,
    /// Mass of the load, kg.
    pub mass_kg: f64,
    /// Standard deviation of the mass, kg.
    pub mass_std_kg: f64,
    /// Centre of mass of the load in the frame of the body, m.
    pub com_m: [f64; 3],
    /// Probability that the body differs between the logs.
    pub probability: f64,
}

/// Finds loads of single training logs. For each log, it compares explanations of the difference between the fit to
/// this log and the fit to the other logs, which are computed from triangular factors. Empty for a single log, and if
/// the study declares payloads.
///
/// # Errors
/// As [`weighted_least_squares`] and [`explanations`].
pub(crate) fn log_loads(
    training: &Training,
    settings: &WeightedSettings,
    limits: &LogLoadThresholds,
) -> Result<Vec<LogLoad>, EstimationError> {
    let problem = &training.problem;
    let logs: Vec<usize> = training
        .logs
        .iter()
        .filter(|log| log.factors.iter().any(|factor| factor.rows() > 0))
        .map(|log| log.index)
        .collect();
    if logs.len() < 2 || logs.len() != problem.logs().len() || !training.columns.is_plain() {
        return Ok(Vec::new());
    }
    let all = weighted_least_squares(problem, settings)?;
    let mut found: Vec<LogLoad> = Vec::new();
    // With two logs, both comparisons give the same difference.
    let tested = if logs.len() == 2 { 1 } else { logs.len() };
    for log in 0..tested {
        // A log that does not determine the parameters alone cannot be tested.
        let fits = fit_alone(problem, log, settings, &all)
            .and_then(|own| Ok((own, fit_without(problem, log, settings, &all)?)));
        let Ok((own, others)) = fits else { continue };
        let Some(mut load) = load_between(training, &own, &others, limits)? else { continue };
        load.log = logs[log];
        if load.mass_kg < 0.0 {
            if logs.len() > 2 {
                continue;
            }
            load = LogLoad { log: logs[1], mass_kg: -load.mass_kg, ..load };
        }
        found.push(load);
    }
    Ok(found)
}

/// The load that explains the difference between the fits `own` and `others`; its mass is negative if the other logs
/// carry the load.
fn load_between(
    training: &Training,
    own: &Estimate,
    others: &Estimate,
    limits: &LogLoadThresholds,
) -> Result<Option<LogLoad>, EstimationError> {
    let robot = &training.model.parametric;
    let base = robot.base();
    let is_fixed = |fit: &Estimate, row: usize| fit.rank.fixed.iter().any(|fixed| fixed.column == row);
    let rows: Vec<usize> = (0..base.count()).filter(|&row| !is_fixed(own, row) && !is_fixed(others, row)).collect();
    let difference = DVector::from_fn(rows.len(), |k, _| own.values[rows[k]] - others.values[rows[k]]);
    let both = own.joint_covariance() + others.joint_covariance();
    let covariance = DMatrix::from_fn(rows.len(), rows.len(), |a, b| both[(rows[a], rows[b])]);
    let size = |fit: &Estimate, row: usize| fit.values[row].abs() + fit.std[row];
    let sizes: Vec<f64> = rows.iter().map(|&row| size(own, row).max(size(others, row))).collect();
    let parts = parts(robot.model(), base, &rows, &sizes);
    if rows.is_empty() || parts.groups.is_empty() {
        return Ok(None);
    }
    let found = explanations(&difference, &[covariance], &parts.groups, &ChangeSettings::default())?;
    let Some(best) = found.first().filter(|best| best.groups.len() <= 2) else { return Ok(None) };
    let mut loads = best.groups.iter().zip(&best.changes).filter_map(|(&group, (values, covariance))| {
        let Part::Body(body) = parts.parts[group] else { return None };
        let sizes = &parts.sizes[group];
        let has_body = |own: &&dynident_estimation::changes::Explanation| own.groups.contains(&group);
        let probability: f64 = found.iter().filter(has_body).map(|own| own.probability).sum();
        let mass = values[0] * sizes[0];
        Some(LogLoad {
            log: 0,
            body,
            mass_kg: mass,
            mass_std_kg: covariance[(0, 0)].max(0.0).sqrt() * sizes[0],
            com_m: core::array::from_fn(|axis| values[axis + 1] * sizes[axis + 1] / mass),
            probability,
        })
    });
    let is_clear = |load: &LogLoad| {
        load.probability >= limits.min_probability && load.mass_kg.abs() >= limits.min_deviations * load.mass_std_kg
    };
    Ok(loads.find(is_clear))
}
