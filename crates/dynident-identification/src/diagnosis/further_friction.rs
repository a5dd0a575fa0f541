//! Residual with further friction laws, among which identification selects automatically.

use super::explanation::{predicted, without_terms};
use super::motion_rows::MotionRows;
use super::span::Span;
use crate::friction::step_of_joint;
use dynident_dynamics::ParametricModel;
use nalgebra::{DMatrix, DVector};

/// Stribeck velocities, rad/s for an arm of usual size
/// ([`CharacteristicScale::velocity`](dynident_model::CharacteristicScale::velocity)).
const STRIBECK_RAD_S: [f64; 3] = [0.03, 0.1, 0.3];

/// Ratio of a joint's residual with further friction laws to its residual by base parameters `theta`, at most 1: load
/// dependence `|τ_bodies| s(q̇)`, Stribeck `s(q̇) e^(−(q̇/v)²)`, asymmetry `|s(q̇)|` and `|q̇|`, square root
/// `s(q̇) √|q̇|`.
pub(super) fn ratio_with_further_friction(
    robot: &ParametricModel,
    rows: &MotionRows,
    joint: usize,
    theta: &[f64],
) -> f64 {
    let of = |theta: &[f64]| predicted(robot, rows, theta).swap_remove(joint);
    let bodies = of(&without_terms(robot, theta));
    let left: Vec<f64> = rows.tau[joint].iter().zip(of(theta)).map(|(tau, explained)| tau - explained).collect();
    let (left, step) = (DVector::from_vec(left), step_of_joint(robot, joint));
    let is_rotary = robot.model().joints()[joint].is_rotary();
    let own_velocity = |usual: f64| robot.model().characteristic_scale().velocity(is_rotary, usual);
    let column = |row: usize, k: usize| {
        let dq = rows.dq[joint][row];
        let step = step.step(dq);
        match k {
            0 => bodies[row].abs() * step,
            1 => step.abs(),
            2 => dq.abs(),
            3 => step * dq.abs().sqrt(),
            _ => step * (-(dq / own_velocity(STRIBECK_RAD_S[k - 4])).powi(2)).exp(),
        }
    };
    let Some(laws) = Span::new(DMatrix::from_fn(rows.len(), 4 + STRIBECK_RAD_S.len(), column)) else { return 1.0 };
    let all = left.norm();
    if all > 0.0 { laws.outside(&left).norm() / all } else { 1.0 }
}
