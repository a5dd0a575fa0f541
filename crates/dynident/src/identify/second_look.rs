//! A second look at the first samples of a log, now that there is a model to predict them with.

use crate::error::Error;
use crate::machine::Machine;
use crate::measured::lag::{LAG_SAMPLES, LagCheck, TorqueLag};
use crate::measured::rows::{JointRows, Pass, RawSamples, RowSink};
use crate::measured::torque_trace::{LogTrace, TraceSink};
use crate::progress::Silent;
use crate::study::Study;
use dynident_recording::MotionSettings;
use std::path::Path;

/// What a second look gathers.
struct SecondLook<'a> {
    lag: LagCheck<'a>,
    trace: TraceSink<'a>,
}

impl RowSink for SecondLook<'_> {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), Error> {
        self.trace.filtered(rows);
        self.lag.filtered(rows);
        Ok(())
    }

    fn raw(&mut self, samples: &RawSamples<'_>) -> Result<(), Error> {
        self.trace.raw(samples);
        self.lag.raw(samples);
        Ok(())
    }
}

/// The torque's lags, and the torque over time.
pub(super) fn second_look(
    study: &Study,
    machine: &Machine,
    motion: &MotionSettings,
    index: usize,
    file: &Path,
    theta: &[f64],
) -> Result<(Vec<Option<TorqueLag>>, LogTrace), Error> {
    let mut look = SecondLook { lag: LagCheck::new(machine, theta), trace: TraceSink::new(machine, theta) };
    let most_samples = Some(LAG_SAMPLES as u64);
    let pass = Pass { study, machine, motion, index, file, reader_thread: false, most_samples, progress: &Silent };
    let passed = pass.run(&mut look)?;
    let lags = look.lag.lags(study, motion);
    Ok((lags, look.trace.finished(study.log_name(index), "identify", passed.filtered_rate_hz)))
}
