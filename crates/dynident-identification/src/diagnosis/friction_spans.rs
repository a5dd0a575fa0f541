//! What is left of each joint's torque beside what it may be without any body: friction, drive inertia, an offset.

use super::motion_rows::MotionRows;
use super::span::Span;
use crate::friction::step_of_joint;
use dynident_dynamics::ParametricModel;
use nalgebra::{DMatrix, DVector};

/// For each joint what `1, q̇, s(q̇), q̈` span over the rows, with the step `s` of the joint's terms; of a joint at
/// rest that is less.
pub(super) struct BesideFriction(Vec<Span>);

impl BesideFriction {
    /// Of these rows; none where there are none.
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

    /// What is left of a torque of this joint, Nm (N).
    pub(super) fn of(&self, joint: usize, torque: &[f64]) -> DVector<f64> {
        self.0[joint].outside(&DVector::from_column_slice(torque))
    }

    /// The same of the torques of all joints.
    pub(super) fn of_all(&self, torques: &[Vec<f64>]) -> Vec<DVector<f64>> {
        torques.iter().enumerate().map(|(joint, torque)| self.of(joint, torque)).collect()
    }
}
