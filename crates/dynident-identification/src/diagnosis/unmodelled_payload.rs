//! Detection of a payload that one log has and the other logs do not have.

use super::explanation::predicted;
use super::motion_rows::MotionRows;
use crate::diagnosis_settings::HeldOutSettings;
use dynident_dynamics::{ParametricModel, Workspace, torque_regressor};
use nalgebra::{DMatrix, DVector};

/// Regularisation that is added to the squares of the columns, relative to the largest square.
const RIDGE: f64 = 1.0e-9;

/// A payload at the last body in one log that the model does not contain.
#[derive(Clone, Debug, PartialEq)]
pub struct UnmodelledPayload {
    /// Index of the recording.
    pub log: usize,
    /// Mass of the payload, kg; negative if the training logs have the payload and this log does not.
    pub mass_kg: f64,
    /// Standard deviation of the mass, kg.
    pub mass_std_kg: f64,
    /// Centre of mass of the payload in the frame of the last body, m.
    pub com_m: [f64; 3],
    /// Root mean square residual of all joints without the payload in the model, Nm.
    pub left_without: f64,
    /// Root mean square residual of all joints with the payload in the model, Nm.
    pub left_with: f64,
}

/// Estimates a payload at the last body in recording number `log` from the residual with base parameters `theta`.
/// `rows` are the instants of this recording.
pub(super) fn unmodelled_payload(
    robot: &ParametricModel,
    rows: &MotionRows,
    log: usize,
    theta: &[f64],
    settings: &HeldOutSettings,
) -> Option<UnmodelledPayload> {
    let model = robot.model();
    let (dof, count) = (model.dof(), rows.len());
    // The inertia of a small payload has little influence, so only mass and first moment are estimated.
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
    let ridge = RIDGE * gram.diagonal().max();
    (0..4).for_each(|k| gram[(k, k)] += ridge);
    let factor = gram.cholesky()?;
    let solution = factor.solve(&(matrix.transpose() * &rest));
    let left = &rest - &matrix * &solution;
    let rms = |v: &DVector<f64>| v.norm() / ((dof * count).max(1) as f64).sqrt();
    let (left_without, left_with) = (rms(&rest), rms(&left));
    let std = left_with * (settings.residuals_per_independent * factor.inverse()[(0, 0)]).sqrt();
    let mass = solution[0];
    let is_better = left_with < settings.max_ratio_with_payload * left_without;
    (is_better && mass.abs() > settings.min_payload_deviations * std).then(|| UnmodelledPayload {
        log,
        mass_kg: mass,
        mass_std_kg: std,
        com_m: core::array::from_fn(|k| solution[k + 1] / mass),
        left_without,
        left_with,
    })
}
