//! How well robots explain the torque of some instants: each joint by itself, one robot for all joints, one that is
//! physically consistent.

use super::motion_rows::MotionRows;
use super::nominal::left_by_nominal;
use crate::consistent::{ConsistencySettings, consistent_parameters};
use crate::rows::predicted_torque;
use dynident_dynamics::{BatchWorkspace, Panels, ParametricModel, regressor_panels};
use dynident_estimation::{
    CovarianceMethod, EstimationError, LinearProblem, SegmentSettings, SegmentedFactor, WeightedSettings,
    weighted_least_squares,
};
use dynident_model::terms::JointMotion;

/// What is left of a joint's torque counts as nothing below this share of it: noise-free simulations would otherwise
/// be judged by their rounding.
const FLOOR: f64 = 1.0e-2;

/// Root mean squares of what is left of each joint's torque, Nm (N), with the floor of a hundredth of the torque.
#[derive(Clone, Debug)]
pub(super) struct Explanation {
    /// Of the torque itself.
    pub(super) torque: Vec<f64>,
    /// By parameters of each joint's own, which no other joint shares.
    pub(super) alone: Vec<f64>,
    /// By one set of base parameters, consistent or not.
    pub(super) free: Vec<f64>,
    /// By the best physically consistent set; empty where there is none.
    pub(super) consistent: Vec<f64>,
    /// By the description's own bodies with friction fitted joint by joint; empty where it has none.
    pub(super) nominal: Vec<f64>,
}

impl Explanation {
    /// Explains the torque of `rows` by `robot`; consistent sets are looked for where `consistency` is given.
    ///
    /// # Errors
    /// Too few rows.
    pub(super) fn new(
        robot: &ParametricModel,
        rows: &MotionRows,
        consistency: Option<&ConsistencySettings>,
    ) -> Result<Self, EstimationError> {
        let (problem, alone) = problem(robot, rows)?;
        let settings =
            WeightedSettings { covariance: CovarianceMethod::White, tolerance: 1e-2, ..WeightedSettings::default() };
        let estimate = weighted_least_squares(&problem, &settings)?;
        let torque = residuals(&problem, &vec![0.0; estimate.values.len()], &[])?;
        let free = residuals(&problem, &estimate.values, &torque)?;
        let fit = consistency.and_then(|settings| {
            let sigma: Vec<f64> = estimate.joint_sigma.iter().zip(&torque).map(|(s, t)| s.max(FLOOR * t)).collect();
            consistent_parameters(robot, &problem, &sigma, settings).ok()
        });
        let consistent = match &fit {
            Some(fit) => residuals(&problem, &fit.base_values, &torque)?,
            None => Vec::new(),
        };
        let alone = alone.iter().zip(&torque).map(|(left, torque)| left.max(FLOOR * torque)).collect();
        let nominal = left_by_nominal(robot, rows).unwrap_or_default();
        let nominal = nominal.iter().zip(&torque).map(|(left, torque)| left.max(FLOOR * torque)).collect();
        Ok(Self { torque, alone, free, consistent, nominal })
    }

    /// Sum over all joints of the logarithm of what is left beside the torque, by one set of base parameters.
    pub(super) fn free_score(&self) -> f64 {
        score(&self.free, &self.torque)
    }

    /// The same by a physically consistent set; that of the torque itself where there is none.
    pub(super) fn consistent_score(&self) -> f64 {
        if self.consistent.is_empty() { 0.0 } else { score(&self.consistent, &self.torque) }
    }

    /// The same by the description's own bodies; zero where it has none.
    pub(super) fn nominal_score(&self) -> f64 {
        score(&self.nominal, &self.torque)
    }

    /// The same by parameters of each joint's own.
    pub(super) fn alone_score(&self) -> f64 {
        score(&self.alone, &self.torque)
    }
}

fn score(left: &[f64], torque: &[f64]) -> f64 {
    left.iter().zip(torque).filter(|(_, torque)| **torque > 0.0).map(|(left, torque)| (left / torque).ln()).sum()
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

fn panels(robot: &ParametricModel, rows: &MotionRows) -> Panels {
    let (model, layout) = (robot.model(), robot.layout());
    let (q, dq, ddq) = (rows.q.concat(), rows.dq.concat(), rows.ddq.concat());
    let mut panels = Panels::default();
    let motion = JointMotion { samples: rows.len(), q: &q, dq: &dq, ddq: &ddq };
    regressor_panels(model, &mut BatchWorkspace::new(model), layout, &motion, &mut panels);
    panels
}

/// The rows as a problem over the base parameters, and what parameters of each joint's own leave of its torque.
fn problem(robot: &ParametricModel, rows: &MotionRows) -> Result<(LinearProblem, Vec<f64>), EstimationError> {
    let (model, layout) = (robot.model(), robot.layout());
    let samples = rows.len();
    let mut panels = panels(robot, rows);
    let mut problem = LinearProblem::new(robot.base().expressions().to_vec(), robot.joint_names());
    let mut alone = Vec::with_capacity(model.dof());
    for joint in 0..model.dof() {
        panels.torque_mut(joint).copy_from_slice(&rows.tau[joint]);
        let columns = layout.joint_columns(joint).to_vec();
        let mut factor = SegmentedFactor::new(
            columns.len(),
            SegmentSettings { max_segments: 2, first_length_rows: samples.max(1) },
        )?;
        factor.absorb(panels.joint(joint), samples)?;
        let total = factor.total();
        alone.push(total.entry(columns.len(), columns.len()).abs() / (samples.max(1) as f64).sqrt());
        problem.add("rows", joint, columns, factor)?;
    }
    Ok((problem, alone))
}

/// Root mean square of `τ - W θ` joint by joint, at least the floor beside `torque` where that is given.
fn residuals(problem: &LinearProblem, theta: &[f64], torque: &[f64]) -> Result<Vec<f64>, EstimationError> {
    let one = |equation: &dynident_estimation::JointRows| {
        let own: Vec<f64> = equation.columns.iter().map(|&column| theta[column]).collect();
        let factor = equation.factor.total();
        let left = (factor.residual_sum_of_squares(&own)? / factor.rows().max(1) as f64).sqrt();
        Ok(left.max(torque.get(equation.joint).map_or(0.0, |torque| FLOOR * torque)))
    };
    problem.equations().iter().map(one).collect()
}
