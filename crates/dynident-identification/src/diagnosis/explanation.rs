//! How well robots explain the torque of some instants: each joint by itself, one robot for all joints, one that is
//! physically consistent.

use super::motion_rows::MotionRows;
use super::nominal::{left_by_nominal, nominal_torque};
use crate::consistent::{ConsistencySettings, consistent_parameters};
use crate::rows::predicted_torque;
use dynident_dynamics::{BatchWorkspace, Column, Panels, ParametricModel, regressor_panels};
use dynident_estimation::{EstimationError, LinearProblem, SegmentSettings, SegmentedFactor};
use dynident_model::terms::JointMotion;
use nalgebra::{DMatrix, DVector};

/// Rounds of weighting; the third changes scores by less than a hundredth.
const ROUNDS: usize = 3;
/// Added to columns of unit length: what is not excited stays at zero.
const RIDGE: f64 = 1.0e-10;
/// What is left of a joint's torque counts as nothing below this share of it: noise-free simulations would otherwise
/// be judged by their rounding.
const FLOOR: f64 = 1.0e-2;
/// Independent instants to one of a joint's own parameters below which these follow the noise, and whatever friction
/// and elasticity the model has no term for.
const TELLING: f64 = 2.0;
/// Times the usual margin that is asked for at most: of parts of honest logs the best wrong reading gains 0.83, where a
/// reversed joint of a short log gains 1.3.
const MOST_MARGIN: f64 = 1.5;

/// Root mean squares of what is left of each joint's torque, Nm (N), with the floor of a hundredth of the torque.
#[derive(Clone, Debug)]
pub(super) struct Explanation {
    /// Of the torque itself.
    pub(super) torque: Vec<f64>,
    /// By parameters of each joint's own, which no other joint shares.
    pub(super) alone: Vec<f64>,
    /// Independent instants to one of each joint's own parameters, `n/p`.
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
        let theta = solved(&problem)?;
        let torque = residuals(&problem, &vec![0.0; theta.len()], &[])?;
        let free = residuals(&problem, &theta, &torque)?;
        let fit = consistency.and_then(|settings| consistent_parameters(robot, &problem, &free, settings).ok());
        let consistent_parameters = fit.map(|fit| fit.base_values).unwrap_or_default();
        let consistent = if consistent_parameters.is_empty() {
            Vec::new()
        } else {
            residuals(&problem, &consistent_parameters, &torque)?
        };
        let alone = alone.iter().zip(&torque).map(|(left, torque)| left.max(FLOOR * torque)).collect();
        let of_own = |joint: usize| rows.independent / robot.layout().joint_columns(joint).len().max(1) as f64;
        let independent_of_own = (0..robot.dof()).map(of_own).collect();
        let nominal = nominal_torque(robot, rows).map_or_else(Vec::new, |torque| left_by_nominal(robot, rows, &torque));
        let nominal = nominal.iter().zip(&torque).map(|(left, torque)| left.max(FLOOR * torque)).collect();
        Ok(Self {
            torque,
            alone,
            independent_of_own,
            free,
            free_parameters: theta,
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

    /// The same by a physically consistent set; that of the torque itself where there is none.
    pub(super) fn consistent_score(&self) -> f64 {
        if self.consistent.is_empty() { 0.0 } else { score(&self.consistent, &self.torque) }
    }

    /// The same by the description's own bodies; zero where it has none.
    pub(super) fn nominal_score(&self) -> f64 {
        score(&self.nominal, &self.torque)
    }

    /// What parameters of each joint's own would leave if they did not follow its noise: `√(1 − p/n)` of it is seen.
    pub(super) fn alone_of_noise_free(&self) -> Vec<f64> {
        let seen = |of_own: &f64| (1.0 - of_own.max(1.0).recip()).max(0.1).sqrt();
        self.alone.iter().zip(&self.independent_of_own).map(|(left, of_own)| left / seen(of_own)).collect()
    }

    /// Whether there are so many instants to one of a joint's own parameters that what these leave says something.
    pub(super) fn own_parameters_tell(&self) -> Vec<bool> {
        self.independent_of_own.iter().map(|of_own| *of_own >= TELLING).collect()
    }

    /// Times the usual margin by which another reading has to be better: the logarithm of what is left varies by
    /// `√(p/2n)` from log to log, more where few independent instants tell the parameters.
    pub(super) fn margin(&self) -> f64 {
        let least = self.independent_of_own.iter().copied().fold(f64::INFINITY, f64::min);
        (TELLING / least).clamp(1.0, MOST_MARGIN)
    }

    /// The same by parameters of each joint's own.
    pub(super) fn alone_score(&self) -> f64 {
        score(&self.alone, &self.torque)
    }
}

/// `Σ_j ln(left of joint j / torque of joint j)`, joints without torque aside.
pub(super) fn score(left: &[f64], torque: &[f64]) -> f64 {
    left.iter().zip(torque).filter(|(_, torque)| **torque > 0.0).map(|(left, torque)| (left / torque).ln()).sum()
}

/// Base parameters by weighted least squares, joints weighted by what is left of their torque: what
/// [`weighted_least_squares`](dynident_estimation::weighted_least_squares) finds, without its covariance and its
/// account of what is excited, which a comparison of readings does not need.
fn solved(problem: &LinearProblem) -> Result<Vec<f64>, EstimationError> {
    let torque = residuals(problem, &vec![0.0; problem.columns().len()], &[])?;
    let mut sigma = torque.clone();
    let count = problem.columns().len();
    let mut theta = DVector::zeros(count);
    // What stands in the normal equations of each joint: weighted anew in every round, where triangles would have to be
    // merged anew. The ridge is far above their rounding.
    let squares = |equation: &dynident_estimation::JointRows| {
        let total = equation.factor.total();
        let triangle = total.regressor_triangle();
        (triangle.tr_mul(&triangle), triangle.tr_mul(&total.rotated_torque()))
    };
    let squares: Vec<_> = problem.equations().iter().map(squares).collect();
    for _ in 0..ROUNDS {
        let (mut gram, mut right) = (DMatrix::<f64>::zeros(count, count), DVector::<f64>::zeros(count));
        for (equation, (own_gram, own_right)) in problem.equations().iter().zip(&squares) {
            let sigma = sigma[equation.joint];
            let weight = if sigma > 0.0 { sigma.recip().powi(2) } else { 0.0 };
            for (k, &column) in equation.columns.iter().enumerate() {
                right[column] += weight * own_right[k];
                for (l, &row) in equation.columns.iter().enumerate() {
                    gram[(row, column)] += weight * own_gram[(l, k)];
                }
            }
        }
        let norms: Vec<f64> = (0..count).map(|k| gram[(k, k)].sqrt().max(f64::MIN_POSITIVE)).collect();
        for k in 0..count {
            right[k] /= norms[k];
            for l in 0..count {
                // One by one: the product of two that are not excited would be zero.
                gram[(l, k)] = gram[(l, k)] / norms[l] / norms[k];
            }
        }
        for k in 0..gram.nrows() {
            gram[(k, k)] += RIDGE;
        }
        let Some(cholesky) = gram.cholesky() else { break };
        theta = cholesky.solve(&right);
        for (value, norm) in theta.iter_mut().zip(&norms) {
            *value /= norm;
        }
        sigma = residuals(problem, theta.as_slice(), &torque)?;
    }
    Ok(theta.as_slice().to_vec())
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
    let mut problem = LinearProblem::new(robot.base().expressions(), robot.joint_names());
    let mut alone = Vec::with_capacity(model.dof());
    for joint in 0..model.dof() {
        panels.torque_mut(joint).copy_from_slice(&rows.tau[joint]);
        let columns = layout.joint_columns(joint).to_vec();
        let mut factor = SegmentedFactor::new(
            columns.len(),
            SegmentSettings { max_segments: 2, first_length_rows: samples.max(1) },
        )?;
        factor.absorb(panels.joint(joint), samples)?;
        // What follows asks for its triangle again and again.
        let factor = factor.as_one_segment();
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
