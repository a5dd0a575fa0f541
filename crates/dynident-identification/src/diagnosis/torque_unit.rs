//! Is the torque in newton metres? What the description's bodies say of each joint's column.

use super::motion_rows::MotionRows;
use dynident_dynamics::{ParametricModel, Workspace, inverse_dynamics};
use nalgebra::{DMatrix, DVector};

/// Share of a joint's torque that the description's bodies, times any factor, must explain beside friction before the
/// factor says anything.
const EXPLAINED: f64 = 0.5;
/// A factor beyond this (or below its inverse) is a unit or a motor constant; descriptions err by less.
const UNIT_FACTOR: f64 = 3.0;

/// What a unit of one joint's logged torque is worth by the description.
#[derive(Clone, Debug, PartialEq)]
pub struct TorqueUnit {
    /// For each joint what its column has to be multiplied by so that the description's bodies explain it best; none
    /// where they explain too little of it.
    pub scale: Vec<Option<f64>>,
}

impl TorqueUnit {
    /// Joints whose torque cannot be in newton metres if the description is near the truth.
    pub fn joints_in_another_unit(&self) -> Vec<usize> {
        let is_far = |scale: f64| !(UNIT_FACTOR.recip()..=UNIT_FACTOR).contains(&scale);
        (0..self.scale.len()).filter(|&joint| self.scale[joint].is_some_and(is_far)).collect()
    }
}

/// Fits each joint's torque by the nominal bodies' torque times a factor, with viscous and Coulomb friction, drive
/// inertia and an offset; `None` while a body's inertials are unknown.
pub(super) fn torque_unit(robot: &ParametricModel, rows: &MotionRows) -> Option<TorqueUnit> {
    robot.nominal_base()?;
    let model = robot.model();
    let mut workspace = Workspace::new(model);
    let mut predicted = vec![Vec::with_capacity(rows.len()); model.dof()];
    let at = |values: &[Vec<f64>], row: usize| -> Vec<f64> { values.iter().map(|values| values[row]).collect() };
    for row in 0..rows.len() {
        let (q, dq, ddq) = (at(&rows.q, row), at(&rows.dq, row), at(&rows.ddq, row));
        let torque = inverse_dynamics(model, &mut workspace, &q, &dq, &ddq);
        predicted.iter_mut().zip(torque).for_each(|(to, torque)| to.push(*torque));
    }
    let scale = (0..model.dof()).map(|joint| scale_of(rows, joint, &predicted[joint]));
    Some(TorqueUnit { scale: scale.collect() })
}

fn scale_of(rows: &MotionRows, joint: usize, predicted: &[f64]) -> Option<f64> {
    let (dq, ddq) = (&rows.dq[joint], &rows.ddq[joint]);
    let count = rows.len();
    let tau = DVector::from_column_slice(&rows.tau[joint]);
    let fit = |columns: usize| {
        let matrix = DMatrix::from_fn(count, columns, |row, k| match k {
            0 => 1.0,
            1 => dq[row],
            2 => dq[row].signum(),
            3 => ddq[row],
            _ => predicted[row],
        });
        let solution = (matrix.transpose() * &matrix).cholesky()?.solve(&(matrix.transpose() * &tau));
        let left = (&tau - &matrix * &solution).norm_squared();
        Some((left, solution))
    };
    let (without, _) = fit(4)?;
    let (with, solution) = fit(5)?;
    let gain = solution[4];
    let explains = without > 0.0 && with < (1.0 - EXPLAINED) * without;
    (explains && gain > 0.0 && gain.is_finite()).then(|| gain.recip())
}
