//! Joint gains for torque signals in an unknown unit, estimated together with the parameters from a known payload.

use super::ordinary::{OrdinarySettings, ordinary_least_squares};
use super::weighted::{WeightedSettings, weighted_least_squares};
use crate::error::{EstimationError, expect};
use crate::factor::{JointRows, LinearProblem, SegmentedFactor};
use crate::uncertainty::{CovarianceMethod, Estimate, EstimateStatus};
use dynident_dynamics::independent_columns;
use nalgebra::DMatrix;
use serde::Serialize;

/// Maximum number of Gauss-Newton steps; three to six are usual.
const MAX_STEPS: usize = 50;
/// The iteration ends when no value moves by more than this share of its standard deviation under white noise.
const STEP_TOLERANCE: f64 = 1.0e-4;
/// Maximum number of halvings of a step before the iteration ends.
const MAX_HALVINGS: usize = 12;
/// Minimum share of a gain's column, relative to its norm, in a dependence between columns for the gain to be part of
/// it.
const MIN_DEPENDENCE_SHARE: f64 = 1.0e-6;

/// `u_j = (1/g_j) W_j (θ + c) + noise`: logged signal u_j of joint j in its own unit, with gain g_j, regressor W_j
/// and parameters θ. c are the parameters of a known payload in some of the logs.
#[derive(Clone, Debug)]
pub struct GainProblem<'a> {
    /// Rows `[W | u]` over the columns θ.
    pub rows: &'a LinearProblem,
    /// Known part c of the parameters for every log, one value per column: the payload in logs with payload, zero in
    /// others.
    pub known: Vec<Vec<f64>>,
}

/// The gain of one joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointGain {
    /// The joint.
    pub joint: String,
    /// Torque per unit of the logged signal, Nm (N); the held value if not identified.
    pub gain: f64,
    /// Standard deviation of the gain.
    pub std: f64,
    /// Half-width of the 95 % interval of the gain.
    pub half_width_95: f64,
    /// False if any other gain of this joint fits equally well with other parameters, because no known payload acts
    /// on the joint.
    pub identified: bool,
}

/// Result of [`joint_gains`].
#[derive(Clone, Debug)]
pub struct GainEstimate {
    /// θ, then `1/g_j` of every joint; `joint_sigma` is in the joints' own units.
    pub estimate: Estimate,
    /// The gains, in the order of the joints.
    pub gains: Vec<JointGain>,
}

/// Estimates parameters and gains together, `min Σ_j ‖u_j − k_j W_j (θ + c)‖² / σ_j²` over θ and `k_j = 1/g_j`, by
/// Gauss-Newton steps on the factors.
///
/// The noisy signal u is on the left side. With gains in front of u (`g_j u_j = W_j (θ + c)`) least squares biases
/// the gains to zero; the usual remedy is total least squares (Gautier and Briot, ICRA 2012 and ASME J. Dyn. Sys.
/// Meas. Control 136 (2014) 051025). The start values solve these linear equations with u replaced by its fit on the
/// columns of its own log, which noise does not bias. Every step is a weighted fit of the columns `k_j W_j` and `W_j
/// (θ + c)`; the covariance is that of the last step.
///
/// A known payload must act on the joint. Otherwise all gains and parameters of the joint (or of all joints that
/// share parameters) can be multiplied by the same number. Such gains are not `identified` and are held at their
/// start values.
///
/// # Errors
/// [`EstimationError::Mismatch`] for wrong shapes or a problem with a prior, [`EstimationError::Setting`] for a load
/// that is not finite or zero in all logs, and those of [`weighted_least_squares`].
#[doc(alias("torque constant", "drive gain"))]
pub fn joint_gains(problem: &GainProblem<'_>, settings: &WeightedSettings) -> Result<GainEstimate, EstimationError> {
    check(problem)?;
    let rows = problem.rows;
    let (count, joints) = (rows.columns().len(), rows.joints().len());
    let merged: Vec<SegmentedFactor> =
        rows.equations().iter().map(|equation| equation.factor.as_one_segment()).collect();
    let quick = WeightedSettings { covariance: CovarianceMethod::White, ..settings.clone() };
    let mut x = start(problem, &merged, &quick)?;
    let mut misfit = misfit(problem, &x)?;
    let mut settled = false;
    let mut steps = 0;
    while !settled && steps < MAX_STEPS {
        steps += 1;
        let step = weighted_least_squares(&linearised(problem, Some(&merged), &x)?, &quick)?;
        let mut share = 1.0;
        let mut better = None;
        for _ in 0..=MAX_HALVINGS {
            let tried: Vec<f64> = x.iter().zip(&step.values).map(|(from, to)| from + share * (to - from)).collect();
            let usable = tried[count..].iter().zip(&x[count..]).all(|(k, old)| k * old > 0.0);
            if usable {
                let found = self::misfit(problem, &tried)?;
                if found <= misfit {
                    better = Some((tried, found));
                    break;
                }
            }
            share *= 0.5;
        }
        // No smaller misfit along the step: the iteration has converged up to rounding.
        let Some((next, found)) = better else { break };
        settled = next.iter().zip(&x).zip(&step.std).all(|((a, b), std)| (a - b).abs() <= STEP_TOLERANCE * std);
        (x, misfit) = (next, found);
    }
    let last = linearised(problem, None, &x)?;
    let mut estimate = weighted_least_squares(&last, settings)?;
    estimate.iterations = steps + 1;
    if steps == MAX_STEPS && !settled {
        estimate.status = EstimateStatus::IterationLimit;
    }
    let held = not_identified(&last, &estimate, count, settings)?;
    let gains = (0..joints)
        .map(|joint| {
            let k = estimate.values[count + joint];
            let square = k * k;
            JointGain {
                joint: rows.joints()[joint].clone(),
                gain: 1.0 / k,
                std: estimate.std[count + joint] / square,
                half_width_95: estimate.half_width_95[count + joint] / square,
                identified: !held[joint],
            }
        })
        .collect();
    Ok(GainEstimate { estimate, gains })
}

fn check(problem: &GainProblem<'_>) -> Result<(), EstimationError> {
    let rows = problem.rows;
    expect("known loads, one for each log", rows.logs().len(), problem.known.len())?;
    for known in &problem.known {
        expect("values of a known load", rows.columns().len(), known.len())?;
        if let Some(&value) = known.iter().find(|value| !value.is_finite()) {
            return Err(EstimationError::Setting { setting: "known load", value, fix: "use finite numbers" });
        }
    }
    if rows.prior().is_some() {
        let what = "priors of a problem with unknown gains".into();
        return Err(EstimationError::Mismatch { what, expected: 0, found: 1 });
    }
    if problem.known.iter().flatten().all(|&value| value == 0.0) {
        let fix = "use at least one log with a known load";
        return Err(EstimationError::Setting { setting: "known load", value: 0.0, fix });
    }
    Ok(())
}

/// `θ + c` for the columns of an equation.
fn loaded(problem: &GainProblem<'_>, equation: &JointRows, x: &[f64]) -> Vec<f64> {
    let known = &problem.known[equation.log];
    equation.columns.iter().map(|&column| x[column] + known[column]).collect()
}

/// Objective of the weighted fit, `Σ_j N_j ln ‖u_j − k_j W_j (θ + c)‖²`.
fn misfit(problem: &GainProblem<'_>, x: &[f64]) -> Result<f64, EstimationError> {
    let rows = problem.rows;
    let count = rows.columns().len();
    let (mut squares, mut torque) = (vec![0.0; rows.joints().len()], vec![0.0; rows.joints().len()]);
    for equation in rows.equations() {
        let k = x[count + equation.joint];
        let theta: Vec<f64> = loaded(problem, equation, x).iter().map(|value| k * value).collect();
        let total = equation.factor.total();
        squares[equation.joint] += total.residual_sum_of_squares(&theta)?;
        torque[equation.joint] += total.torque_norm().powi(2);
    }
    // Rounding error of the torque.
    let floor = |torque: f64| (1.0e-24 * torque).max(f64::MIN_POSITIVE);
    let terms = squares.iter().zip(&torque).zip(rows.joint_rows());
    Ok(terms.map(|((square, &torque), n)| n as f64 * square.max(floor(torque)).ln()).sum())
}

/// Columns `k W` for θ and `W (θ + c)` for k at x. The right-hand side is chosen so that the solution is the next x,
/// not a change of x.
fn linearised(
    problem: &GainProblem<'_>,
    merged: Option<&[SegmentedFactor]>,
    x: &[f64],
) -> Result<LinearProblem, EstimationError> {
    let rows = problem.rows;
    let count = rows.columns().len();
    let names = rows.columns().iter().cloned().chain(rows.joints().iter().map(|joint| format!("1/gain {joint}")));
    let mut linear = LinearProblem::new(names.collect(), rows.joints().to_vec())
        .with_fallback(x.to_vec())?
        .with_unexcited(rows.unexcited().clone())?;
    for (number, equation) in rows.equations().iter().enumerate() {
        let (own, k) = (equation.columns.len(), x[count + equation.joint]);
        let mut map = DMatrix::zeros(own + 1, own + 2);
        let total = loaded(problem, equation, x);
        for (local, &column) in equation.columns.iter().enumerate() {
            map[(local, local)] = k;
            map[(local, own)] = total[local];
            map[(local, own + 1)] = k * x[column];
        }
        map[(own, own + 1)] = 1.0;
        let factor = merged.map_or(&equation.factor, |merged| &merged[number]);
        let columns = equation.columns.iter().copied().chain([count + equation.joint]).collect();
        linear.add(&rows.logs()[equation.log], equation.joint, columns, factor.mapped(&map)?)?;
    }
    Ok(linear)
}

/// Start values from `g_j û_j − W_j θ = W_j c`, where û is the fit of u on the columns of its own log.
fn start(
    problem: &GainProblem<'_>,
    merged: &[SegmentedFactor],
    settings: &WeightedSettings,
) -> Result<Vec<f64>, EstimationError> {
    let rows = problem.rows;
    let (count, joints) = (rows.columns().len(), rows.joints().len());
    let names = rows.columns().iter().chain(rows.joints()).cloned().collect();
    // Undetermined parameters are zero, undetermined gains one.
    let mut fallback: Vec<f64> = (0..count + joints).map(|column| f64::from(u8::from(column >= count))).collect();
    for &column in &rows.unexcited().columns {
        fallback[column] = rows.fallback()[column];
    }
    let mut linear = LinearProblem::new(names, rows.joints().to_vec())
        .with_fallback(fallback)?
        .with_unexcited(rows.unexcited().clone())?;
    for (equation, factor) in rows.equations().iter().zip(merged) {
        let own = equation.columns.len();
        let names = equation.columns.iter().map(|&column| rows.columns()[column].clone()).collect();
        let mut alone = LinearProblem::new(names, vec![rows.joints()[equation.joint].clone()]);
        alone.add("log", 0, (0..own).collect(), factor.clone())?;
        let ordinary = OrdinarySettings { rank: settings.rank, covariance: CovarianceMethod::White };
        let fitted = ordinary_least_squares(&alone, &ordinary)?.values;
        let mut map = DMatrix::zeros(own + 1, own + 2);
        for (local, &column) in equation.columns.iter().enumerate() {
            map[(local, local)] = -1.0;
            map[(local, own)] = fitted[local];
            map[(local, own + 1)] = problem.known[equation.log][column];
        }
        let columns = equation.columns.iter().copied().chain([count + equation.joint]).collect();
        linear.add(&rows.logs()[equation.log], equation.joint, columns, factor.mapped(&map)?)?;
    }
    // Equal weights: with noise-free data the residuals are only rounding errors and unusable as weights.
    let ordinary = OrdinarySettings { rank: settings.rank, covariance: CovarianceMethod::White };
    let mut x = ordinary_least_squares(&linear, &ordinary)?.values;
    for (joint, gain) in x[count..].iter_mut().enumerate() {
        let scale = rows.equations().iter().filter(|equation| equation.joint == joint);
        let largest = scale.map(|equation| equation.factor.total().torque_norm()).fold(0.0, f64::max);
        // A gain near zero would give an unbounded reciprocal.
        let least = if largest > 0.0 { 1.0e-9 / largest } else { 1.0 };
        *gain = 1.0 / if gain.abs() > least { *gain } else { 1.0 };
    }
    Ok(x)
}

/// Returns which gains are part of a dependence between columns, and therefore not identified.
fn not_identified(
    last: &LinearProblem,
    estimate: &Estimate,
    count: usize,
    settings: &WeightedSettings,
) -> Result<Vec<bool>, EstimationError> {
    let joints = last.joints().len();
    let mut held = vec![false; joints];
    if estimate.rank.fixed.iter().all(|fixed| fixed.column < count) {
        return Ok(held);
    }
    let weights: Vec<f64> = estimate.joint_sigma.iter().map(|sigma| 1.0 / sigma).collect();
    let mut triangle = last.combined(&weights)?.regressor_triangle();
    for mut column in triangle.column_iter_mut() {
        let norm = column.norm();
        column /= if norm > 0.0 { norm } else { 1.0 };
    }
    let split = independent_columns(&triangle, settings.rank.tolerance);
    for (place, &column) in split.dependent.iter().enumerate() {
        if column < count {
            continue;
        }
        held[column - count] = true;
        for (row, &other) in split.independent.iter().enumerate() {
            if other >= count && split.regrouping[(row, place)].abs() > MIN_DEPENDENCE_SHARE {
                held[other - count] = true;
            }
        }
    }
    Ok(held)
}
