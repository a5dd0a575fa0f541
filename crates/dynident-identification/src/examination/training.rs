//! Second pass over the first samples of a training log, with the estimated model.

use super::torque_trace::{LogTrace, TraceConsumer};
use crate::estimators::EstimationSettings;
use crate::lag::{DELAY_SAMPLES, DelayCheck, TorqueLag, lags_after_pass};
use dynident_rows::{JointRows, LogError, LogPass, Logs, RawSamples, RegressorModel, Role, RowConsumer, Silent};

struct SecondPass<'a> {
    delay: DelayCheck<'a>,
    trace: TraceConsumer<'a>,
}

impl RowConsumer for SecondPass<'_> {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
        self.trace.filtered(rows);
        self.delay.filtered(rows)
    }

    fn raw(&mut self, samples: &RawSamples<'_>) -> Result<(), LogError> {
        self.trace.raw(samples);
        self.delay.raw(samples)
    }
}

/// Lags of the torque in recording `index`, and the measured and predicted torque over time, with base parameters
/// `theta`. No lags are returned if rows within a motion are excluded.
///
/// # Errors
/// An unreadable recording.
pub fn examine_training(
    logs: &Logs<'_>,
    settings: &EstimationSettings,
    model: &RegressorModel,
    index: usize,
    theta: &[f64],
) -> Result<(Vec<Option<TorqueLag>>, LogTrace), LogError> {
    let mut second = SecondPass { delay: DelayCheck::new(model, theta), trace: TraceConsumer::new(model, theta) };
    let most_samples = Some(DELAY_SAMPLES as u64);
    let pass = LogPass { most_samples, progress: &Silent, ..logs.pass(model, index) };
    let statistics = pass.run(&mut second)?;
    let delays = lags_after_pass(second.delay, (logs, settings), index)?;
    let name = logs.recordings[index].name.clone();
    Ok((delays, second.trace.finished(name, Role::Identify, statistics.filtered_rate_hz)))
}
