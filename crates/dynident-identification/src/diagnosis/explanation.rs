//! How well robots explain the torque of some instants: each joint alone, one robot for all joints, a consistent one.

use super::joint_fits::{JointFits, panels, score};
use super::motion_rows::MotionRows;
use crate::consistent::{ConsistencySettings, consistent_parameters};
use dynident_dynamics::{Column, ParametricModel};
use dynident_estimation::EstimationError;
use dynident_rows::predicted_torque;

/// Number of independent instants for each of a joint's own parameters, below which these follow the noise, and
/// friction and elasticity without a term in the model.
const MIN_INSTANTS: f64 = 2.0;
/// Largest factor on the needed improvement: the best wrong hypothesis gains 0.83 in parts of correct logs, and a
/// reversed joint of a short log 1.3.
const MAX_MARGIN: f64 = 1.5;

/// Residuals of each joint's torque, root mean squares, Nm (N), at least a hundredth of the torque.
#[derive(Clone, Debug)]
pub(super) struct Explanation {
    /// Of the torque itself.
    pub(super) torque: Vec<f64>,
    /// By separate parameters of each joint.
    pub(super) alone: Vec<f64>,
    /// Number of independent instants for each of a joint's own parameters, `n/p`.
    independent_of_own: Vec<f64>,
    /// By one set of base parameters, consistent or not.
    pub(super) free: Vec<f64>,
    /// That set.
    pub(super) free_parameters: Vec<f64>,
    /// By the best physically consistent set; empty where there is none.
    pub(super) consistent: Vec<f64>,
    /// That set; empty where there is none.
    consistent_parameters: Vec<f64>,
    /// By the description's own bodies with friction fitted joint by joint; empty where it has none.
    pub(super) nominal: Vec<f64>,
}

impl Explanation {
    /// Explains the torque of `rows` by `robot`; with a consistent set where `consistency` is given.
    ///
    /// # Errors
    /// Too few rows.
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
        let of_own = |joint: usize| rows.independent / robot.layout().joint_columns(joint).len().max(1) as f64;
        let independent_of_own = (0..robot.dof()).map(of_own).collect();
        let JointFits { torque, alone, .. } = fits;
        Ok(Self {
            torque,
            alone,
            independent_of_own,
            free,
            free_parameters,
            consistent,
            consistent_parameters,
            nominal,
        })
    }

    /// The best physically consistent set; the one that need not be where there is none.
    pub(super) fn parameters(&self) -> &[f64] {
        if self.consistent_parameters.is_empty() { &self.free_parameters } else { &self.consistent_parameters }
    }

    /// Sum over all joints of the logarithm of what is left beside the torque, by one set of base parameters.
    pub(super) fn free_score(&self) -> f64 {
        score(&self.free, &self.torque)
    }

    /// Residuals of separate parameters of each joint if these did not follow its noise, of which `√(1 − p/n)` remains.
    pub(super) fn alone_of_noise_free(&self) -> Vec<f64> {
        let seen = |of_own: &f64| (1.0 - of_own.max(1.0).recip()).max(0.1).sqrt();
        self.alone.iter().zip(&self.independent_of_own).map(|(left, of_own)| left / seen(of_own)).collect()
    }

    /// Whether there are enough instants for separate parameters of each joint.
    pub(super) fn own_parameters_tell(&self) -> Vec<bool> {
        self.independent_of_own.iter().map(|of_own| *of_own >= MIN_INSTANTS).collect()
    }

    /// Factor on the needed improvement: the logarithm of a residual varies by `√(p/2n)` from log to log, more with few
    /// independent instants.
    pub(super) fn margin(&self) -> f64 {
        let least = self.independent_of_own.iter().copied().fold(f64::INFINITY, f64::min);
        (MIN_INSTANTS / least).clamp(1.0, MAX_MARGIN)
    }
}

/// The torque that base parameters `theta` predict, one vector for each joint.
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

/// Base parameters without those of torque terms: what the bodies alone have.
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
