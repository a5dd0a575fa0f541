//! Linear least-squares fits to the rows of a hypothesis: residuals with separate parameters of each joint, and
//! residuals with one set of base parameters.

use super::motion_rows::MotionRows;
use super::nominal::{left_by_nominal, torque_of_bodies};
use dynident_dynamics::{BatchWorkspace, Panels, ParametricModel, regressor_panels};
use dynident_estimation::{
    EstimationError, FactorWorkspace, JointRows, LinearProblem, SegmentedFactor, TriangularFactor,
};
use dynident_model::terms::JointMotion;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Number of reweighting rounds; a third round changes scores by less than 0.01.
const WEIGHTING_ROUNDS: usize = 3;
/// Regularisation that is added to the squares of columns of unit length, so that unexcited parameters stay at zero.
const RIDGE: f64 = 1.0e-10;

/// Minimum residual as a share of the torque. Without it, rounding errors would decide in noise-free simulations.
pub(super) const MIN_RESIDUAL_SHARE: f64 = 1.0e-2;

/// A motion with several torques for each joint. One pass over the rows serves all hypotheses that differ only in the
/// torque.
pub(super) struct SharedMotion {
    panels: Arc<Panels>,
    /// For each joint the triangular factor of its regressor columns and of all its torques.
    factors: Vec<TriangularFactor>,
}

impl SharedMotion {
    /// The motion of `rows`, with at least one torque per joint from `torques`; the torques in `rows` are not used.
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

/// Fits to the rows of a hypothesis joint by joint. Residuals are root mean squares, Nm (N), at least 1 % of the
/// torque.
pub(super) struct JointFits<'a> {
    robot: &'a ParametricModel,
    rows: &'a MotionRows,
    panels: Arc<Panels>,
    /// The rows, with the base parameters as unknowns.
    pub(super) problem: LinearProblem,
    /// Root mean square torque of each joint.
    pub(super) torque: Vec<f64>,
    /// Residual with separate parameters of each joint: a lower bound for any robot.
    pub(super) alone: Vec<f64>,
}

impl<'a> JointFits<'a> {
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

    /// Fits with a shared motion. Joint `j` gets the torque with the index `chosen[j].0` in `motion`, times
    /// `chosen[j].1`.
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
        let alone = alone.iter().zip(&torque).map(|(left, torque)| left.max(MIN_RESIDUAL_SHARE * torque)).collect();
        Ok(Self { robot, rows, panels, problem, torque, alone })
    }

    /// Base parameters by weighted least squares, with the inverse residual variance of each joint as weight, and the
    /// residuals. It is faster than [`weighted_least_squares`](dynident_estimation::weighted_least_squares), because it
    /// computes neither covariance nor rank.
    pub(super) fn one_set(&self) -> Result<(Vec<f64>, Vec<f64>), EstimationError> {
        let problem = &self.problem;
        let mut sigma = self.torque.clone();
        let count = problem.columns().len();
        let mut theta = DVector::zeros(count);
        // New weights only scale the normal equations of a joint, whereas triangular factors would have to be merged
        // again. The regularisation is far above the rounding errors of normal equations.
        let squares: Vec<_> = problem.equations().iter().map(squares).collect();
        for _ in 0..WEIGHTING_ROUNDS {
            // The Cholesky factorisation reads only the lower triangle.
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
                    // Two divisions: the product of two tiny norms would be zero.
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

    /// Sum `Σ_j ln(unexplained share of joint j)` for one set of base parameters.
    pub(super) fn free_score(&self) -> Result<f64, EstimationError> {
        let (_, free) = self.one_set()?;
        Ok(score(&free, &self.torque))
    }

    /// Residual of each joint with the base parameters `theta`.
    pub(super) fn left_by(&self, theta: &[f64]) -> Result<Vec<f64>, EstimationError> {
        residuals(&self.problem, theta, &self.torque)
    }

    /// Residual of each joint with the nominal bodies and friction that is fitted joint by joint; empty if a body is
    /// unknown.
    pub(super) fn left_by_nominal(&self) -> Vec<f64> {
        let Some(nominal) = torque_of_bodies(self.robot, &self.panels) else { return Vec::new() };
        let left = left_by_nominal(self.robot, self.rows, &nominal);
        left.iter().zip(&self.torque).map(|(left, torque)| left.max(MIN_RESIDUAL_SHARE * torque)).collect()
    }
}

/// Regressor of some rows, without torques.
pub(super) fn panels(robot: &ParametricModel, rows: &MotionRows) -> Panels {
    let (model, layout) = (robot.model(), robot.layout());
    let (q, dq, ddq) = (rows.q.concat(), rows.dq.concat(), rows.ddq.concat());
    let mut panels = Panels::default();
    let motion = JointMotion { samples: rows.len(), q: &q, dq: &dq, ddq: &ddq };
    regressor_panels(model, &mut BatchWorkspace::new(model), layout, &motion, &mut panels);
    panels
}

/// Sum `Σ_j ln(residual of joint j / torque of joint j)`, without joints that have no torque.
pub(super) fn score(left: &[f64], torque: &[f64]) -> f64 {
    left.iter().zip(torque).filter(|(_, torque)| **torque > 0.0).map(|(left, torque)| (left / torque).ln()).sum()
}

/// `WᵀW` (each column from the diagonal down) and `Wᵀτ` of one joint, with regressor W and torque τ.
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

/// Root mean square of `τ - W θ` of each joint. If `torque` is not empty, at least [`MIN_RESIDUAL_SHARE`] of it.
fn residuals(problem: &LinearProblem, theta: &[f64], torque: &[f64]) -> Result<Vec<f64>, EstimationError> {
    let one = |equation: &JointRows| {
        let own: Vec<f64> = equation.columns.iter().map(|&column| theta[column]).collect();
        let factor = equation.factor.total();
        let left = (factor.residual_sum_of_squares(&own)? / factor.rows().max(1) as f64).sqrt();
        Ok(left.max(torque.get(equation.joint).map_or(0.0, |torque| MIN_RESIDUAL_SHARE * torque)))
    };
    problem.equations().iter().map(one).collect()
}
