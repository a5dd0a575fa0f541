//! Joint motion at a list of times, and what a cost pulls on it.

use dynident_model::terms::JointMotion;

/// Position, velocity, acceleration and jerk of all joints, joint-major: joint `j`, sample `s` stands at `j * samples +
/// s`. rad (m) and seconds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    /// Number of samples.
    pub samples: usize,
    /// Number of joints.
    pub joints: usize,
    /// Positions.
    pub q: Vec<f64>,
    /// Velocities.
    pub dq: Vec<f64>,
    /// Accelerations.
    pub ddq: Vec<f64>,
    /// Jerks.
    pub dddq: Vec<f64>,
}

impl Motion {
    /// Makes room for `joints` × `samples` values and sets them to zero; memory is kept.
    pub fn reset(&mut self, joints: usize, samples: usize) {
        (self.joints, self.samples) = (joints, samples);
        for values in [&mut self.q, &mut self.dq, &mut self.ddq, &mut self.dddq] {
            values.clear();
            values.resize(joints * samples, 0.0);
        }
    }

    /// The range of one joint in any of the four arrays.
    pub fn of(&self, joint: usize) -> core::ops::Range<usize> {
        joint * self.samples..(joint + 1) * self.samples
    }

    /// The same motion as the dynamics take it.
    pub fn view(&self) -> JointMotion<'_> {
        JointMotion { samples: self.samples, q: &self.q, dq: &self.dq, ddq: &self.ddq }
    }
}

/// Derivatives of a scalar cost by every number of a [`Motion`], in the same layout.
pub type MotionAdjoint = Motion;
