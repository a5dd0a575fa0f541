//! A recorded run: commands and measured positions.

use crate::error::{RunFault, ServoError};
use dynident_model::InertialParameters;

/// Maximum time between two samples, s. During a gap, the simulation continues with the last command.
const LONGEST_GAP_S: f64 = 10.0;
/// Number of samples before and after a time from which its velocity is computed. Quantisation makes differences of
/// neighbouring samples noisy.
const VELOCITY_SAMPLES: usize = 2;
/// Minimum number of samples of a run.
const LEAST_SAMPLES: usize = 20;

/// A recording of commands and measured positions of all joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Name in messages.
    pub name: String,
    /// Time stamps, s, increasing.
    pub times_s: Vec<f64>,
    /// Commands of each joint at the time stamps, rad (m); each command is held until the next.
    pub commands: Vec<Vec<f64>>,
    /// Measured positions of each joint at the time stamps, rad (m).
    pub positions: Vec<Vec<f64>>,
    /// Known payloads during the run: index of the body, and inertial parameters in the frame of the body.
    pub payloads: Vec<(usize, InertialParameters)>,
    /// Position gain of each joint in this run, relative to the stiffness of its drive, for firmware with another gain;
    /// 0 if the controller was off. Empty if all are 1.
    pub gains: Vec<f64>,
}

impl Run {
    /// # Errors
    /// Columns that do not fit the robot's joints, too few samples, stamps that do not rise, values that are not
    /// numbers.
    pub fn validate(&self, joints: usize) -> Result<(), ServoError> {
        self.fault(joints).map_or(Ok(()), |fault| Err(ServoError::Run { run: self.name.clone(), fault }))
    }

    /// Position gain of a joint, relative to the stiffness of its drive.
    pub(crate) fn gain(&self, joint: usize) -> f64 {
        self.gains.get(joint).copied().unwrap_or(1.0)
    }

    /// Measured position of a joint at a time, interpolated between samples, and the mean velocity over the
    /// neighbouring samples.
    pub(crate) fn measured(&self, joint: usize, time_s: f64) -> (f64, f64) {
        let (times, positions) = (&self.times_s, &self.positions[joint]);
        let last = times.len() - 1;
        let after = times.partition_point(|time| *time <= time_s).clamp(1, last);
        let part = ((time_s - times[after - 1]) / (times[after] - times[after - 1])).clamp(0.0, 1.0);
        let position = positions[after - 1] + part * (positions[after] - positions[after - 1]);
        let (from, to) = (after.saturating_sub(VELOCITY_SAMPLES), (after + VELOCITY_SAMPLES - 1).min(last));
        (position, (positions[to] - positions[from]) / (times[to] - times[from]))
    }

    fn fault(&self, joints: usize) -> Option<RunFault> {
        let samples = self.times_s.len();
        let columns = || self.commands.iter().chain(&self.positions);
        for found in [self.commands.len(), self.positions.len()] {
            if found != joints {
                return Some(RunFault::Joints { found, expected: joints });
            }
        }
        if columns().any(|column| column.len() != samples) {
            return Some(RunFault::Lengths);
        }
        let is_gain = |gain: &f64| *gain >= 0.0 && gain.is_finite();
        if !(self.gains.is_empty() || self.gains.len() == joints && self.gains.iter().all(is_gain)) {
            return Some(RunFault::Gains { joints });
        }
        if samples < LEAST_SAMPLES {
            return Some(RunFault::Samples { found: samples, least: LEAST_SAMPLES });
        }
        if let Some(sample) = columns().find_map(|column| column.iter().position(|value| !value.is_finite())) {
            return Some(RunFault::NotANumber { sample });
        }
        let rises = |pair: &[f64]| pair[1] > pair[0] && pair[1].is_finite();
        let stamps = self.times_s.windows(2).position(|pair| !rises(pair));
        let gap = || self.times_s.windows(2).position(|pair| pair[1] - pair[0] > LONGEST_GAP_S);
        let of_gap = |at: usize| RunFault::Gap { sample: at + 1, gap_s: self.times_s[at + 1] - self.times_s[at] };
        stamps.map(|at| RunFault::Stamps { sample: at + 1 }).or_else(|| gap().map(of_gap))
    }
}
