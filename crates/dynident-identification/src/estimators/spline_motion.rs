//! Simultaneous estimation of motion and parameters from one likelihood, for any log. It uses raw positions and torques
//! with noise in both; the motion is a smoothing spline.

use super::simulated::torque_sigma;
use super::spline_torque::SplineTorque;
use super::{EstimatorError, Findings, TrainingRows};
use dynident_estimation::{
    Estimate, SplineLogFit, SplineMotionProblem, SplineMotionSettings, SplineRecord, spline_motion_least_squares,
    weighted_least_squares,
};
use dynident_recording::{DifferentiatorSettings, MotionBlock, MotionSettings};
use dynident_rows::LogError;
use serde::{Deserialize, Serialize};

/// Minimum length of a piece between two gaps, samples.
const MIN_PIECE_SAMPLES: usize = 64;

/// Results of the simultaneous fit of motion and parameters.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SplineFit {
    /// Spline motion and noise of every training log.
    pub logs: Vec<SplineLogFit>,
    /// Cost at the start: weighted sum of squared residuals with the parameters of weighted least squares, the motion
    /// from the positions alone, and the estimated noise.
    pub cost_at_start: f64,
    /// Cost at the end: weighted sum of squared residuals.
    pub cost: f64,
    /// Ratio of the filtered residuals of this fit to those of weighted least squares, root mean square over the
    /// joints. If it is slightly above one, position noise biases least squares. If it is far above one, this fit has
    /// treated model error as noise.
    pub residual_over_start: f64,
}

pub(super) fn spline_motion(
    rows: &TrainingRows<'_>,
    settings: &SplineMotionSettings,
) -> Result<(Estimate, Findings), EstimatorError> {
    let TrainingRows { logs, model, problem, .. } = *rows;
    let wrong = |message: String| EstimatorError::Requirement { method: rows.settings.estimator.name(), message };
    let dof = model.dof();
    if problem.columns().len() != model.layout().columns().len() || problem.joints().len() != dof {
        return Err(wrong(
            "payloads, parameters of single logs and joints without rows are not possible with this method: use another method, or leave these logs out"
                .to_owned(),
        ));
    }
    rows.begin("motion and torque");
    let (mut records, mut temperatures_c) = (Vec::new(), Vec::new());
    for (log, &index) in rows.training.iter().enumerate() {
        for (record, temperature_c) in read(rows, log, index, &wrong)? {
            records.push(record);
            temperatures_c.push(temperature_c);
        }
    }
    logs.end();
    let estimation = rows.settings;
    let start = weighted_least_squares(problem, &estimation.weighted())?;
    let is_held = |column: usize| {
        start.rank.fixed.iter().any(|fixed| fixed.column == column)
            || estimation.held.iter().any(|(held, _)| *held == column)
    };
    let held = (0..problem.columns().len()).map(is_held).collect();
    let begun = SplineMotionProblem {
        names: problem.columns().to_vec(),
        joints: model.joint_names(),
        records,
        parameters: start.values.clone(),
        held,
    };
    let settings = SplineMotionSettings {
        rank: estimation.rank,
        covariance: estimation.covariance,
        own_second_s: rows.model.model().characteristic_scale().seconds(1.0),
        ..settings.clone()
    };
    let pilot = torque_sigma(problem, &start.values)?;
    let mut torque = SplineTorque::new(model, temperatures_c);
    let mut fitted = |settings: &SplineMotionSettings| -> Result<_, EstimatorError> {
        let mut found = spline_motion_least_squares(&begun, settings, &mut torque)?;
        found.estimate.joint_sigma = torque_sigma(problem, &found.estimate.values)?;
        let squares = found.estimate.joint_sigma.iter().zip(&pilot).map(|(own, pilot)| (own / pilot).powi(2));
        let over_start = (squares.sum::<f64>() / dof as f64).sqrt();
        Ok((found, over_start))
    };
    let (mut found, mut over_start) = fitted(&settings)?;
    if (over_start.is_nan() || over_start > estimation.thresholds.motion.max_spline_residual_ratio)
        && settings.most_autoregression > 0
    {
        let (white, of_white) = fitted(&SplineMotionSettings { most_autoregression: 0, ..settings })?;
        if over_start.is_nan() || over_start > of_white {
            (found, over_start) = (white, of_white);
        }
    }
    let mut estimate = found.estimate;
    // The values for the torque channels come first. The estimate is reported by joint.
    for of_channels in [&mut estimate.score_inflation, &mut estimate.effective_lag1, &mut estimate.segment_correlation]
    {
        of_channels.truncate(dof);
    }
    let (logs, cost_at_start, cost) = (found.logs, found.cost_at_start, found.cost);
    let fit = SplineFit { logs, cost_at_start, cost, residual_over_start: over_start };
    Ok((estimate, Findings::Spline(fit)))
}

/// Uninterrupted pieces of recording `index`, with measured temperatures if available.
fn read(
    rows: &TrainingRows<'_>,
    log: usize,
    index: usize,
    wrong: &dyn Fn(String) -> EstimatorError,
) -> Result<Vec<(SplineRecord, Vec<f64>)>, EstimatorError> {
    let TrainingRows { logs, model, .. } = *rows;
    let recording = &logs.recordings[index];
    let name = &recording.name;
    // Central differences leave the positions unchanged.
    let differentiator = DifferentiatorSettings::CentralDifferences { order: 4 };
    let motion = MotionSettings { differentiator, smooth_torque: false, ..logs.motion.clone() };
    let raw = "the positions of a prepared motion are smoothed; give all raw samples";
    let Some(whole) = recording.with_every_row() else {
        return Err(wrong(format!("log `{name}`: {raw}")));
    };
    let Some(mut stream) = whole.open(model.model(), &motion)? else {
        return Err(wrong(format!("log `{name}`: {raw}")));
    };
    let (rate_hz, places) = (stream.rate_hz(), recording.joint_indices(model.model())?);
    let mut pieces: Vec<Vec<Vec<f64>>> = Vec::new();
    let (mut block, mut segment) = (MotionBlock::default(), None);
    while stream.next_block(&mut block).map_err(|source| LogError::recording(name, source))? {
        if segment != Some(block.segment) {
            segment = Some(block.segment);
            pieces.push(vec![Vec::new(); 3 * places.len()]);
        }
        let Some(channels) = pieces.last_mut() else { continue };
        for (part, values) in [&block.q, &block.tau].into_iter().enumerate() {
            for (joint, &place) in places.iter().enumerate() {
                let gain = if part == 0 { None } else { model.torque_gains.get(joint) }.copied().unwrap_or(1.0);
                channels[part * places.len() + joint].extend(block.joint(values, place).iter().map(|x| gain * x));
            }
        }
        if !block.temperature_c.is_empty() {
            for (joint, &place) in places.iter().enumerate() {
                channels[2 * places.len() + joint].extend_from_slice(block.joint(&block.temperature_c, place));
            }
        }
        logs.execution.progress.advance(block.rows as u64);
    }
    pieces.retain(|channels| channels.first().is_some_and(|q| q.len() >= MIN_PIECE_SAMPLES));
    if pieces.is_empty() {
        return Err(wrong(format!(
            "log `{name}` has no piece of {MIN_PIECE_SAMPLES} samples without a gap: give a longer log"
        )));
    }
    let record = |mut channels: Vec<Vec<f64>>| {
        let temperature_c = channels.split_off(2 * places.len()).concat();
        let tau = channels.split_off(places.len());
        (SplineRecord { log, rate_hz, q: channels.concat(), tau: tau.concat() }, temperature_c)
    };
    Ok(pieces.into_iter().map(record).collect())
}
