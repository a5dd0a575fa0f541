//! What the parameters that several joints share show about the scale of each joint's torque.
//!
//! Masses and inertias of a body enter the torque of all joints before it. If the torque of one joint is scaled, its
//! rows require other values of these parameters than the rows of the other joints. Around an estimate θ̂ the torque of
//! joint j with the scale `1 + κ_j` is
//!
//! `τ_j = (1 + κ_j) W_j θ ≈ W_j θ + κ_j W_j θ̂`
//!
//! which is linear in θ and κ ([`with_free_gains`]). A scale that all joints share only changes θ, so that scales are
//! relative: to the joint with which the others agree best. Parameters that one joint alone determines (its friction
//! and drive inertia) contribute nothing; a joint whose torque shares too little with the others gets a wide bar.

use crate::error::IterationError;
use crate::estimate::RunEstimate;
use crate::leg::IterationTask;
use crate::run_logs::{RunLog, identification_settings, recordings};
use crate::settings::{RunIdentificationSettings, Scheme};
use dynident_estimation::{WeightedSettings, weighted_least_squares};
use dynident_identification::estimators::estimate;
use dynident_identification::payload::with_free_gains;
use dynident_identification::{Execution, Logs, RegressorModel, training_rows};
use nalgebra::DMatrix;

/// A wider standard deviation says nothing.
const WIDEST_STD: f64 = 0.3;
/// Agreement of two joints is judged in units of the standard deviation of their ratio, at least of this much.
const LEAST_STD: f64 = 0.02;

/// The scale of one joint's torque relative to the other joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RowScale {
    pub(crate) value: f64,
    pub(crate) std: f64,
}

/// The relative torque scale of each joint by all `runs`; none where it is not determined. `task` is with the friction
/// in force, `known` the estimate of these runs.
///
/// # Errors
/// Records that do not belong to the task.
pub(crate) fn row_scales(
    task: &IterationTask,
    runs: &[RunLog<'_>],
    settings: &RunIdentificationSettings,
    known: &RunEstimate,
) -> Result<Vec<Option<RowScale>>, IterationError> {
    let dof = task.robot.dof();
    let cannot = settings.scheme != Scheme::AllJoints || !task.known.is_empty() || !settings.payloads.is_empty();
    if cannot || dof < 2 {
        return Ok(vec![None; dof]);
    }
    let motions = recordings(task, runs, settings)?;
    let mut identification = identification_settings(task, settings, runs.len());
    identification.friction.clear();
    identification.motion.torque_lag_s = known.lag.taken_off();
    let all: Vec<usize> = (0..motions.len()).collect();
    let found = || {
        let model = RegressorModel::from(task.robot.clone());
        let execution = Execution::default();
        let logs = Logs::new(task.robot.model(), &motions, identification.filters(), &all, None, execution).ok()?;
        let training = training_rows((&logs, &identification), model, &all, &[], None).ok()?;
        let found = estimate(&training.rows((&logs, &identification), &all), None).ok()?.estimate;
        // Any joint may be the first reference: ratios follow from all of them.
        let free: Vec<usize> = (1..training.joints.len()).collect();
        let columns = training.problem.columns().len();
        let without_load = vec![vec![0.0; columns]; training.problem.logs().len()];
        let wider = with_free_gains(training.problem.clone(), &free, (&without_load, &found.values)).ok()?;
        let scaled = weighted_least_squares(&wider, &WeightedSettings::default()).ok()?;
        let is_fixed = |column: usize| scaled.rank.fixed.iter().any(|fixed| fixed.column == column);
        let value = |place: usize| match place {
            0 => Some(0.0),
            place => (!is_fixed(columns + place - 1)).then(|| scaled.values[columns + place - 1]),
        };
        let values: Vec<Option<f64>> = (0..training.joints.len()).map(value).collect();
        let covariance = |a: usize, b: usize| match (a, b) {
            (0, _) | (_, 0) => 0.0,
            (a, b) => scaled.covariance[(columns + a - 1, columns + b - 1)],
        };
        let covariance = DMatrix::from_fn(values.len(), values.len(), covariance);
        let mut out = vec![None; dof];
        for (&joint, scale) in training.joints.iter().zip(relative(&values, &covariance)) {
            out[joint] = scale;
        }
        Some(out)
    };
    Ok(found().unwrap_or_else(|| vec![None; dof]))
}

/// Scales `1 + κ` relative to that of the joint with which the others agree best.
fn relative(kappa: &[Option<f64>], covariance: &DMatrix<f64>) -> Vec<Option<RowScale>> {
    let std = |a: usize, b: usize| (covariance[(a, a)] + covariance[(b, b)] - 2.0 * covariance[(a, b)]).max(0.0).sqrt();
    let disagreement = |a: usize| -> Option<f64> {
        let own = kappa[a]?;
        // Beyond some deviations a joint is wrong, however far.
        let with = |(b, other): (usize, &Option<f64>)| {
            other.map_or(0.0, |other| ((own - other).abs() / std(a, b).max(LEAST_STD)).min(4.0))
        };
        let uncertainty: f64 = (0..kappa.len()).filter(|b| kappa[*b].is_some()).map(|b| std(a, b).min(1.0)).sum();
        Some(kappa.iter().enumerate().map(with).sum::<f64>() + uncertainty)
    };
    let places = (0..kappa.len()).filter_map(|a| Some((a, disagreement(a)?)));
    let Some((reference, _)) = places.min_by(|a, b| a.1.total_cmp(&b.1)) else { return vec![None; kappa.len()] };
    let of = |a: usize| -> Option<RowScale> {
        let value = (1.0 + kappa[a]?) / (1.0 + kappa[reference]?);
        let std = std(a, reference);
        (a != reference && std > 0.0 && std < WIDEST_STD && value.is_finite()).then_some(RowScale { value, std })
    };
    (0..kappa.len()).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three joints agree with each other, one does not: whichever was held is not the reference by that alone.
    #[test]
    fn scales_are_relative_to_the_joints_that_agree() {
        let covariance = DMatrix::from_fn(4, 4, |a, b| {
            if a == 0 || b == 0 {
                0.0
            } else if a == b {
                2e-4
            } else {
                1e-4
            }
        });
        let found = relative(&[Some(0.0), Some(0.25), Some(0.251), Some(0.249)], &covariance);
        let wrong = found[0].unwrap();
        assert!((wrong.value - 0.8).abs() < 2e-3 && wrong.std < 0.02, "{wrong:?}");
        assert!(found[1..].iter().flatten().all(|scale| (scale.value - 1.0).abs() < 2e-3), "{found:?}");
        assert_eq!(relative(&[None, None], &DMatrix::zeros(2, 2)), [None, None]);
    }
}
