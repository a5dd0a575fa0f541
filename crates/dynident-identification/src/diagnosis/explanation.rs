//! Residuals of four fits to the torque at some instants: separate parameters of each joint, one set of base
//! parameters, a physically consistent robot, and the nominal bodies.

use super::joint_fits::{JointFits, panels, score};
use super::motion_rows::MotionRows;
use crate::consistent::{ConsistencySettings, consistent_parameters};
use crate::diagnosis_settings::ScoreSettings;
use dynident_dynamics::{Column, ParametricModel};
use dynident_estimation::EstimationError;
use dynident_rows::predicted_torque;

/// Residuals of each joint's torque in several fits: root mean squares, Nm (N), at least a hundredth of the torque.
#[derive(Clone, Debug)]
pub(super) struct Explanation {
    /// Root mean square of the torque itself.
    pub(super) torque: Vec<f64>,
    /// Residual with separate parameters of each joint.
    pub(super) alone: Vec<f64>,
    /// Number of independent instants divided by the number of parameters of a joint, `n/p`.
    instants_per_parameter: Vec<f64>,
    /// Residual with one set of base parameters, physically consistent or not.
    pub(super) free: Vec<f64>,
    /// Base parameters of the fit with one set of base parameters.
    pub(super) free_parameters: Vec<f64>,
    /// Residual with the best physically consistent set; empty without a fit.
    pub(super) consistent: Vec<f64>,
    /// Base parameters of this set; empty without a fit.
    consistent_parameters: Vec<f64>,
    /// Residual with the nominal bodies and friction that is fitted joint by joint; empty if a body is unknown.
    pub(super) nominal: Vec<f64>,
}

impl Explanation {
    /// Fits the torque of `rows` with the model `robot`; also with a physically consistent set if `consistency` is
    /// given.
    pub(super) fn new(
        robot: &ParametricModel,
        rows: &MotionRows,
        consistency: Option<&ConsistencySettings>,
    ) -> Result<Self, EstimationError> {
        let fits = JointFits::new(robot, rows)?;
        let (free_parameters, free) = fits.one_set()?;
        let fit = consistency.and_then(|settings| consistent_parameters(robot, &fits.problem, &free, settings).ok());
        let consistent_parameters = fit.map(|fit| fit.base_values).unwrap_or_default();
        let consistent =
            if consistent_parameters.is_empty() { Vec::new() } else { fits.left_by(&consistent_parameters)? };
        let nominal = fits.left_by_nominal();
        let ratio = |joint: usize| rows.independent / robot.layout().joint_columns(joint).len().max(1) as f64;
        let instants_per_parameter = (0..robot.dof()).map(ratio).collect();
        let JointFits { torque, alone, .. } = fits;
        Ok(Self {
            torque,
            alone,
            instants_per_parameter,
            free,
            free_parameters,
            consistent,
            consistent_parameters,
            nominal,
        })
    }

    /// Base parameters of the best physically consistent set; without such a set, those of the unconstrained fit.
    pub(super) fn parameters(&self) -> &[f64] {
        if self.consistent_parameters.is_empty() { &self.free_parameters } else { &self.consistent_parameters }
    }

    /// Score of the fit with one set of base parameters: `Σ_j ln(unexplained share of joint j)`.
    pub(super) fn free_score(&self) -> f64 {
        score(&self.free, &self.torque)
    }

    /// Residuals with separate parameters of each joint, corrected for overfitting: n instants and p parameters leave
    /// only `√(1 − p/n)` of the noise.
    pub(super) fn alone_of_noise_free(&self) -> Vec<f64> {
        let noise_share = |ratio: &f64| (1.0 - ratio.max(1.0).recip()).max(0.1).sqrt();
        let residuals = self.alone.iter().zip(&self.instants_per_parameter);
        residuals.map(|(left, ratio)| left / noise_share(ratio)).collect()
    }

    pub(super) fn own_parameters_tell(&self, settings: &ScoreSettings) -> Vec<bool> {
        self.instants_per_parameter.iter().map(|ratio| *ratio >= settings.min_instants_per_parameter).collect()
    }

    /// Factor on the improvement that a hypothesis needs. The logarithm of a residual varies by `√(p/2n)` from log to
    /// log (p parameters, n independent instants), so it varies more with few instants.
    pub(super) fn margin(&self, settings: &ScoreSettings) -> f64 {
        let least = self.instants_per_parameter.iter().copied().fold(f64::INFINITY, f64::min);
        (settings.min_instants_per_parameter / least).clamp(1.0, settings.max_margin)
    }
}

/// The torque that base parameters `theta` predict, Nm (N), one vector for each joint.
pub(super) fn predicted(robot: &ParametricModel, rows: &MotionRows, theta: &[f64]) -> Vec<Vec<f64>> {
    let panels = panels(robot, rows);
    let one = |joint: usize| {
        let mut torque = Vec::new();
        let columns = robot.layout().joint_columns(joint);
        predicted_torque(panels.joint(joint), rows.len(), columns, theta, &mut torque);
        torque
    };
    (0..robot.dof()).map(one).collect()
}

/// The base parameters with all friction and drive parameters set to zero.
pub(super) fn without_terms(robot: &ParametricModel, theta: &[f64]) -> Vec<f64> {
    let of_body = |column: &Column| matches!(column, Column::Body { .. });
    robot
        .layout()
        .columns()
        .iter()
        .zip(theta)
        .map(|(column, value)| if of_body(column) { *value } else { 0.0 })
        .collect()
}
