//! Joint motion at a list of times, and derivatives of a cost with respect to it.

use dynident_model::terms::JointMotion;

/// Position, velocity, acceleration and jerk of all joints, joint-major: joint `j`, sample `s` has index `j * samples +
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
    /// Resizes all arrays to `joints` × `samples` zeros, reusing the memory.
    pub fn reset(&mut self, joints: usize, samples: usize) {
        (self.joints, self.samples) = (joints, samples);
        for values in self.arrays_mut() {
            values.clear();
            values.resize(joints * samples, 0.0);
        }
    }

    /// The four arrays: positions, velocities, accelerations, jerks.
    pub fn arrays(&self) -> [&Vec<f64>; 4] {
        [&self.q, &self.dq, &self.ddq, &self.dddq]
    }

    /// The four arrays in the order of [`arrays`](Self::arrays), with mutable values.
    pub fn arrays_mut(&mut self) -> [&mut Vec<f64>; 4] {
        [&mut self.q, &mut self.dq, &mut self.ddq, &mut self.dddq]
    }

    /// Index range of one joint in each of the four arrays.
    pub fn of(&self, joint: usize) -> core::ops::Range<usize> {
        joint * self.samples..(joint + 1) * self.samples
    }

    /// View of the motion for the dynamics.
    pub fn view(&self) -> JointMotion<'_> {
        JointMotion { samples: self.samples, q: &self.q, dq: &self.dq, ddq: &self.ddq }
    }
}

/// Derivatives of a scalar cost with respect to every value of a [`Motion`], in the same layout.
pub type MotionAdjoint = Motion;
