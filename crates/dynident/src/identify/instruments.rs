//! Instruments for a log: a second account of the same motion, sample by sample, that is free of the noise in the first.

use crate::error::Error;
use crate::machine::Machine;
use crate::study::Study;
use dynident_recording::{DifferentiatorSettings, MotionBlock, MotionSettings, MotionStream};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Where the motion behind the instruments comes from: [`SmoothedMotion`] of the same log, or a simulation of the closed loop with the current model, which a
/// crate above this one can plug in.
pub trait InstrumentSource {
    /// A new pass over log number `log` of the study begins.
    ///
    /// # Errors
    /// If there is no motion for this log.
    fn begin(&mut self, log: usize) -> Result<(), Error>;

    /// Writes `q`, `dq` and `ddq` (joint-major, `joint * rows + row`, the log's order of joints, SI units) for the samples of `measured`, which come in the order of
    /// time: same rows, same piece of the log. Nothing else of `instruments` is read.
    ///
    /// # Errors
    /// If the motion does not cover these samples.
    fn motion(&mut self, measured: &MotionBlock, instruments: &mut MotionBlock) -> Result<(), Error>;
}

/// `[estimator.instruments]`: the motion of the log itself, smoothed far more strongly than for the regressor.
///
/// Noise above this cut-off is not in the instruments; what lies below it is, and is small where the motion is slow against the noise.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct InstrumentSection {
    /// Cut-off of the zero-phase Butterworth filter of fourth order; by default a quarter of what the log suggests for its motion, which is half of the highest frequency
    /// that stands out of the noise.
    pub cutoff_hz: Option<f64>,
    /// First-stage F below which instruments are called weak; 10 by default.
    pub weak_below: Option<f64>,
    /// Probability of rejecting least squares where it is right; 0.01 by default.
    pub test_level: Option<f64>,
}

/// The motion of the log itself through another filter.
pub struct SmoothedMotion<'a> {
    study: &'a Study,
    machine: &'a Machine,
    files: &'a [PathBuf],
    motion: MotionSettings,
    log: usize,
    stream: Option<MotionStream>,
    block: MotionBlock,
    used: usize,
    /// The cut-off in force in each log begun so far.
    pub cutoffs_hz: Vec<f64>,
}

impl<'a> SmoothedMotion<'a> {
    /// The motion of the study's logs, smoothed as `section` says; trimmed as `motion`, the settings of the regressor.
    pub fn new(
        study: &'a Study,
        machine: &'a Machine,
        files: &'a [PathBuf],
        motion: &MotionSettings,
        section: &InstrumentSection,
    ) -> Self {
        let differentiator = DifferentiatorSettings::Butterworth { order: 4, cutoff_hz: section.cutoff_hz };
        let motion = MotionSettings { differentiator, smooth_torque: false, ..motion.clone() };
        let block = MotionBlock::default();
        Self { study, machine, files, motion, log: 0, stream: None, block, used: 0, cutoffs_hz: Vec::new() }
    }

    fn unaligned(&self) -> Error {
        Error::Instruments {
            log: self.study.log_name(self.log),
            message: "the smoothed motion does not cover the same samples as the regressor: a piece of the log is too short for one of the two filters; \
                      leave short pieces out with `rows` or `time_range_s`"
                .to_owned(),
        }
    }
}

impl InstrumentSource for SmoothedMotion<'_> {
    fn begin(&mut self, log: usize) -> Result<(), Error> {
        self.log = log;
        let failed = |source| Error::recording(&self.study.log_name(log), source);
        let format = self.study.format_of(log);
        let open = |motion: &MotionSettings| {
            MotionStream::open(&format, &self.files[log], &self.machine.log_joints, motion).map_err(failed)
        };
        let mut motion = self.motion.clone();
        let DifferentiatorSettings::Butterworth { cutoff_hz, .. } = &mut motion.differentiator else {
            return Err(self.unaligned());
        };
        if cutoff_hz.is_none() {
            *cutoff_hz = Some(0.25 * open(&self.motion)?.cutoff().cutoff_hz);
        }
        self.cutoffs_hz.extend(*cutoff_hz);
        self.stream = Some(open(&motion)?);
        (self.block, self.used) = (MotionBlock::default(), 0);
        Ok(())
    }

    fn motion(&mut self, measured: &MotionBlock, instruments: &mut MotionBlock) -> Result<(), Error> {
        let (rows, joints) = (measured.rows, measured.joints);
        (instruments.rows, instruments.joints) = (rows, joints);
        for values in [&mut instruments.q, &mut instruments.dq, &mut instruments.ddq] {
            values.clear();
            values.resize(rows * joints, 0.0);
        }
        let mut done = 0;
        while done < rows {
            if self.used == self.block.rows {
                let log = self.study.log_name(self.log);
                let Some(stream) = &mut self.stream else { return Err(self.unaligned()) };
                let more = stream.next_block(&mut self.block).map_err(|source| Error::recording(&log, source))?;
                if !more {
                    return Err(self.unaligned());
                }
                self.used = 0;
            }
            let at = self.block.first_time_s + self.used as f64 / self.block.rate_hz;
            let wanted = measured.first_time_s + done as f64 / measured.rate_hz;
            if self.block.segment != measured.segment || (at - wanted).abs() * measured.rate_hz > 0.5 {
                return Err(self.unaligned());
            }
            let count = (rows - done).min(self.block.rows - self.used);
            let pairs = [
                (&self.block.q, &mut instruments.q),
                (&self.block.dq, &mut instruments.dq),
                (&self.block.ddq, &mut instruments.ddq),
            ];
            for (source, to) in pairs {
                for joint in 0..joints {
                    let source = &self.block.joint(source, joint)[self.used..self.used + count];
                    to[joint * rows + done..joint * rows + done + count].copy_from_slice(source);
                }
            }
            self.used += count;
            done += count;
        }
        Ok(())
    }
}
