//! Positions and torque of a log at a low rate, for an animation of its motion.

use dynident_rows::{RawSamples, RegressorModel, predicted_torque};

/// Samples per second: an animation with linear interpolation between them looks continuous.
const RATE_HZ: f64 = 25.0;

/// Maximum time, s; more would increase the size of the page without showing other motion.
const MAX_TIME_S: f64 = 60.0;

/// Positions and torque of the first minute of a log, 25 samples per second.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MotionTrace {
    /// Time of each sample from the start of the log, without gaps, s.
    pub times_s: Vec<f64>,
    /// Positions by joint and sample, rad (m).
    pub q: Vec<Vec<f64>>,
    /// Measured torque by joint, averaged around each sample, Nm (N).
    pub measured_nm: Vec<Vec<f64>>,
    /// Predicted torque by joint, averaged around each sample, Nm (N).
    pub predicted_nm: Vec<Vec<f64>>,
}

impl MotionTrace {
    pub(super) fn new(joints: usize) -> Self {
        let lists = || vec![Vec::new(); joints];
        Self { times_s: Vec::new(), q: lists(), measured_nm: lists(), predicted_nm: lists() }
    }

    /// Adds the samples of a block that are free of end effects of the differentiator.
    pub(super) fn add(
        &mut self,
        model: &RegressorModel,
        theta: &[f64],
        samples: &RawSamples<'_>,
        buffer: &mut Vec<f64>,
    ) {
        let rows = samples.panels.samples();
        let bin = ((samples.rate_hz / RATE_HZ).round() as usize).max(1);
        let start = self.times_s.last().map_or(0.0, |last| last + 1.0 / RATE_HZ);
        let bins: Vec<core::ops::Range<usize>> = samples
            .settled
            .clone()
            .step_by(bin)
            .map(|first| first..(first + bin).min(samples.settled.end))
            .take_while(|range| start + (range.start - samples.settled.start) as f64 / samples.rate_hz <= MAX_TIME_S)
            .collect();
        if bins.is_empty() {
            return;
        }
        let first = samples.settled.start;
        self.times_s.extend(bins.iter().map(|range| start + (range.start - first) as f64 / samples.rate_hz));
        for joint in 0..self.q.len() {
            let columns = model.layout().joint_columns(joint);
            let panel = samples.panels.joint(joint);
            predicted_torque(panel, rows, columns, theta, buffer);
            let measured = &panel[columns.len() * rows..];
            let position = &samples.motion[0][joint * rows..][..rows];
            let mean = |of: &[f64], range: &core::ops::Range<usize>| {
                of[range.clone()].iter().sum::<f64>() / range.len() as f64
            };
            for range in &bins {
                self.q[joint].push(position[range.start]);
                self.measured_nm[joint].push(mean(measured, range));
                self.predicted_nm[joint].push(mean(buffer, range));
            }
        }
    }
}
