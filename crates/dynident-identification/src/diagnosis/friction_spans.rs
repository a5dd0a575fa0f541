//! Projection that removes friction, drive inertia and offset from the torque of each joint.

use super::motion_rows::MotionRows;
use super::span::Span;
use crate::friction::step_of_joint;
use dynident_dynamics::ParametricModel;
use nalgebra::{DMatrix, DVector};

/// For each joint, the space spanned by the columns `1, q̇, s(q̇), q̈` over the rows, with the joint's smoothed sign
/// function `s`.
pub(super) struct FrictionSpans(Vec<Span>);

impl FrictionSpans {
    /// Computes the spaces; `None` without rows.
    pub(super) fn new(robot: &ParametricModel, rows: &MotionRows) -> Option<Self> {
        let of_joint = |joint: usize| {
            let (dq, ddq) = (&rows.dq[joint], &rows.ddq[joint]);
            let step = step_of_joint(robot, joint);
            Span::new(DMatrix::from_fn(rows.len(), 4, |row, k| match k {
                0 => 1.0,
                1 => dq[row],
                2 => step.step(dq[row]),
                _ => ddq[row],
            }))
        };
        (0..rows.dq.len()).map(of_joint).collect::<Option<_>>().map(Self)
    }

    /// Torque of a joint minus its projection on this space, Nm (N).
    pub(super) fn remove(&self, joint: usize, torque: &[f64]) -> DVector<f64> {
        self.0[joint].outside(&DVector::from_column_slice(torque))
    }

    pub(super) fn remove_all(&self, torques: &[Vec<f64>]) -> Vec<DVector<f64>> {
        torques.iter().enumerate().map(|(joint, torque)| self.remove(joint, torque)).collect()
    }
}
