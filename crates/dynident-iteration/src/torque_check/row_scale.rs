//! Scale of each joint's torque from the parameters that several joints share.
//!
//! Masses and inertias of a body affect the torque of all joints between the base and the body. If the torque of one
//! joint is scaled, its rows require other values of these parameters than the rows of the other joints. Around an
//! estimate θ̂, the torque of joint j with the scale `1 + κ_j` and the regressor W_j is
//!
//! `τ_j = (1 + κ_j) W_j θ ≈ W_j θ + κ_j W_j θ̂`
//!
//! which is linear in θ and κ ([`with_free_gains`]). A scale that all joints share only changes θ, so it cannot be
//! detected. Each joint is tested against all others: its κ is free, the others are zero. The joint whose κ maximises
//! the likelihood is reported as wrong, and the other joints are tested again with its κ free. Model errors
//! (stiction, backlash) affect the scales of all joints, so a deviation must also exceed those of the other joints.
//! Parameters on which only one joint depends (its friction and drive inertia) contribute nothing; a joint that
//! depends little on shared parameters gets a wide error bar.

use crate::estimation::estimate::RunEstimate;
use crate::estimation::run_logs::{RunLog, identification_settings, recordings};
use crate::setup::error::IterationError;
use crate::setup::leg::IterationTask;
use crate::setup::settings::{RunIdentificationSettings, Scheme};
use dynident_estimation::{LinearProblem, WeightedSettings, weighted_least_squares};
use dynident_identification::estimators::estimate;
use dynident_identification::payload::with_free_gains;
use dynident_identification::{Execution, Logs, RegressorModel, training_rows};

/// Largest standard deviation with which a scale is treated as determined.
const MAX_SCALE_STD: f64 = 0.3;
/// Minimum share of a joint's torque that no other parameter explains; with less, model errors are amplified.
const MIN_OWN_SHARE: f64 = 0.02;
/// Largest deviation for which the linearisation is valid.
const MAX_DEVIATION: f64 = 0.6;
/// Largest difference of the log-likelihood at which the scale of another joint explains the rows nearly as well: 3.5
/// standard deviations for independent rows.
const MAX_LOG_LIKELIHOOD_DIFFERENCE: f64 = 6.0;

/// Ratio of the median absolute deviation of a normal distribution to its standard deviation.
const MEDIAN_TO_STD: f64 = 0.6745;
/// Minimum number of other joints from which the model error is estimated, and the spread that is assumed for fewer
/// joints. A correct SCARA, in which only the first two joints share parameters, reached five standard deviations.
const MIN_OTHER_JOINTS: usize = 3;
const DEFAULT_SPREAD: f64 = 2.0;

/// The scale of one joint's torque relative to the other joints.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RowScale {
    pub(crate) value: f64,
    pub(crate) std: f64,
    pub(crate) is_wrong: bool,
    /// Joints whose scale would explain the rows nearly as well, if this scale is wrong.
    pub(crate) or: Vec<usize>,
}

/// The smallest relevant deviation, as a share of the torque and as a number of standard deviations.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LeastDeviation {
    pub(crate) share: f64,
    pub(crate) sigmas: f64,
}

/// The relative torque scale of each joint from all `runs`; `None` if it is not determined. `task` includes the
/// selected friction, `known` is the estimate of these runs.
pub(crate) fn row_scales(
    task: &IterationTask,
    runs: &[RunLog<'_>],
    settings: &RunIdentificationSettings,
    known: &RunEstimate,
    least: LeastDeviation,
) -> Result<Vec<Option<RowScale>>, IterationError> {
    let dof = task.robot.dof();
    let cannot = settings.scheme != Scheme::AllJoints || !task.known.is_empty() || !settings.payloads.is_empty();
    if cannot || dof < 2 {
        return Ok(vec![None; dof]);
    }
    let motions = recordings(task, runs, settings)?;
    let mut identification = identification_settings(task, settings, runs.len());
    identification.friction = identification.friction.without_selection();
    identification.motion.torque_lag_s = known.lag.taken_off();
    let all: Vec<usize> = (0..motions.len()).collect();
    let found = || {
        let model = RegressorModel::from(task.robot.clone());
        let execution = Execution::default();
        let logs =
            Logs::new(task.robot.model(), &motions, identification.row_settings(), &all, None, execution).ok()?;
        let training = training_rows(&logs, &identification, model, &all, &[], None).ok()?;
        let found = estimate(&training.rows(&logs, &identification, &all), None).ok()?.estimate;
        let mut out = vec![None; dof];
        let scales = tested(&training.problem, &found.values, least);
        for (&joint, mut scale) in training.joints.iter().zip(scales) {
            if let Some(scale) = &mut scale {
                scale.or.iter_mut().for_each(|other| *other = training.joints[*other]);
            }
            out[joint] = scale;
        }
        Some(out)
    };
    Ok(found().unwrap_or_else(|| vec![None; dof]))
}

/// Tests the joints one after the other, by their indices in the problem.
fn tested(problem: &LinearProblem, values: &[f64], least: LeastDeviation) -> Vec<Option<RowScale>> {
    let joints = problem.joints().len();
    let mut wrong: Vec<(usize, Vec<usize>)> = Vec::new();
    loop {
        let chosen: Vec<usize> = wrong.iter().map(|(joint, _)| *joint).collect();
        let found = deviations(problem, values, &chosen);
        let likelihood = |joint: usize| found[joint].map_or(f64::NEG_INFINITY, |kappa| kappa.log_likelihood);
        let is_relevant = |&joint: &usize| {
            let is_large = |kappa: Kappa| kappa.value.abs() > least.share.max(least.sigmas * kappa.std);
            found[joint].is_some_and(is_large)
        };
        let open: Vec<usize> = (0..joints).filter(|joint| !chosen.contains(joint)).collect();
        let worst = open.iter().copied().filter(is_relevant).max_by(|&a, &b| likelihood(a).total_cmp(&likelihood(b)));
        // At most half of the joints can be wrong relative to the others.
        let is_outlier = |&worst: &usize| {
            let with_it: Vec<usize> = chosen.iter().copied().chain([worst]).collect();
            let spread = spread(&deviations(problem, values, &with_it), &with_it);
            found[worst].is_some_and(|kappa| kappa.value.abs() > least.sigmas * kappa.std * spread)
        };
        if let Some(worst) = worst.filter(|_| 2 * (chosen.len() + 1) <= joints).filter(is_outlier) {
            let is_rival = |&other: &usize| {
                other != worst && likelihood(other) > likelihood(worst) - MAX_LOG_LIKELIHOOD_DIFFERENCE
            };
            wrong.push((worst, open.iter().copied().filter(is_rival).collect()));
            continue;
        }
        let scale = |joint: usize| {
            let Kappa { value, std, .. } = found[joint]?;
            let or = wrong.iter().find(|(one, _)| *one == joint).map(|(_, or)| or.clone());
            Some(RowScale { value: 1.0 + value, std, is_wrong: or.is_some(), or: or.unwrap_or_default() })
        };
        return (0..joints).map(scale).collect();
    }
}

fn deviations(problem: &LinearProblem, values: &[f64], chosen: &[usize]) -> Vec<Option<Kappa>> {
    let of_joint = |joint: usize| -> Option<Kappa> {
        let others = chosen.iter().copied().filter(|&one| one != joint);
        let free: Vec<usize> = others.chain([joint]).collect();
        kappa(problem, values, &free, free.len() - 1)
    };
    (0..problem.joints().len()).map(of_joint).collect()
}

/// Standard deviation of the deviations of the joints that are not in `chosen`, in units of their own standard
/// deviations; at least one. It is computed from the median, which is robust against another wrong joint.
fn spread(found: &[Option<Kappa>], chosen: &[usize]) -> f64 {
    let others = found.iter().enumerate().filter(|(joint, _)| !chosen.contains(joint));
    let mut sizes: Vec<f64> = others.filter_map(|(_, kappa)| kappa.map(|own| (own.value / own.std).abs())).collect();
    sizes.sort_by(f64::total_cmp);
    if sizes.len() < MIN_OTHER_JOINTS { DEFAULT_SPREAD } else { (sizes[sizes.len() / 2] / MEDIAN_TO_STD).max(1.0) }
}

#[derive(Clone, Copy, Debug)]
struct Kappa {
    value: f64,
    std: f64,
    log_likelihood: f64,
}

/// κ of the joint `free[place]`, with the κ of all joints in `free` estimated together.
fn kappa(problem: &LinearProblem, values: &[f64], free: &[usize], place: usize) -> Option<Kappa> {
    let columns = problem.columns().len();
    let without_load = vec![vec![0.0; columns]; problem.logs().len()];
    let wider = with_free_gains(problem.clone(), free, &without_load, values).ok()?;
    let found = weighted_least_squares(&wider, &WeightedSettings::default()).ok()?;
    let column = columns + place;
    let (value, std) = (found.values[column], found.std[column]);
    let is_fixed = found.rank.fixed.iter().any(|fixed| fixed.column == column);
    // For white noise the standard deviation is σ divided by the norm of the predicted torque's component that is
    // orthogonal to the other columns.
    let joint = free[place];
    let of_joint = problem.equations().iter().filter(|equation| equation.joint == joint);
    let norm = of_joint.map(|equation| equation.factor.total().torque_norm().powi(2)).sum::<f64>().sqrt();
    let own_share = found.joint_sigma[joint] / (found.covariance_white[(column, column)].sqrt() * norm);
    let is_determined = !is_fixed && std > 0.0 && std < MAX_SCALE_STD && own_share > MIN_OWN_SHARE;
    let rows = problem.joint_rows();
    let of_rows = |(sigma, rows): (&f64, &usize)| -(*rows as f64) * sigma.max(f64::MIN_POSITIVE).ln();
    let log_likelihood = found.joint_sigma.iter().zip(&rows).map(of_rows).sum();
    (is_determined && value.abs() < MAX_DEVIATION).then_some(Kappa { value, std, log_likelihood })
}
