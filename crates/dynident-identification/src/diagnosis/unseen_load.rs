//! A log whose torque speaks of a load that the other logs did not carry.

use super::explanation::predicted;
use super::motion_rows::MotionRows;
use dynident_dynamics::{ParametricModel, Workspace, torque_regressor};
use nalgebra::{DMatrix, DVector};

/// What is left of the torque must fall by this factor with a load at the last body.
const FALLS_TO: f64 = 0.6;
/// Added to the squares of the columns, as a share of the largest.
const UNFELT: f64 = 1.0e-9;
/// Standard deviations by which the mass differs from nothing.
const CLEARLY: f64 = 5.0;

/// A load at the last body that one log has and the model has not.
#[derive(Clone, Debug, PartialEq)]
pub struct UnseenLoad {
    /// Number of the recording.
    pub log: usize,
    /// Its mass, kg, with its standard deviation; negative where it is the training logs that carry it.
    pub mass_kg: f64,
    /// Standard deviation of the mass.
    pub mass_std_kg: f64,
    /// The first moment over the mass, m, in the frame of the last body.
    pub com_m: [f64; 3],
    /// Root mean square of what is left of the torque without it, Nm, joints stacked.
    pub left_without: f64,
    /// The same with it.
    pub left_with: f64,
}

/// Looks for a load at the last body in recording number `log`, whose instants are `rows`, beside the torque that base
/// parameters `theta` explain.
pub(super) fn unseen_load(robot: &ParametricModel, rows: &MotionRows, log: usize, theta: &[f64]) -> Option<UnseenLoad> {
    let model = robot.model();
    let (dof, count) = (model.dof(), rows.len());
    // Of ten parameters those four that weigh: mass and first moment; a load small beside its lever has little else.
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
    // What no joint feels (a moment along all axes) stays nothing.
    let ridge = UNFELT * gram.diagonal().max();
    (0..4).for_each(|k| gram[(k, k)] += ridge);
    let factor = gram.cholesky()?;
    let solution = factor.solve(&(matrix.transpose() * &rest));
    let left = &rest - &matrix * &solution;
    let rms = |v: &DVector<f64>| v.norm() / ((dof * count).max(1) as f64).sqrt();
    let (left_without, left_with) = (rms(&rest), rms(&left));
    // Residuals of neighbouring instants are alike: a tenth of them counts.
    let std = left_with * (10.0 * factor.inverse()[(0, 0)]).sqrt();
    let mass = solution[0];
    (left_with < FALLS_TO * left_without && mass.abs() > CLEARLY * std).then(|| UnseenLoad {
        log,
        mass_kg: mass,
        mass_std_kg: std,
        com_m: core::array::from_fn(|k| solution[k + 1] / mass),
        left_without,
        left_with,
    })
}
