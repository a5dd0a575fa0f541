//! The rows of a hypothesis as a linear problem, the residuals of separate parameters of each joint, and those of one
//! set of base parameters.

use super::motion_rows::MotionRows;
use super::nominal::{left_by_nominal, torque_of_bodies};
use dynident_dynamics::{BatchWorkspace, Panels, ParametricModel, regressor_panels};
use dynident_estimation::{
    EstimationError, FactorWorkspace, JointRows, LinearProblem, SegmentedFactor, TriangularFactor,
};
use dynident_model::terms::JointMotion;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Rounds of weighting; the third one changes scores by less than a hundredth.
const ROUNDS: usize = 3;
/// Added to columns of unit length: parameters that are not excited stay at zero.
const RIDGE: f64 = 1.0e-10;

/// Smallest residual as a share of the torque: otherwise rounding would decide in noise-free simulations.
const FLOOR: f64 = 1.0e-2;

/// A motion with several torques of each joint, for hypotheses that differ in torque alone: one pass over the rows
/// serves all of them.
pub(super) struct SharedMotion {
    panels: Arc<Panels>,
    /// For each joint its columns, then its torques.
    factors: Vec<TriangularFactor>,
}

impl SharedMotion {
    /// The motion of `rows` with the `torques` that each joint may have, at least one; those of `rows` aside.
    ///
    /// # Errors
    /// Too few rows.
    pub(super) fn new<'t>(
        robot: &ParametricModel,
        rows: &MotionRows,
        torques: impl Fn(usize) -> Vec<&'t [f64]>,
    ) -> Result<Self, EstimationError> {
        let panels = panels(robot, rows);
        let mut workspace = FactorWorkspace::default();
        let mut with_torques = Vec::new();
        let mut of_joint = |joint: usize| {
            let (columns, torques) = (robot.layout().joint_columns(joint).len(), torques(joint));
            with_torques.clear();
            with_torques.extend_from_slice(&panels.joint(joint)[..columns * rows.len()]);
            for torque in &torques {
                with_torques.extend_from_slice(torque);
            }
            let mut factor = TriangularFactor::new(columns + torques.len() - 1);
            factor.absorb_with(&mut workspace, &with_torques, rows.len())?;
            Ok(factor)
        };
        let factors = (0..robot.dof()).map(&mut of_joint).collect::<Result<_, EstimationError>>()?;
        Ok(Self { panels: Arc::new(panels), factors })
    }
}

/// The rows of a hypothesis joint by joint. Residuals are root mean squares, Nm (N), at least 1 % of the torque.
pub(super) struct JointFits<'a> {
    robot: &'a ParametricModel,
    rows: &'a MotionRows,
    panels: Arc<Panels>,
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
        let mut panels = panels(robot, rows);
        let mut workspace = FactorWorkspace::default();
        let mut of_joint = |joint: usize| {
            panels.torque_mut(joint).copy_from_slice(&rows.tau[joint]);
            let mut factor = TriangularFactor::new(robot.layout().joint_columns(joint).len());
            factor.absorb_with(&mut workspace, panels.joint(joint), rows.len())?;
            Ok(factor)
        };
        let factors = (0..robot.dof()).map(&mut of_joint).collect::<Result<_, EstimationError>>()?;
        Self::of_factors(robot, rows, Arc::new(panels), factors)
    }

    /// The same for `rows` with the shared motion, where joint `j` has the torque number `chosen[j].0` of those that it
    /// may have, times `chosen[j].1`.
    ///
    /// # Errors
    /// Torques that are not there.
    pub(super) fn of_shared(
        robot: &'a ParametricModel,
        rows: &'a MotionRows,
        motion: &SharedMotion,
        chosen: &[(usize, f64)],
    ) -> Result<Self, EstimationError> {
        let of_joint = |(factor, (joint, &(torque, times))): (&TriangularFactor, (usize, &(usize, f64)))| {
            let columns = robot.layout().joint_columns(joint).len();
            let mut weights = vec![0.0; factor.columns() + 1 - columns];
            weights[torque] = times;
            factor.with_torque(columns, &weights)
        };
        let factors = motion.factors.iter().zip(chosen.iter().enumerate()).map(of_joint).collect::<Result<_, _>>()?;
        Self::of_factors(robot, rows, Arc::clone(&motion.panels), factors)
    }

    fn of_factors(
        robot: &'a ParametricModel,
        rows: &'a MotionRows,
        panels: Arc<Panels>,
        factors: Vec<TriangularFactor>,
    ) -> Result<Self, EstimationError> {
        let mut problem = LinearProblem::new(robot.base().expressions(), robot.joint_names());
        let mut alone = Vec::with_capacity(robot.dof());
        for (joint, factor) in factors.into_iter().enumerate() {
            let columns = robot.layout().joint_columns(joint).to_vec();
            let last = factor.entry(columns.len(), columns.len());
            alone.push(last.abs() / (rows.len().max(1) as f64).sqrt());
            problem.add("rows", joint, columns, SegmentedFactor::of_factor(factor))?;
        }
        let torque = residuals(&problem, &vec![0.0; problem.columns().len()], &[])?;
        let alone = alone.iter().zip(&torque).map(|(left, torque)| left.max(FLOOR * torque)).collect();
        Ok(Self { robot, rows, panels, problem, torque, alone })
    }

    /// Base parameters by weighted least squares, joints weighted by what is left of their torque, and what these
    /// leave: what [`weighted_least_squares`](dynident_estimation::weighted_least_squares) finds, without its
    /// covariance and its account of what is excited, which a comparison of hypotheses does not need.
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
        let squares: Vec<_> = problem.equations().iter().map(squares).collect();
        for _ in 0..ROUNDS {
            // On and below the diagonal, which is all that is read of it.
            let (mut gram, mut right) = (DMatrix::<f64>::zeros(count, count), DVector::<f64>::zeros(count));
            for (equation, (own_gram, own_right)) in problem.equations().iter().zip(&squares) {
                let sigma = sigma[equation.joint];
                let weight = if sigma > 0.0 { sigma.recip().powi(2) } else { 0.0 };
                for (k, &column) in equation.columns.iter().enumerate() {
                    right[column] += weight * own_right[k];
                    for (&row, own) in equation.columns[k..].iter().zip(&own_gram[k]) {
                        gram[(row.max(column), row.min(column))] += weight * own;
                    }
                }
            }
            let norms: Vec<f64> = (0..count).map(|k| gram[(k, k)].sqrt().max(f64::MIN_POSITIVE)).collect();
            for k in 0..count {
                right[k] /= norms[k];
                for (entry, norm) in gram.as_mut_slice()[k * count..][k..count].iter_mut().zip(&norms[k..]) {
                    // One by one: the product of two that are not excited would be zero.
                    *entry = *entry / norm / norms[k];
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

    /// Sum over all joints of the logarithm of what that set leaves beside the torque.
    ///
    /// # Errors
    /// Rows of another robot.
    pub(super) fn free_score(&self) -> Result<f64, EstimationError> {
        let (_, free) = self.one_set()?;
        Ok(score(&free, &self.torque))
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

/// `Σ_j ln(left of joint j / torque of joint j)`, joints without torque aside.
pub(super) fn score(left: &[f64], torque: &[f64]) -> f64 {
    left.iter().zip(torque).filter(|(_, torque)| **torque > 0.0).map(|(left, torque)| (left / torque).ln()).sum()
}

/// Of one joint's rows the columns of `WᵀW` from the diagonal on, and `Wᵀτ`.
fn squares(equation: &JointRows) -> (Vec<Vec<f64>>, DVector<f64>) {
    let total = equation.factor.total();
    let triangle = total.regressor_triangle();
    let count = triangle.ncols();
    let mut gram: Vec<Vec<f64>> = (0..count).map(|column| vec![0.0; count - column]).collect();
    let mut row = vec![0.0; count];
    for r in 0..count {
        row[r..].iter_mut().enumerate().for_each(|(k, entry)| *entry = triangle[(r, r + k)]);
        for column in r..count {
            let sums = gram[column].iter_mut().zip(&row[column..]);
            sums.for_each(|(sum, entry)| *sum += row[column] * entry);
        }
    }
    (gram, triangle.tr_mul(&total.rotated_torque()))
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
