//! What laws of friction that the study does not have leave of a torque: identification chooses among these by itself.

use super::explanation::{predicted, without_terms};
use super::motion_rows::MotionRows;
use super::span::Span;
use crate::friction::step_of_joint;
use dynident_dynamics::ParametricModel;
use nalgebra::{DMatrix, DVector};

/// Velocities from which friction rises toward rest, rad/s of a usual arm
/// ([`OwnScale::velocity`](dynident_model::OwnScale::velocity)).
const STRIBECK: [f64; 3] = [0.03, 0.1, 0.3];
/// Times what base parameters `theta` leave of a joint's torque that is left beside friction by the joint's load,
/// `|τ_bodies| s(q̇)`, friction that rises toward rest, `s(q̇) e^(−(q̇/v)²)`, that differs with the direction,
/// `|s(q̇)|` and `|q̇|`, and that grows less than the velocity, `s(q̇) √|q̇|`; at most one.
pub(super) fn left_beside_further_friction(
    robot: &ParametricModel,
    rows: &MotionRows,
    joint: usize,
    theta: &[f64],
) -> f64 {
    let of = |theta: &[f64]| predicted(robot, rows, theta).swap_remove(joint);
    let bodies = of(&without_terms(robot, theta));
    let left: Vec<f64> = rows.tau[joint].iter().zip(of(theta)).map(|(tau, explained)| tau - explained).collect();
    let (left, step) = (DVector::from_vec(left), step_of_joint(robot, joint));
    let turns = robot.model().joints()[joint].turns();
    let own_velocity = |usual: f64| robot.model().own_scale().velocity(turns, usual);
    let column = |row: usize, k: usize| {
        let dq = rows.dq[joint][row];
        let step = step.step(dq);
        match k {
            0 => bodies[row].abs() * step,
            1 => step.abs(),
            2 => dq.abs(),
            3 => step * dq.abs().sqrt(),
            _ => step * (-(dq / own_velocity(STRIBECK[k - 4])).powi(2)).exp(),
        }
    };
    let Some(laws) = Span::new(DMatrix::from_fn(rows.len(), 4 + STRIBECK.len(), column)) else { return 1.0 };
    let all = left.norm();
    if all > 0.0 { laws.outside(&left).norm() / all } else { 1.0 }
}
