//! Instruments for a log: a second measurement or simulation of the same motion, whose noise is independent of the
//! first.

use super::EstimatorError;
use dynident_model::Model;
use dynident_recording::{DifferentiatorSettings, MotionBlock, MotionSettings, MotionStream};
use dynident_rows::{LogError, Logs};

/// Source of the motion for instruments: [`SmoothedMotion`] of the same log, or a simulation of the closed loop with
/// the current model, which another crate provides.
pub trait InstrumentSource: Send {
    /// Begins a new pass over the recording with the index `log`.
    ///
    /// # Errors
    /// There is no motion for this log.
    fn begin(&mut self, log: usize) -> Result<(), EstimatorError>;

    /// Writes `q`, `dq` and `ddq` (joint-major, `joint * rows + row`, joints in the order of the log, SI units) for the
    /// samples of `measured`, which arrive in order of time. Number of rows and segment are already set as in
    /// `measured`. `unsettled` can exclude samples at the ends that a filter extrapolated. Other fields of
    /// `instruments` are ignored.
    ///
    /// # Errors
    /// The motion does not cover these samples.
    fn motion(&mut self, measured: &MotionBlock, instruments: &mut MotionBlock) -> Result<(), EstimatorError>;
}

/// The motion of the log itself after another filter.
#[derive(Debug)]
pub struct SmoothedMotion<'a> {
    logs: &'a Logs<'a>,
    model: &'a Model,
    motion: MotionSettings,
    log: usize,
    stream: Option<MotionStream>,
    block: MotionBlock,
    used: usize,
}

impl<'a> SmoothedMotion<'a> {
    /// The motion of the logs below `cutoff_hz`. Its ends are cut as in the regressor.
    pub fn new(logs: &'a Logs<'a>, model: &'a Model, cutoff_hz: f64) -> Self {
        let differentiator = DifferentiatorSettings::Butterworth { order: 4, cutoff_hz: Some(cutoff_hz) };
        let motion = MotionSettings { differentiator, smooth_torque: false, ..logs.motion.clone() };
        let block = MotionBlock::default();
        Self { logs, model, motion, log: 0, stream: None, block, used: 0 }
    }

    fn log_name(&self) -> String {
        self.logs.recordings[self.log].name.clone()
    }

    fn unaligned(&self) -> EstimatorError {
        EstimatorError::Instruments {
            log: self.log_name(),
            message: "the smoothed motion does not cover the same samples as the regressor: a piece of the log is too short for one of the two filters; \
                      exclude short pieces with `rows` or `time_range_s`"
                .to_owned(),
        }
    }
}

impl InstrumentSource for SmoothedMotion<'_> {
    fn begin(&mut self, log: usize) -> Result<(), EstimatorError> {
        self.log = log;
        let (recording, model) = (&self.logs.recordings[log], self.model);
        let open = |motion: &MotionSettings| {
            recording.open(model, motion)?.ok_or_else(|| EstimatorError::Instruments {
                log: recording.name.clone(),
                message: "a prepared motion cannot be smoothed again; give raw samples".to_owned(),
            })
        };
        self.stream = Some(open(&self.motion)?);
        (self.block, self.used) = (MotionBlock::default(), 0);
        Ok(())
    }

    fn motion(&mut self, measured: &MotionBlock, instruments: &mut MotionBlock) -> Result<(), EstimatorError> {
        let (rows, joints) = (measured.rows, measured.joints);
        (instruments.rows, instruments.joints, instruments.unsettled) = (rows, joints, [0; 2]);
        for values in [&mut instruments.q, &mut instruments.dq, &mut instruments.ddq] {
            values.clear();
            values.resize(rows * joints, 0.0);
        }
        let mut done = 0;
        while done < rows {
            if self.used == self.block.rows {
                let log = self.log_name();
                let Some(stream) = &mut self.stream else { return Err(self.unaligned()) };
                let more = stream.next_block(&mut self.block).map_err(|source| LogError::recording(&log, source))?;
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
            let [begin, end] = self.block.unsettled;
            let behind = self.block.rows - (self.used + count);
            instruments.unsettled[0] += begin.saturating_sub(self.used).min(count);
            instruments.unsettled[1] += end.saturating_sub(behind).min(count);
            self.used += count;
            done += count;
        }
        Ok(())
    }
}
