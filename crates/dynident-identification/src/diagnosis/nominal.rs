//! Torque of the nominal bodies, and its residual with friction fitted joint by joint.

use super::motion_rows::MotionRows;
use super::span::{dot, root_mean_square};
use crate::diagnosis_settings::ChannelSettings;
use crate::friction::step_of_joint;
use dynident_dynamics::{Panels, ParametricModel, Workspace, inverse_dynamics};
use dynident_model::terms::CoulombShape;
use dynident_rows::predicted_torque;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// Torque of the nominal bodies, one vector for each joint, Nm (N); `None` if inertial parameters of a body are
/// unknown.
pub(super) fn nominal_torque(robot: &ParametricModel, rows: &MotionRows) -> Option<Vec<Vec<f64>>> {
    robot.nominal_base()?;
    Some(torque_of(robot, rows, |[q, dq, ddq]| [q, dq, ddq]))
}

/// Torque of the nominal bodies, computed from the regressor of the rows.
pub(super) fn torque_of_bodies(robot: &ParametricModel, panels: &Panels) -> Option<Vec<Vec<f64>>> {
    robot.nominal_base()?;
    let mut parameters = robot.model().parameter_vector();
    parameters.resize(robot.nominal().len(), 0.0);
    let mut theta = robot.base().values(&parameters);
    theta.resize(robot.layout().columns().len(), 0.0);
    let of_joint = |joint: usize| {
        let mut torque = Vec::new();
        let columns = robot.layout().joint_columns(joint);
        predicted_torque(panels.joint(joint), panels.samples(), columns, &theta, &mut torque);
        torque
    };
    Some((0..robot.dof()).map(of_joint).collect())
}

/// Gravity torque of the nominal bodies, one vector for each joint, Nm (N); zero if inertial parameters of a body are
/// unknown.
pub(super) fn gravity_torque(robot: &ParametricModel, rows: &MotionRows) -> Vec<Vec<f64>> {
    if robot.nominal_base().is_none() {
        return vec![vec![0.0; rows.len()]; robot.dof()];
    }
    torque_of(robot, rows, |[q, dq, ddq]| [q, vec![0.0; dq.len()], vec![0.0; ddq.len()]])
}

fn torque_of(
    robot: &ParametricModel,
    rows: &MotionRows,
    motion: impl Fn([Vec<f64>; 3]) -> [Vec<f64>; 3],
) -> Vec<Vec<f64>> {
    let model = robot.model();
    let mut workspace = Workspace::new(model);
    let mut torque = vec![Vec::with_capacity(rows.len()); model.dof()];
    for row in 0..rows.len() {
        let [q, dq, ddq] = motion(rows.at(row));
        let now = inverse_dynamics(model, &mut workspace, &q, &dq, &ddq);
        torque.iter_mut().zip(now).for_each(|(joint, now)| joint.push(*now));
    }
    torque
}

/// Whether the nominal bodies alone explain the torque of every joint. Measured torque contains friction.
pub(super) fn is_torque_of_description(robot: &ParametricModel, rows: &MotionRows, settings: ChannelSettings) -> bool {
    let is_nominal = |(tau, nominal): (&Vec<f64>, &Vec<f64>)| {
        let rest: Vec<f64> = tau.iter().zip(nominal).map(|(tau, nominal)| tau - nominal).collect();
        root_mean_square(&rest) <= settings.max_residual_of_description * root_mean_square(tau)
    };
    nominal_torque(robot, rows).is_some_and(|nominal| rows.tau.iter().zip(&nominal).all(is_nominal))
}

/// Residual of each joint by the torque `nominal` of the nominal bodies ([`nominal_torque`]) with the best nonnegative
/// viscous and Coulomb friction and the best offset, root mean square, Nm (N).
pub(super) fn left_by_nominal(robot: &ParametricModel, rows: &MotionRows, nominal: &[Vec<f64>]) -> Vec<f64> {
    let left = |(joint, nominal): (usize, &Vec<f64>)| {
        let rest: Vec<f64> = rows.tau[joint].iter().zip(nominal).map(|(tau, nominal)| tau - nominal).collect();
        left_by_friction(&rows.dq[joint], step_of_joint(robot, joint), &rest)
    };
    nominal.iter().enumerate().map(left).collect()
}

/// Root mean square residual of `tau` after a fit of offset and nonnegative friction.
fn left_by_friction(dq: &[f64], step: CoulombShape, tau: &[f64]) -> f64 {
    let count = tau.len();
    let columns = [vec![1.0; count], dq.to_vec(), dq.iter().map(|&dq| step.step(dq)).collect()];
    let gram = Matrix3::from_fn(|k, l| dot(&columns[k], &columns[l]));
    let right = Vector3::from_fn(|k, _| dot(&columns[k], tau));
    let mut kept = vec![0, 1, 2];
    loop {
        let own_gram = DMatrix::from_fn(kept.len(), kept.len(), |k, l| gram[(kept[k], kept[l])]);
        let own_right = DVector::from_fn(kept.len(), |k, _| right[kept[k]]);
        let Some(solution) = own_gram.cholesky().map(|factor| factor.solve(&own_right)) else {
            if kept.len() > 1 {
                kept.pop();
                continue;
            }
            return root_mean_square(tau);
        };
        let negative =
            (1..kept.len()).filter(|&k| solution[k] < 0.0).min_by(|&a, &b| solution[a].total_cmp(&solution[b]));
        if let Some(k) = negative {
            kept.remove(k);
            continue;
        }
        let mut left = tau.to_vec();
        for (value, &column) in solution.iter().zip(&kept) {
            left.iter_mut().zip(&columns[column]).for_each(|(left, x)| *left -= value * x);
        }
        return root_mean_square(&left);
    }
}
