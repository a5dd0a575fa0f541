//! What is left of each joint's torque beside what it may be without any body: friction, drive inertia, an offset.

use super::motion_rows::MotionRows;
use super::span::Span;
use crate::friction;
use dynident_dynamics::ParametricModel;
use dynident_model::terms::CoulombShape;
use nalgebra::{DMatrix, DVector};

/// For each joint what `1, q̇, s(q̇), q̈` span over the rows, with the step `s` of the joint's terms; of a joint at
/// rest that is less.
pub(super) struct BesideFriction(Vec<Span>);

impl BesideFriction {
    /// Of these rows; none where there are none.
    pub(super) fn new(robot: &ParametricModel, rows: &MotionRows) -> Option<Self> {
        let of_joint = |joint: usize| {
            let (dq, ddq) = (&rows.dq[joint], &rows.ddq[joint]);
            let step = step_of(robot, joint);
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

/// The step of the joint's dry friction; that of the sign where its terms have none.
pub(super) fn step_of(robot: &ParametricModel, joint: usize) -> CoulombShape {
    let mut own = robot.terms().iter().filter(|term| term.own_joint() == Some(joint));
    own.find_map(friction::step_of).unwrap_or(CoulombShape::Sign { dead_band: 0.0 })
}
