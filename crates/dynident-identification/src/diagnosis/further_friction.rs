//! Residual with further friction laws, from which an identification selects automatically.

use super::explanation::{predicted, without_terms};
use super::motion_rows::MotionRows;
use super::span::Span;
use crate::friction::{FURTHER_LAWS, FurtherLaws};
use dynident_dynamics::ParametricModel;
use nalgebra::{DMatrix, DVector};

/// Residual of a joint with [further friction laws](FurtherLaws) divided by its residual with the base parameters
/// `theta`, at most 1.
pub(super) fn ratio_with_further_friction(
    robot: &ParametricModel,
    rows: &MotionRows,
    joint: usize,
    theta: &[f64],
) -> f64 {
    let of = |theta: &[f64]| predicted(robot, rows, theta).swap_remove(joint);
    let bodies = of(&without_terms(robot, theta));
    let left: Vec<f64> = rows.tau[joint].iter().zip(of(theta)).map(|(tau, explained)| tau - explained).collect();
    let (left, laws) = (DVector::from_vec(left), FurtherLaws::of(robot, joint));
    let of_rows: Vec<_> = (0..rows.len()).map(|row| laws.row(rows.dq[joint][row], bodies[row])).collect();
    let column = |row: usize, k: usize| of_rows[row][k];
    let Some(laws) = Span::new(DMatrix::from_fn(rows.len(), FURTHER_LAWS, column)) else { return 1.0 };
    let all = left.norm();
    if all > 0.0 { laws.outside(&left).norm() / all } else { 1.0 }
}
