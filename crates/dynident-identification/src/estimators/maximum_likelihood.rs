//! Maximum likelihood for a repeated motion: mean periods of logs, their noise, and the estimate.

use super::filtered_period::PeriodFilter;
use super::row_pass::PassError;
use super::simulated::torque_sigma;
use super::{EstimatorError, PeriodSettings, TrainingRows};
use crate::thresholds::MotionThresholds;
use dynident_dynamics::{BatchWorkspace, Panels, TermHistory, regressor_panels_following};
use dynident_estimation::{
    CovarianceMethod, Estimate, EstimationError, InstantRows, InstantVisitor, LinearProblem, MaximumLikelihoodEstimate,
    MaximumLikelihoodSettings, maximum_likelihood, student_half_width,
};
use dynident_model::terms::JointMotion;
use dynident_recording::{AveragedPeriods, MotionBlock, averaged_periods};
use dynident_rows::{LogError, RegressorModel, motion_band_hz};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Minimum torque noise relative to the root mean square of the torque.
const MIN_RELATIVE_SIGMA: f64 = 1e-4;
/// Minimum steps of central differences of the regressor by position, velocity and acceleration, for an arm of usual
/// size; the regressor is linear in the last. A larger noise of the mean period gives a larger step, so that the slope
/// of a friction step is averaged over the noise.
const MIN_STEPS: [f64; 3] = [1e-5, 1e-5, 1.0];

/// Results for the periods of a repeated motion.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PeriodicFit {
    /// Period, s.
    pub period_s: f64,
    /// Number of averaged periods of each log.
    pub periods: Vec<usize>,
    /// Instants of all mean periods in the fit.
    pub instants: usize,
    /// Standard deviation of a single sample's smoothed position, velocity and acceleration of each joint, rad, rad/s,
    /// rad/s² (m).
    pub motion_std: Vec<[f64; 3]>,
    /// Standard deviation of a single sample's filtered torque of each joint, Nm (N).
    pub torque_std: Vec<f64>,
    /// Cost of the likelihood.
    pub cost: f64,
    /// Expected cost for correct model and noise. A larger cost shows model errors, and the error bars grow by the root
    /// of the ratio.
    pub degrees_of_freedom: usize,
}

/// Mean period of one log, joints in the order of the model: positions, velocities, accelerations and torques.
struct MeanPeriod {
    averaged: AveragedPeriods,
    samples: usize,
    /// Covariance of a single sample between all channels after the parallel filter.
    covariance: DMatrix<f64>,
    /// Instants of the fit, with filtered regressor and torque, at the decimated rate.
    rows: Vec<(usize, DMatrix<f64>, DVector<f64>)>,
}

/// Computes the estimate and the results for the periods.
///
/// Torque and regressor of the mean period pass the same parallel filter, and the instants are decimated accordingly.
pub(super) fn periodic(
    rows: &TrainingRows<'_>,
    periods: &PeriodSettings,
) -> Result<(Estimate, PeriodicFit), EstimatorError> {
    let TrainingRows { logs, model, problem, .. } = *rows;
    let method = "maximum-likelihood";
    let wrong = |message: String| EstimatorError::Requirement { method, message };
    if let Some(term) = model.terms().iter().find(|term| term.has_memory() || term.needs_load()) {
        return Err(wrong(format!(
            "{} depends on more than the motion of one instant: leave this law out, or use another method",
            term.symbol()
        )));
    }
    rows.begin("periods");
    let Means { period_s, means } = mean_periods(rows, periods, &wrong)?;
    logs.end();
    let Some(first) = means.first() else { return Err(wrong("there is no training log".to_owned())) };
    let (dof, most) = (model.model().dof(), first.averaged.periods);
    let sample_covariance = pooled(&means, |mean| mean.covariance.clone());
    // Covariance of the motion before the parallel filter.
    let single = pooled(&means, |mean| matrix(&mean.averaged.sample_covariance));
    // Covariance of the mean over the number of periods of the first log; rows of the other logs are scaled to it.
    let mean_covariance = &sample_covariance / most as f64;
    let settings = MaximumLikelihoodSettings {
        motion_covariance: mean_covariance.view((0, 0), (3 * dof, 3 * dof)).into_owned(),
        torque_covariance: torque_covariance(&means, &mean_covariance, dof),
        rank: rows.settings.rank,
        tolerance: 1e-6,
        max_iterations: 50,
    };
    let std = |place: usize| single[(place, place)].max(0.0).sqrt();
    let steps = |variable: usize| min_step(model, variable).max(std(variable) / (most as f64).sqrt());
    let mut instants = Instants::new(model, (0..3 * dof).map(steps).collect());
    let found = maximum_likelihood::<PassError>(problem.columns(), &settings, |visit| {
        for mean in &means {
            let weight = (mean.averaged.periods as f64 / most as f64).sqrt();
            instants.of(mean, weight, visit)?;
        }
        Ok(())
    })?;
    let torque_std = |joint: usize| sample_covariance[(3 * dof + joint, 3 * dof + joint)].max(0.0).sqrt();
    let fit = PeriodicFit {
        period_s: period_s.unwrap_or_default(),
        periods: means.iter().map(|mean| mean.averaged.periods).collect(),
        instants: means.iter().map(|mean| mean.rows.len()).sum(),
        motion_std: (0..dof).map(|joint| core::array::from_fn(|order| std(order * dof + joint))).collect(),
        torque_std: (0..dof).map(torque_std).collect(),
        cost: found.cost,
        degrees_of_freedom: found.degrees_of_freedom,
    };
    let estimate = estimate_of(found, problem)?;
    Ok((estimate, fit))
}

struct Means {
    period_s: Option<f64>,
    means: Vec<MeanPeriod>,
}

/// Averages the periods of all logs. The period is stated, or otherwise that of the first commanded motion.
fn mean_periods(
    rows: &TrainingRows<'_>,
    periods: &PeriodSettings,
    wrong: &dyn Fn(String) -> EstimatorError,
) -> Result<Means, EstimatorError> {
    let mut period_s = periods.period_s;
    let mut means = Vec::new();
    for &index in rows.training {
        let recording = &rows.logs.recordings[index];
        if period_s.is_none() {
            period_s = recording.commanded.as_ref().and_then(|reference| reference.period_s());
        }
        let name = &recording.name;
        let Some(period_s) = period_s else {
            return Err(wrong(format!(
                "log `{name}`: the period of the motion is unknown: set period_s in [estimator.periods], or give the commanded motion of one period as the log's reference"
            )));
        };
        means.push(mean_period(rows, index, period_s, periods.skip_s, &|message| {
            wrong(format!("log `{name}`: {message}"))
        })?);
    }
    Ok(Means { period_s, means })
}

/// Covariance of the torques of a mean period, with a lower limit relative to the torques.
fn torque_covariance(means: &[MeanPeriod], mean_covariance: &DMatrix<f64>, dof: usize) -> DMatrix<f64> {
    let mut covariance = mean_covariance.view((3 * dof, 3 * dof), (dof, dof)).into_owned();
    for joint in 0..dof {
        let (mut square, mut count) = (0.0, 0);
        for mean in means {
            square += mean.averaged.mean[3 * dof + joint].iter().map(|tau| tau * tau).sum::<f64>();
            count += mean.samples;
        }
        let least = MIN_RELATIVE_SIGMA * MIN_RELATIVE_SIGMA * square / count.max(1) as f64;
        covariance[(joint, joint)] += least.max(f64::MIN_POSITIVE);
    }
    covariance
}

/// Minimum step of the differences by a variable of the motion: positions of all joints, velocities, accelerations.
fn min_step(model: &RegressorModel, variable: usize) -> f64 {
    let (model, dof) = (model.model(), model.model().dof());
    let own = model.characteristic_scale();
    let is_rotary = model.joints()[variable % dof].is_rotary();
    let [position, velocity, acceleration] = MIN_STEPS;
    match variable / dof {
        0 => own.position(is_rotary, position),
        1 => own.velocity(is_rotary, velocity),
        _ => own.acceleration(is_rotary, acceleration),
    }
}

fn matrix(rows: &[Vec<f64>]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), rows.len(), |a, b| rows[a][b])
}

/// Covariance of a single sample between all channels, over all logs.
fn pooled(means: &[MeanPeriod], covariance: impl Fn(&MeanPeriod) -> DMatrix<f64>) -> DMatrix<f64> {
    let channels = means.first().map_or(0, |mean| mean.averaged.mean.len());
    let (mut sum, mut degrees_of_freedom) = (DMatrix::zeros(channels, channels), 0.0);
    for mean in means {
        let own = (mean.samples * (mean.averaged.periods - 1)) as f64;
        sum += covariance(mean) * own;
        degrees_of_freedom += own;
    }
    sum / degrees_of_freedom.max(1.0)
}

fn mean_period(
    rows: &TrainingRows<'_>,
    index: usize,
    period_s: f64,
    skip_s: f64,
    wrong: &dyn Fn(String) -> EstimatorError,
) -> Result<MeanPeriod, EstimatorError> {
    let TrainingRows { logs, model, .. } = *rows;
    let (motion, recording) = (&logs.motion, &logs.recordings[index]);
    let places = recording.places(model.model())?;
    let failed = |source| LogError::recording(&recording.name, source);
    let Some(mut stream) = recording.open(model.model(), motion)? else {
        return Err(wrong("a prepared motion has no periods; give raw samples".to_owned()));
    };
    let (rate_hz, dof) = (stream.rate_hz(), model.model().dof());
    let no_filter = PeriodFilter { taps: vec![1.0], stride: 1 };
    let filter = logs.filter.decimation(rate_hz, motion_band_hz(motion)).map_or(Ok(no_filter), |settings| {
        settings.taps(rate_hz).map(|taps| PeriodFilter { taps, stride: settings.factor })
    });
    let filter = filter.map_err(|source| LogError::Filter { log: recording.name.clone(), source })?;
    let mut channels = vec![Vec::new(); 4 * dof];
    let (mut block, mut segment, mut begins_s) = (MotionBlock::default(), None, 0.0);
    while stream.next_block(&mut block).map_err(failed)? {
        if *segment.get_or_insert(block.segment) != block.segment {
            return Err(wrong(
                "the log has a gap, but periods must be complete: select the longest piece with time_range_s"
                    .to_owned(),
            ));
        }
        if channels[0].is_empty() {
            begins_s = block.first_time_s;
        }
        for (order, values) in [&block.q, &block.dq, &block.ddq, block.fitted_tau()].into_iter().enumerate() {
            for (joint, &place) in places.iter().enumerate() {
                channels[order * dof + joint].extend_from_slice(block.joint(values, place));
            }
        }
        logs.execution.progress.advance(block.rows as u64);
    }
    let samples = (period_s * rate_hz).round() as usize;
    if samples < 2 {
        return Err(wrong(format!("a period of {period_s} s has fewer than two samples at {rate_hz:.1} Hz")));
    }
    let skipped = (skip_s - begins_s).max(0.0) * rate_hz;
    let channels = at_phases(&channels, skipped, period_s * rate_hz / samples as f64);
    let views: Vec<&[f64]> = channels.iter().map(Vec::as_slice).collect();
    let length = views.first().map_or(0, |channel| channel.len());
    if length / 2 < samples {
        return Err(wrong(format!(
            "{:.2} s remain, fewer than two periods of {period_s} s: record at least two periods, better ten, or correct period_s",
            length as f64 / rate_hz
        )));
    }
    let averaged = averaged_periods(&views, samples).map_err(|error| wrong(error.to_string()))?;
    check_repeats(model, &averaged, period_s, &rows.settings.thresholds.motion).map_err(wrong)?;
    let covariance = filter.covariance(&views, &averaged);
    let rows = filter.rows(model, &averaged);
    Ok(MeanPeriod { averaged, samples, covariance, rows })
}

/// Checks that the positions of all periods agree; returns a message otherwise.
fn check_repeats(
    model: &RegressorModel,
    averaged: &AveragedPeriods,
    period_s: f64,
    thresholds: &MotionThresholds,
) -> Result<(), String> {
    for (joint, described) in model.model().joints().iter().enumerate() {
        let mean = &averaged.mean[joint];
        let middle = mean.iter().sum::<f64>() / mean.len() as f64;
        let size = (mean.iter().map(|q| (q - middle).powi(2)).sum::<f64>() / mean.len() as f64).sqrt();
        let difference = averaged.sample_covariance[joint][joint].max(0.0).sqrt();
        if difference > thresholds.max_period_difference * size.max(thresholds.min_motion) {
            return Err(format!(
                "the motion does not repeat every {period_s} s: positions of {} differ by {difference:.2e} rad from period to period, and move by {size:.2e} rad (root mean squares); \
                 fix period_s, or skip the start with skip_s",
                described.name
            ));
        }
    }
    Ok(())
}

/// Resamples channels from `from` on with a step of `step` samples, so that a period is a whole number of samples;
/// cubic interpolation between samples.
fn at_phases(channels: &[Vec<f64>], from: f64, step: f64) -> Vec<Vec<f64>> {
    let length = channels.first().map_or(0, Vec::len);
    let on_samples = (step - 1.0).abs() * (length as f64) < 1e-3;
    let first = from.ceil();
    if on_samples {
        return channels.iter().map(|channel| channel[(first as usize).min(length)..].to_vec()).collect();
    }
    let last = length as f64 - 3.0;
    let count = if last > first { ((last - first) / step) as usize } else { 0 };
    let value = |channel: &[f64], place: f64| {
        let at = (place.floor() as usize).clamp(1, channel.len() - 3);
        let u = place - at as f64;
        let [a, b, c, d] = [channel[at - 1], channel[at], channel[at + 1], channel[at + 2]];
        // Lagrange's cubic through four neighbours.
        -a * u * (u - 1.0) * (u - 2.0) / 6.0 + b * (u + 1.0) * (u - 1.0) * (u - 2.0) / 2.0
            - c * (u + 1.0) * u * (u - 2.0) / 2.0
            + d * (u + 1.0) * u * (u - 1.0) / 6.0
    };
    channels.iter().map(|channel| (0..count).map(|k| value(channel, first + k as f64 * step)).collect()).collect()
}

struct Instants<'a> {
    model: &'a RegressorModel,
    workspace: BatchWorkspace,
    panels: Panels,
    steps: Vec<f64>,
}

impl<'a> Instants<'a> {
    fn new(model: &'a RegressorModel, steps: Vec<f64>) -> Self {
        Self { model, workspace: BatchWorkspace::new(model.model()), panels: Panels::default(), steps }
    }

    /// Passes the instants of a mean period to `visit`. `weight` is the square root of the relative weight of a mean
    /// over more periods.
    fn of(&mut self, mean: &MeanPeriod, weight: f64, visit: &mut InstantVisitor<'_>) -> Result<(), PassError> {
        let (model, layout) = (self.model.model(), self.model.layout());
        let (dof, columns) = (model.dof(), layout.columns().len());
        let variables = 3 * dof;
        let samples = 1 + 2 * variables;
        let mut states = [vec![0.0; dof * samples], vec![0.0; dof * samples], vec![0.0; dof * samples]];
        for (instant, regressor, torque) in &mean.rows {
            for (order, state) in states.iter_mut().enumerate() {
                for joint in 0..dof {
                    let own = &mut state[joint * samples..(joint + 1) * samples];
                    own.fill(mean.averaged.mean[order * dof + joint][*instant]);
                    let variable = order * dof + joint;
                    own[1 + 2 * variable] += self.steps[variable];
                    own[2 + 2 * variable] -= self.steps[variable];
                }
            }
            let [q, dq, ddq] = &states;
            let motion = JointMotion { samples, q, dq, ddq };
            let mut history = TermHistory::new(None);
            regressor_panels_following(model, &mut self.workspace, layout, &motion, &mut history, &mut self.panels);
            let mut by_motion = vec![DMatrix::zeros(dof, columns); variables];
            for joint in 0..dof {
                let panel = self.panels.joint(joint);
                for (place, &column) in layout.joint_columns(joint).iter().enumerate() {
                    let values = &panel[place * samples..(place + 1) * samples];
                    for (variable, by) in by_motion.iter_mut().enumerate() {
                        by[(joint, column)] =
                            (values[1 + 2 * variable] - values[2 + 2 * variable]) / (2.0 * self.steps[variable]);
                    }
                }
            }
            let (regressor, torque) = (regressor * weight, torque * weight);
            visit(&InstantRows { regressor: &regressor, torque: &torque, regressor_by_motion: &by_motion })?;
        }
        Ok(())
    }
}

/// Converts to the result of the other estimators. Error bars grow if the residual exceeds the noise.
fn estimate_of(found: MaximumLikelihoodEstimate, problem: &LinearProblem) -> Result<Estimate, EstimationError> {
    let joints = problem.joints().len();
    let degrees_of_freedom = found.degrees_of_freedom as f64;
    let widened = (found.cost / degrees_of_freedom).max(1.0);
    let std: Vec<f64> = found.std.iter().map(|std| std * widened.sqrt()).collect();
    let half = student_half_width(0.95, degrees_of_freedom);
    let relative = |(std, value): (&f64, &f64)| (*std > 0.0 && *value != 0.0).then(|| 100.0 * std / value.abs());
    Ok(Estimate {
        joint_sigma: torque_sigma(problem, &found.values)?,
        half_width_95: std.iter().map(|std| half * std).collect(),
        relative_std_percent: std.iter().zip(&found.values).map(relative).collect(),
        std_degrees_of_freedom: vec![degrees_of_freedom; std.len()],
        covariance: &found.covariance * widened,
        covariance_white: found.covariance,
        covariance_method: CovarianceMethod::White,
        clusters: 0,
        noise_std: std.clone(),
        std,
        status: found.status,
        iterations: found.iterations,
        score_inflation: vec![widened; joints],
        effective_lag1: vec![0.0; joints],
        segment_correlation: vec![0.0; joints],
        degrees_of_freedom: found.degrees_of_freedom,
        condition_number_raw: found.rank.condition_number_raw,
        condition_number_scaled: found.rank.condition_number_scaled,
        rank: found.rank,
        names: found.names,
        values: found.values,
    })
}
