//! Is the torque in newton metres? What the description's bodies say of each joint's column.

use super::motion_rows::MotionRows;
use super::nominal::nominal_torque;
use dynident_dynamics::ParametricModel;
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
    /// Joints whose torque cannot be in newton metres if the description is near the truth; none unless most joints
    /// that say anything agree, for single bodies may be described badly.
    pub fn joints_in_another_unit(&self) -> Vec<usize> {
        let is_far = |scale: f64| !(UNIT_FACTOR.recip()..=UNIT_FACTOR).contains(&scale);
        let far: Vec<usize> = (0..self.scale.len()).filter(|&joint| self.scale[joint].is_some_and(is_far)).collect();
        let telling = self.scale.iter().flatten().count();
        if 2 * far.len() > telling { far } else { Vec::new() }
    }
}

/// Fits each joint's torque by the nominal bodies' torque times a factor, with viscous and Coulomb friction, drive
/// inertia and an offset; `None` while a body's inertials are unknown.
pub(super) fn torque_unit(robot: &ParametricModel, rows: &MotionRows) -> Option<TorqueUnit> {
    let nominal = nominal_torque(robot, rows)?;
    let scale = nominal.iter().enumerate().map(|(joint, nominal)| scale_of(rows, joint, nominal));
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
