//! A payload that one log carries and the other logs do not.

use super::explanation::predicted;
use super::motion_rows::MotionRows;
use dynident_dynamics::{ParametricModel, Workspace, torque_regressor};
use nalgebra::{DMatrix, DVector};

/// Largest ratio of the residual with a payload to that without.
const MAX_RATIO: f64 = 0.6;
/// Added to the squares of the columns, as a share of the largest.
const RIDGE: f64 = 1.0e-9;
/// Smallest mass in standard deviations.
const MIN_DEVIATIONS: f64 = 5.0;

/// A payload at the last body in one log that is not in the model.
#[derive(Clone, Debug, PartialEq)]
pub struct UnmodelledPayload {
    /// Number of the recording.
    pub log: usize,
    /// Its mass, kg, with its standard deviation; negative where it is the training logs that carry it.
    pub mass_kg: f64,
    /// Standard deviation of the mass.
    pub mass_std_kg: f64,
    /// The first moment over the mass, m, in the frame of the last body.
    pub com_m: [f64; 3],
    /// Root mean square of the residual without it, Nm, joints stacked.
    pub left_without: f64,
    /// The same with it.
    pub left_with: f64,
}

/// Estimates a payload at the last body in recording number `log`, whose instants are `rows`, from the residual of base
/// parameters `theta`.
pub(super) fn unmodelled_payload(
    robot: &ParametricModel,
    rows: &MotionRows,
    log: usize,
    theta: &[f64],
) -> Option<UnmodelledPayload> {
    let model = robot.model();
    let (dof, count) = (model.dof(), rows.len());
    // Mass and first moment alone: the inertia of a small payload has little influence.
    let (last, columns) = (model.body_count().checked_sub(1)?, model.inertial_count());
    let mut workspace = Workspace::new(model);
    let mut matrix = DMatrix::zeros(dof * count, 4);
    let mut rest = DVector::zeros(dof * count);
    let explained = predicted(robot, rows, theta);
    for row in 0..count {
        let [q, dq, ddq] = rows.at(row);
        let regressor = torque_regressor(model, &mut workspace, &q, &dq, &ddq);
        for joint in 0..dof {
            let place = joint * count + row;
            for k in 0..4 {
                matrix[(place, k)] = regressor[joint * columns + 10 * last + k];
            }
            rest[place] = rows.tau[joint][row] - explained[joint][row];
        }
    }
    let mut gram = matrix.transpose() * &matrix;
    // Moments without influence stay zero.
    let ridge = RIDGE * gram.diagonal().max();
    (0..4).for_each(|k| gram[(k, k)] += ridge);
    let factor = gram.cholesky()?;
    let solution = factor.solve(&(matrix.transpose() * &rest));
    let left = &rest - &matrix * &solution;
    let rms = |v: &DVector<f64>| v.norm() / ((dof * count).max(1) as f64).sqrt();
    let (left_without, left_with) = (rms(&rest), rms(&left));
    // Neighbouring residuals are correlated: a tenth of them is independent.
    let std = left_with * (10.0 * factor.inverse()[(0, 0)]).sqrt();
    let mass = solution[0];
    (left_with < MAX_RATIO * left_without && mass.abs() > MIN_DEVIATIONS * std).then(|| UnmodelledPayload {
        log,
        mass_kg: mass,
        mass_std_kg: std,
        com_m: core::array::from_fn(|k| solution[k + 1] / mass),
        left_without,
        left_with,
    })
}
