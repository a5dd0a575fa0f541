//! Estimation of torque lags together with the parameters, from the samples of one or several logs.
//!
//! A model that was fitted to late torque has absorbed a part of the lag: for a sine, the column of the inertia shifted
//! by a quarter period equals the column of viscous friction. Conversely, wrong nominal inertias look like a lag of
//! many milliseconds. Therefore the lag δ and the parameters θ are estimated together from
//! `τ(t + d) = Y(t) θ − (δ − d) ∂(Yθ)/∂t`, with the regressor Y and the torque τ taken `d` later. This is repeated
//! until `d` equals δ. The covariance of the lag is that of the last step, computed from time segments. It includes
//! model errors (backlash, elasticity) if they differ between segments.
//!
//! A joint that sticks at each reversal changes the sign of its friction at another time than the filtered velocity.
//! If this is significant, the [time of reversal](super::reversal) is estimated with the lag.

use super::measured::TorqueLag;
use super::reversal::{self, Reversal};
use super::rows::{DelayRows, NODES, SLOPES, lagrange};
use super::samples::DelayCheck;
use super::unknowns::Unknowns;
use crate::estimators::EstimationSettings;
use crate::log_noise::{LogNoise, weighted_by_log};
use crate::thresholds::LagThresholds;
use dynident_estimation::{
    Estimate, EstimationError, LinearProblem, SegmentedFactor, weighted_least_squares, weighted_values,
};
use dynident_rows::{Logs, RegressorModel};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Maximum number of steps; two to four are usual.
const MAX_STEPS: usize = 12;
/// Convergence criterion: no lag changes by more than this ratio of its standard deviation, or by more than this number
/// of samples.
const CONVERGENCE: (f64, f64) = (0.02, 1.0e-6);

/// Lags of the joints, estimated together with the parameters.
#[derive(Debug)]
pub struct LagFit {
    /// Result of the last step: parameters, unknown gains, the change of each joint's lag (s), then the time by which
    /// the friction of each joint changes its sign later than the velocity (s), if it was estimated.
    pub(crate) last: Estimate,
    /// Number of parameters: base parameters, payloads, and offsets of single logs.
    pub(crate) parameters: usize,
    pub(crate) first: usize,
    /// Time by which the torque of each joint is later than its motion; `None` if the samples do not determine it.
    pub(crate) joints: Vec<Option<TorqueLag>>,
    /// Times by which the friction of the joints changes its sign later than the velocity; empty if they are not
    /// significant.
    pub(crate) reversals: Vec<Reversal>,
    pub(crate) rows: Vec<usize>,
    pub(crate) usual_lag_s: f64,
    pub(crate) thresholds: LagThresholds,
}

impl LagFit {
    pub(crate) fn covariance(&self, joints: &[usize]) -> DMatrix<f64> {
        let of = |row: usize, column: usize| (self.first + joints[row], self.first + joints[column]);
        DMatrix::from_fn(joints.len(), joints.len(), |row, column| self.last.covariance[of(row, column)])
    }

    /// Sensitivity of parameters and unknown gains θ to the lags and the times of reversal λ of all joints,
    /// `∂θ/∂λ = Cov(θ, λ) Cov(λ, λ)⁻¹`, per second: one column for the lag of each joint, then one for its time of
    /// reversal if it was estimated. Zero for a λ that the samples do not determine.
    pub(crate) fn answers(&self) -> DMatrix<f64> {
        let dof = self.joints.len();
        let of_reversals = self.reversals.iter().map(|reversal| dof + reversal.joint);
        let known: Vec<usize> = (0..dof).filter(|&joint| self.joints[joint].is_some()).chain(of_reversals).collect();
        let mut answers = DMatrix::zeros(self.first, self.last.values.len() - self.first);
        let white = &self.last.covariance_white;
        let own =
            DMatrix::from_fn(known.len(), known.len(), |a, b| white[(self.first + known[a], self.first + known[b])]);
        let Some(own) = own.cholesky() else { return answers };
        for row in 0..self.first {
            let with_lags = DVector::from_fn(known.len(), |place, _| white[(row, self.first + known[place])]);
            for (place, answer) in own.solve(&with_lags).iter().enumerate() {
                answers[(row, known[place])] = *answer;
            }
        }
        answers
    }

    /// Sensitivity of parameters and unknown gains to the lag of each joint, per second ([`answers`](Self::answers)).
    pub(crate) fn lag_answers(&self) -> DMatrix<f64> {
        self.answers().columns(0, self.joints.len()).into_owned()
    }

    /// Error of parameters and unknown gains because the friction of the model changes its sign with the velocity: the
    /// sensitivity to each time of reversal, multiplied by the root of `ε² + σ²` (time ε, standard deviation σ).
    pub(crate) fn reversal_error(&self) -> DMatrix<f64> {
        let answers = self.answers();
        let of = |reversal: &Reversal| {
            answers.column(self.joints.len() + reversal.joint) * reversal.late_s.hypot(reversal.std_s)
        };
        let columns: Vec<_> = self.reversals.iter().map(of).collect();
        if columns.is_empty() { DMatrix::zeros(self.first, 0) } else { DMatrix::from_columns(&columns) }
    }

    /// Share of the squared residual of a joint that a separate lag of this joint explains.
    pub(crate) fn share(&self, joint: usize) -> f64 {
        let Some(lag) = self.joints[joint] else { return 0.0 };
        let column = self.first + joint;
        let gained = lag.lag_s.powi(2) / self.last.covariance_white[(column, column)].max(f64::MIN_POSITIVE);
        gained / (gained + self.rows[joint] as f64)
    }
}

struct Samples<'a> {
    checks: &'a [DelayCheck<'a>],
    with: (&'a Logs<'a>, &'a EstimationSettings),
    unknowns: Unknowns<'a>,
    rows: Vec<Vec<DelayRows>>,
    lag_s: Vec<f64>,
    /// `None` if the times of reversal are not estimated.
    reversals: Option<ReversalPrior>,
}

struct ReversalPrior {
    /// Standard deviation of the times of reversal around zero, s; infinite for times without prior.
    std_s: f64,
    /// Standard deviations of the joints' residuals, N m (N). The rows are divided by them, because the prior assumes
    /// rows with unit noise.
    joint_sigma: Vec<f64>,
}

/// Fits the lags of the joints, which are common to all logs. `noise` states whether logs have separate noise levels.
/// `None` for logs that are too short.
pub(crate) fn fit_lags(
    checks: &[DelayCheck<'_>],
    unknowns: Unknowns<'_>,
    noise: LogNoise,
    with: (&Logs<'_>, &EstimationSettings),
) -> Option<LagFit> {
    fitted(checks.first()?.model(), checks, unknowns, noise, with).ok()
}

/// Lags of the joints in one log, including lags that were compensated before; `None` if not determined. A lag is
/// marked as significant if the uncompensated part is.
pub(crate) fn lags_of_log(check: DelayCheck<'_>, with: (&Logs<'_>, &EstimationSettings)) -> Vec<Option<TorqueLag>> {
    let joints = check.model().model().dof();
    let taken_off = &with.0.motion.torque_lag_s;
    let before = |joint: usize| taken_off.as_ref().and_then(|lags| lags.at(joint)).unwrap_or(0.0);
    let unknowns = Unknowns::of_log(check.theta());
    let rest =
        fit_lags(&[check], unknowns, LogNoise::Shared, with).map_or_else(|| vec![None; joints], |fit| fit.joints);
    let total = |(joint, rest): (usize, Option<TorqueLag>)| rest.map(|rest| rest.after(before(joint)));
    rest.into_iter().enumerate().map(total).collect()
}

fn fitted(
    model: &RegressorModel,
    checks: &[DelayCheck<'_>],
    unknowns: Unknowns<'_>,
    noise: LogNoise,
    with: (&Logs<'_>, &EstimationSettings),
) -> Result<LagFit, EstimationError> {
    let (logs, settings) = with;
    let cutoff_hz = logs.motion.differentiator.cutoff_hz();
    let dof = model.model().dof();
    let own = model.model().characteristic_scale();
    let longest_s = own.seconds(settings.thresholds.lag.max_lag_s);
    let start = |joint: usize| {
        let coarse = |check: &DelayCheck<'_>| Some(check.coarse(joint, cutoff_hz, longest_s)? / check.rate_hz());
        checks.iter().find_map(coarse).unwrap_or(0.0).clamp(-longest_s, longest_s)
    };
    // Noisy logs also get less weight for the lag.
    let weighted = |problem: LinearProblem| match noise {
        LogNoise::Shared => Ok(problem),
        LogNoise::Own => weighted_by_log(settings, problem),
    };
    let mut samples = Samples::new(checks, unknowns, with, (0..dof).into_par_iter().map(start).collect())?;
    let first = unknowns.count();
    let fastest_hz = checks.iter().map(DelayCheck::rate_hz).fold(0.0, f64::max);
    let estimated = |samples: &Samples<'_>| {
        weighted_least_squares(&weighted(samples.problem(|rows| &rows.factor)?)?, &settings.weighted())
    };
    let repeated = |samples: &mut Samples<'_>| -> Result<(), EstimationError> {
        for _ in 0..MAX_STEPS {
            let step = weighted_values(&weighted(samples.problem(|rows| &rows.merged)?)?, &settings.weighted())?;
            let mut has_converged = true;
            for joint in 0..dof {
                let (rest, std) = (step.values[first + joint], step.white_std[first + joint]);
                has_converged &= rest.abs() <= (CONVERGENCE.0 * std).max(CONVERGENCE.1 / fastest_hz);
                samples.lag_s[joint] = (samples.lag_s[joint] + rest).clamp(-longest_s, longest_s);
            }
            samples.follow()?;
            if has_converged {
                break;
            }
        }
        Ok(())
    };
    repeated(&mut samples)?;
    let lags_by = |samples: &Samples<'_>, last: &Estimate| -> Vec<Option<TorqueLag>> {
        (0..dof).map(|joint| samples.joint_lag(last, first + joint, longest_s, fastest_hz)).collect()
    };
    let row_counts = |samples: &Samples<'_>| -> Vec<usize> {
        let of_joint = |joint: usize| samples.rows.iter().map(|log| log[joint].factor.rows()).sum();
        (0..dof).map(of_joint).collect()
    };
    let mut last = estimated(&samples)?;
    let (mut joints, mut rows) = (lags_by(&samples, &last), row_counts(&samples));
    let mut reversals = Vec::new();
    samples.reversals = Some(ReversalPrior { std_s: f64::INFINITY, joint_sigma: vec![1.0; dof] });
    let free = estimated(&samples)?;
    let spread_s = reversal::spread_s(&free, first + dof, settings.thresholds.lag.max_reversal_std);
    if let Some(std_s) = spread_s {
        samples.reversals = Some(ReversalPrior { std_s, joint_sigma: free.joint_sigma.clone() });
        repeated(&mut samples)?;
        let mut separated = estimated(&samples)?;
        separated.joint_sigma.iter_mut().zip(&free.joint_sigma).for_each(|(sigma, unit)| *sigma *= unit);
        let lags = lags_by(&samples, &separated);
        // If the samples do not distinguish the two at some joint, its lag diverges.
        let is_held = |joint: usize| separated.rank.fixed.iter().any(|fixed| fixed.column == first + joint);
        if lags.iter().enumerate().all(|(joint, lag)| lag.is_some() || is_held(joint)) {
            reversals = reversal::of_joints(&separated, first + dof);
            (last, joints, rows) = (separated, lags, row_counts(&samples));
        }
    }
    let usual_lag_s = own.seconds(settings.thresholds.lag.prior_std_s);
    let (parameters, thresholds) = (unknowns.values.len(), settings.thresholds.lag);
    Ok(LagFit { last, parameters, first, joints, reversals, rows, usual_lag_s, thresholds })
}

impl<'a> Samples<'a> {
    fn new(
        checks: &'a [DelayCheck<'a>],
        unknowns: Unknowns<'a>,
        with: (&'a Logs<'a>, &'a EstimationSettings),
        lag_s: Vec<f64>,
    ) -> Result<Self, EstimationError> {
        let of_log = |check: &DelayCheck<'_>| -> Result<Vec<DelayRows>, EstimationError> {
            let of_joint = |joint: usize| check.rows(with.0, with.1, joint, lag_s[joint] * check.rate_hz());
            (0..lag_s.len()).into_par_iter().map(of_joint).collect()
        };
        let rows = checks.par_iter().map(of_log).collect::<Result<_, _>>()?;
        Ok(Self { checks, with, unknowns, rows, lag_s, reversals: None })
    }

    /// Computes the rows again if the lag is no longer between the samples (nodes) that they interpolate.
    fn follow(&mut self) -> Result<(), EstimationError> {
        for (check, rows) in self.checks.iter().zip(&mut self.rows) {
            for (joint, rows) in rows.iter_mut().enumerate() {
                let shift = self.lag_s[joint] * check.rate_hz();
                if !rows.reaches(shift) {
                    *rows = check.rows(self.with.0, self.with.1, joint, shift)?;
                }
            }
        }
        Ok(())
    }

    /// The lag in `column` of the last step; `None` if it did not converge or exceeds the maximum.
    fn joint_lag(&self, last: &Estimate, column: usize, longest_s: f64, fastest_hz: f64) -> Option<TorqueLag> {
        let joint = column - self.unknowns.count();
        let (rest, std) = (last.values[column], last.std[column]);
        let lag_s = self.lag_s[joint] + rest;
        let excited = last.rank.fixed.iter().all(|fixed| fixed.column != column);
        let converged = rest.abs() <= (0.5 * std).max(1.0e3 * CONVERGENCE.1 / fastest_hz);
        let half_width = last.half_width_95[column];
        if !excited || !converged || lag_s.abs() >= 0.999 * longest_s || half_width >= longest_s {
            return None;
        }
        let of_log = |(check, rows): (&DelayCheck<'_>, &Vec<DelayRows>)| {
            let per_second = rows[joint].slope_rms * check.rate_hz();
            [per_second * per_second, 1.0].map(|value| value * rows[joint].factor.rows() as f64)
        };
        let [squares, rows] =
            self.checks.iter().zip(&self.rows).map(of_log).fold([0.0; 2], |[a, b], [x, y]| [a + x, b + y]);
        let moved = lag_s.abs() * (squares / rows.max(1.0)).sqrt();
        Some(TorqueLag {
            lag_s,
            std_s: std,
            half_width_95_s: half_width,
            matters: lag_s.abs() > half_width && moved > last.joint_sigma[joint],
            taken_off_s: 0.0,
        })
    }

    /// Least-squares problem with the columns for parameters and unknown gains, then for the uncompensated lag of every
    /// joint, s, then for its time of reversal, s.
    fn problem(
        &self,
        factor: impl Fn(&DelayRows) -> &SegmentedFactor + Sync,
    ) -> Result<LinearProblem, EstimationError> {
        let model = self.checks[0].model();
        let layout = model.layout();
        let (first, dof) = (self.unknowns.count(), self.lag_s.len());
        let reversals = if self.reversals.is_some() { dof } else { 0 };
        let columns = first + dof + reversals;
        let names = (0..columns).map(|column| format!("column {column}")).collect();
        let joints = (0..dof).map(|joint| format!("joint {joint}")).collect();
        // Parameters that the rows do not determine keep their fitted values, because the slope was computed with them.
        let mut fallback = self.unknowns.values.to_vec();
        fallback.resize(columns, 0.0);
        let mut problem = LinearProblem::new(names, joints).with_fallback(fallback)?;
        if let Some(prior) = self.reversals.as_ref().filter(|prior| prior.std_s.is_finite()) {
            let mut information = DMatrix::zeros(dof, columns);
            information.view_mut((0, first + dof), (dof, dof)).fill_diagonal(prior.std_s.recip());
            problem = problem.with_prior(vec![0.0; columns], information)?;
        }
        for (number, (check, rows)) in self.checks.iter().zip(&self.rows).enumerate() {
            let mapped = |(joint, rows): (usize, &DelayRows)| {
                let own = layout.joint_columns(joint);
                let mut seen = self.unknowns.seen(number, joint, own, check.theta());
                let lag = seen.columns.len();
                seen.columns.push(first + joint);
                if reversals > 0 {
                    seen.columns.push(first + dof + joint);
                }
                let torque = seen.columns.len();
                let mut map = DMatrix::zeros(own.len() + SLOPES + NODES, torque + 1);
                map.view_mut((0, 0), (own.len(), lag)).copy_from(&seen.map);
                map.view_mut((0, torque), (own.len(), 1)).copy_from(&-seen.known);
                for slope in 0..torque - lag {
                    map[(own.len() + slope, lag + slope)] = check.rate_hz();
                }
                let shift = self.lag_s[joint] * check.rate_hz();
                for (node, weight) in lagrange(shift - rows.centre as f64).into_iter().enumerate() {
                    map[(own.len() + SLOPES + node, torque)] = weight;
                }
                Ok((seen.columns, factor(rows).mapped(&map)?))
            };
            let mapped: Vec<_> = rows.par_iter().enumerate().map(mapped).collect::<Result<_, EstimationError>>()?;
            for (joint, (columns, mapped)) in mapped.into_iter().enumerate() {
                problem.add(&format!("log {number}"), joint, columns, mapped)?;
            }
        }
        let Some(prior) = &self.reversals else { return Ok(problem) };
        problem.with_log_weights(|_, joint| prior.joint_sigma[joint].recip())
    }
}
