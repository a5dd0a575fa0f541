//! Simultaneous estimation of motion and parameters from one likelihood. It uses raw positions and torques with noise
//! in both; the motion is a Fourier series.

use super::periodic_model::{FourierSeries, PeriodicModel, PeriodicRecord, PeriodicRecords};
use super::simulated::torque_sigma;
use super::{EstimatorError, Findings, PeriodSettings, TrainingRows};
use crate::thresholds::MotionThresholds;
use dynident_estimation::{
    Estimate, LinearProblem, SimultaneousEstimate, SimultaneousModel, SimultaneousProblem, SimultaneousSettings,
    simultaneous_least_squares, weighted_least_squares,
};
use dynident_recording::{DifferentiatorSettings, MotionBlock, MotionSettings};
use dynident_rows::LogError;
use serde::{Deserialize, Serialize};

/// Maximum number of harmonics that are selected automatically; more harmonics take much time.
const MAX_HARMONICS: usize = 60;

/// Fourier motion and noise of one log, from the simultaneous fit.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SeriesFit {
    /// Period of the first harmonic, s.
    pub period_s: f64,
    /// Number of harmonics.
    pub harmonics: usize,
    /// Number of rows of each channel.
    pub rows: usize,
    /// Number of samples that are averaged to a row.
    pub samples_of_row: usize,
    /// Standard deviation of a row's position from the Fourier series, for each joint, rad (m).
    pub position_std: Vec<f64>,
    /// Standard deviation of a row's torque from the model, for each joint, N m (N).
    pub torque_std: Vec<f64>,
    /// Order of the autoregressive model of each joint's torque noise; 0 for white noise.
    pub torque_autoregression: Vec<usize>,
}

struct RawRecord {
    record: PeriodicRecord,
    series: FourierSeries,
}

impl RawRecord {
    fn samples_of_row(&self) -> usize {
        self.series.samples_of_row(self.record.rate_hz)
    }
}

pub(super) fn simultaneous(
    rows: &TrainingRows<'_>,
    periods: &PeriodSettings,
) -> Result<(Estimate, Findings), EstimatorError> {
    let TrainingRows { logs, model, problem, .. } = *rows;
    let wrong = |message: String| EstimatorError::Requirement { method: "simultaneous", message };
    let terms = model.terms().iter();
    if let Some(term) = terms.clone().find(|t| t.has_memory() || t.needs_load() || t.needs_temperature()) {
        return Err(wrong(format!(
            "{} depends on more than the motion of one instant: leave this law out, or use another method",
            term.symbol()
        )));
    }
    rows.begin("motion and torque");
    let recorded: Vec<RawRecord> =
        rows.training.iter().map(|&index| read(rows, index, periods, &wrong)).collect::<Result<_, _>>()?;
    logs.end();
    let models = recorded.iter().map(|log| PeriodicModel::new(model, &log.record, log.series, log.samples_of_row()));
    let mut records = PeriodicRecords(models.collect());
    let motion = fitted_motion(rows, &records, &wrong)?;
    let estimation = rows.settings;
    let start = weighted_least_squares(problem, &estimation.weighted())?;
    let channel = |log: &usize| {
        let name = &logs.recordings[*log].name;
        let of = |what: &str| -> Vec<String> {
            model.joint_names().iter().map(|joint| format!("{what} of {joint} in {name}")).collect()
        };
        [of("position"), of("torque")].concat()
    };
    let channels = rows.training.iter().flat_map(channel).collect();
    let begun = SimultaneousProblem { names: problem.columns().to_vec(), channels, motion, parameters: start.values };
    let settings = SimultaneousSettings {
        rank: estimation.rank,
        covariance: estimation.covariance,
        ..SimultaneousSettings::default()
    };
    let found = simultaneous_least_squares(&begun, &settings, &mut records)?;
    let fits = series_fits(&recorded, &mut records, &found, model.dof())?;
    let estimate = of_joints(found.estimate, problem, recorded.len(), model.dof())?;
    Ok((estimate, Findings::Series(fits)))
}

/// Start values for the motion of all logs, from the positions alone.
fn fitted_motion(
    rows: &TrainingRows<'_>,
    records: &PeriodicRecords<'_>,
    wrong: &dyn Fn(String) -> EstimatorError,
) -> Result<Vec<f64>, EstimatorError> {
    let mut motion = Vec::new();
    for (record, &index) in records.0.iter().zip(rows.training) {
        let name = &rows.logs.recordings[index].name;
        let Some(fitted) = record.fitted_motion() else {
            return Err(wrong(format!(
                "log `{name}` does not determine the harmonics of its motion: reduce [estimator.periods] harmonics, or give a longer log"
            )));
        };
        check_motion(record, &fitted, &rows.settings.thresholds.motion).map_err(|(joint, message)| {
            wrong(format!("log `{name}`: positions of {} {message}", rows.model.joint_names()[joint]))
        })?;
        motion.extend(fitted);
    }
    Ok(motion)
}

fn series_fits(
    recorded: &[RawRecord],
    records: &mut PeriodicRecords<'_>,
    found: &SimultaneousEstimate,
    dof: usize,
) -> Result<Vec<SeriesFit>, EstimatorError> {
    let left = records.residuals(&found.motion, &found.estimate.values)?;
    let std = |channel: usize| {
        let rows = &left[channel];
        (rows.iter().map(|x| x * x).sum::<f64>() / rows.len().max(1) as f64).sqrt()
    };
    let series = |(log, recorded): (usize, &RawRecord)| {
        let [position, torque] = [0, 1].map(|part| (2 * log + part) * dof..(2 * log + part + 1) * dof);
        SeriesFit {
            period_s: recorded.series.period_s,
            harmonics: recorded.series.harmonics,
            rows: records.0[log].rows(),
            samples_of_row: recorded.samples_of_row(),
            position_std: position.map(std).collect(),
            torque_std: torque.clone().map(std).collect(),
            torque_autoregression: found.noise[torque].iter().map(|noise| noise.autoregression.len()).collect(),
        }
    };
    Ok(recorded.iter().enumerate().map(series).collect())
}

/// Converts an estimate whose rows are grouped by channel (positions and torques of each log) to one whose rows are
/// grouped by joint, using the torque channels.
fn of_joints(
    mut estimate: Estimate,
    problem: &LinearProblem,
    logs: usize,
    dof: usize,
) -> Result<Estimate, EstimatorError> {
    estimate.joint_sigma = torque_sigma(problem, &estimate.values)?;
    let of_joints = |channels: &[f64]| -> Vec<f64> {
        let mean = |joint: usize| {
            let of_logs = (0..logs).filter_map(|log| channels.get((2 * log + 1) * dof + joint));
            of_logs.sum::<f64>() / logs.max(1) as f64
        };
        (0..dof).map(mean).collect()
    };
    estimate.score_inflation = of_joints(&estimate.score_inflation);
    estimate.effective_lag1 = of_joints(&estimate.effective_lag1);
    estimate.segment_correlation = of_joints(&estimate.segment_correlation);
    Ok(estimate)
}

/// Reads log `index` and selects the Fourier series of its motion: the stated number of harmonics, or all harmonics
/// above the noise.
fn read(
    rows: &TrainingRows<'_>,
    index: usize,
    periods: &PeriodSettings,
    wrong: &dyn Fn(String) -> EstimatorError,
) -> Result<RawRecord, EstimatorError> {
    let TrainingRows { logs, model, .. } = *rows;
    let recording = &logs.recordings[index];
    let name = &recording.name;
    let commanded = || recording.commanded.as_ref().and_then(|commanded| commanded.period_s());
    let Some(period_s) = periods.period_s.or_else(commanded) else {
        return Err(wrong(format!(
            "log `{name}`: the period of the motion is unknown: set period_s in [estimator.periods], or give the commanded motion of one period as the log's reference"
        )));
    };
    // Central differences leave the positions unchanged.
    let differentiator = DifferentiatorSettings::CentralDifferences { order: 4 };
    let motion = MotionSettings { differentiator, smooth_torque: false, ..logs.motion.clone() };
    let Some(mut stream) = recording.open(model.model(), &motion)? else {
        return Err(wrong(format!("log `{name}`: the positions of a prepared motion are smoothed; give raw samples")));
    };
    let (rate_hz, places) = (stream.rate_hz(), recording.joint_indices(model.model())?);
    let mut channels = vec![Vec::new(); 2 * places.len()];
    let (mut block, mut segment) = (MotionBlock::default(), None);
    while stream.next_block(&mut block).map_err(|source| LogError::recording(name, source))? {
        if *segment.get_or_insert(block.segment) != block.segment {
            return Err(wrong(format!(
                "log `{name}` has a gap, but the noise model needs consecutive samples: select the longest piece with time_range_s"
            )));
        }
        let skipped = ((periods.skip_s - block.first_time_s).max(0.0) * rate_hz).ceil() as usize;
        for (part, values) in [&block.q, &block.tau].into_iter().enumerate() {
            for (joint, &place) in places.iter().enumerate() {
                let gain = if part == 0 { None } else { model.torque_gains.get(joint) }.copied().unwrap_or(1.0);
                let kept = block.joint(values, place).iter().skip(skipped).map(|x| gain * x);
                channels[part * places.len() + joint].extend(kept);
            }
        }
        logs.execution.progress.advance(block.rows as u64);
    }
    let length_s = channels.first().map_or(0, Vec::len) as f64 / rate_hz;
    if length_s < period_s * (1.0 - 1e-9) {
        return Err(wrong(format!(
            "log `{name}`: {length_s:.2} s remain, less than one period of {period_s} s: record at least one period, or correct period_s"
        )));
    }
    // The suggested cut-off is twice the highest frequency above the noise.
    let highest = (0.5 * stream.cutoff().cutoff_hz * period_s).ceil() as usize;
    let harmonics = periods.harmonics.unwrap_or_else(|| highest.clamp(1, MAX_HARMONICS));
    if 4.0 * harmonics as f64 > rate_hz * period_s {
        return Err(wrong(format!(
            "log `{name}`: {harmonics} harmonics of {:.3} Hz are too many for a rate of {rate_hz:.1} Hz: reduce [estimator.periods] harmonics",
            period_s.recip()
        )));
    }
    let tau = channels.split_off(places.len());
    let record = PeriodicRecord { rate_hz, q: channels.concat(), tau: tau.concat() };
    Ok(RawRecord { record, series: FourierSeries { period_s, harmonics } })
}

/// Checks that the positions agree with the fitted Fourier series; otherwise returns the joint and a message.
fn check_motion(
    record: &PeriodicModel<'_>,
    fitted: &[f64],
    thresholds: &MotionThresholds,
) -> Result<(), (usize, String)> {
    let root_mean = |values: &[f64]| (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt();
    let left = record.position_residuals(fitted);
    let unknowns = fitted.len() / left.ncols().max(1);
    for (joint, left) in left.column_iter().enumerate() {
        // Sine and cosine have a mean square of one half.
        let size = root_mean(&fitted[joint * unknowns + 1..(joint + 1) * unknowns]) * (0.5 * unknowns as f64).sqrt();
        let remainder = root_mean(left.as_slice());
        if remainder > thresholds.max_series_residual * size.max(thresholds.min_motion) {
            return Err((
                joint,
                format!(
                    "differ by {remainder:.2e} rad from the Fourier series of this period and move by {size:.2e} rad (root mean squares): fix period_s, give more harmonics, or skip the start with skip_s"
                ),
            ));
        }
    }
    Ok(())
}
