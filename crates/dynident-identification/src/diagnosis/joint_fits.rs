//! The rows of a reading as a problem, and what each joint's own parameters leave of its torque: what is known before
//! one robot for all joints is looked for.

use super::motion_rows::MotionRows;
use super::nominal::{left_by_nominal, torque_of_bodies};
use dynident_dynamics::{BatchWorkspace, Panels, ParametricModel, regressor_panels};
use dynident_estimation::{EstimationError, FactorWorkspace, JointRows, LinearProblem, SegmentedFactor};
use dynident_model::terms::JointMotion;
use nalgebra::{DMatrix, DVector};

/// Rounds of weighting; the third changes scores by less than a hundredth.
const ROUNDS: usize = 3;
/// Added to columns of unit length: what is not excited stays at zero.
const RIDGE: f64 = 1.0e-10;

/// What is left of a joint's torque counts as nothing below this share of it: noise-free simulations would otherwise
/// be judged by their rounding.
const FLOOR: f64 = 1.0e-2;

/// The rows of a reading joint by joint. What is left of a torque is a root mean square, Nm (N), with the floor of a
/// hundredth of the torque.
pub(super) struct JointFits<'a> {
    robot: &'a ParametricModel,
    rows: &'a MotionRows,
    panels: Panels,
    /// The rows over the base parameters.
    pub(super) problem: LinearProblem,
    /// Of the torque itself.
    pub(super) torque: Vec<f64>,
    /// What parameters of each joint's own leave, which no other joint shares: the least that any robot leaves.
    pub(super) alone: Vec<f64>,
}

impl<'a> JointFits<'a> {
    /// The torque of `rows` as `robot` would make it.
    ///
    /// # Errors
    /// Too few rows.
    pub(super) fn new(robot: &'a ParametricModel, rows: &'a MotionRows) -> Result<Self, EstimationError> {
        let layout = robot.layout();
        let samples = rows.len();
        let mut panels = panels(robot, rows);
        let mut problem = LinearProblem::new(robot.base().expressions(), robot.joint_names());
        let mut workspace = FactorWorkspace::default();
        let mut alone = Vec::with_capacity(robot.dof());
        for joint in 0..robot.dof() {
            panels.torque_mut(joint).copy_from_slice(&rows.tau[joint]);
            let columns = layout.joint_columns(joint).to_vec();
            let factor = SegmentedFactor::of_rows(&mut workspace, columns.len(), panels.joint(joint), samples)?;
            let last = factor.total().entry(columns.len(), columns.len());
            alone.push(last.abs() / (samples.max(1) as f64).sqrt());
            problem.add("rows", joint, columns, factor)?;
        }
        let torque = residuals(&problem, &vec![0.0; problem.columns().len()], &[])?;
        let alone = alone.iter().zip(&torque).map(|(left, torque)| left.max(FLOOR * torque)).collect();
        Ok(Self { robot, rows, panels, problem, torque, alone })
    }

    /// Base parameters by weighted least squares, joints weighted by what is left of their torque, and what these
    /// leave: what [`weighted_least_squares`](dynident_estimation::weighted_least_squares) finds, without its
    /// covariance and its account of what is excited, which a comparison of readings does not need.
    ///
    /// # Errors
    /// Rows of another robot.
    pub(super) fn one_set(&self) -> Result<(Vec<f64>, Vec<f64>), EstimationError> {
        let problem = &self.problem;
        let mut sigma = self.torque.clone();
        let count = problem.columns().len();
        let mut theta = DVector::zeros(count);
        // What stands in the normal equations of each joint: weighted anew in every round, where triangles would have
        // to be merged anew. The ridge is far above their rounding.
        let squares = |equation: &JointRows| {
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
            sigma = self.left_by(theta.as_slice())?;
        }
        Ok((theta.as_slice().to_vec(), sigma))
    }

    /// What base parameters `theta` leave of each joint's torque.
    ///
    /// # Errors
    /// Parameters of another robot.
    pub(super) fn left_by(&self, theta: &[f64]) -> Result<Vec<f64>, EstimationError> {
        residuals(&self.problem, theta, &self.torque)
    }

    /// What the description's own bodies leave with friction fitted joint by joint; empty where it has none.
    pub(super) fn left_by_nominal(&self) -> Vec<f64> {
        let Some(nominal) = torque_of_bodies(self.robot, &self.panels) else { return Vec::new() };
        let left = left_by_nominal(self.robot, self.rows, &nominal);
        left.iter().zip(&self.torque).map(|(left, torque)| left.max(FLOOR * torque)).collect()
    }
}

/// The regressor's columns of some rows; torques are left out.
pub(super) fn panels(robot: &ParametricModel, rows: &MotionRows) -> Panels {
    let (model, layout) = (robot.model(), robot.layout());
    let (q, dq, ddq) = (rows.q.concat(), rows.dq.concat(), rows.ddq.concat());
    let mut panels = Panels::default();
    let motion = JointMotion { samples: rows.len(), q: &q, dq: &dq, ddq: &ddq };
    regressor_panels(model, &mut BatchWorkspace::new(model), layout, &motion, &mut panels);
    panels
}

/// Root mean square of `τ - W θ` joint by joint, at least the floor beside `torque` where that is given.
fn residuals(problem: &LinearProblem, theta: &[f64], torque: &[f64]) -> Result<Vec<f64>, EstimationError> {
    let one = |equation: &JointRows| {
        let own: Vec<f64> = equation.columns.iter().map(|&column| theta[column]).collect();
        let factor = equation.factor.total();
        let left = (factor.residual_sum_of_squares(&own)? / factor.rows().max(1) as f64).sqrt();
        Ok(left.max(torque.get(equation.joint).map_or(0.0, |torque| FLOOR * torque)))
    };
    problem.equations().iter().map(one).collect()
}
