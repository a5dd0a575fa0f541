//! Generalised least squares for errors that are correlated between joints.

use super::weighted::{WeightedSettings, noise_of_joints};
use crate::error::{EstimationError, expect};
use crate::factor::{LinearProblem, SegmentedFactor, Unexcited, solve, split};
use crate::uncertainty::{Estimate, PointEstimate};
use nalgebra::{DMatrix, DVector};

/// Rows of all joints in one table: one row `[W_1 τ_1 | W_2 τ_2 | … | W_n τ_n]` per instant of a log, stored as
/// factors.
///
/// The triangle of such rows contains all products `W_iᵀW_j`, so any covariance between joints can be applied without
/// another pass over the rows. The triangle has the columns of all joints: for a seven-joint arm, absorbing rows
/// takes about seven times as long as with separate factors.
///
/// ```
/// use dynident_estimation::*;
/// // Two joints that see the same gain; the second one's error is minus the first one's.
/// let x: Vec<f64> = (0..64).map(|k| f64::from(k % 7) - 3.0).collect();
/// let e: Vec<f64> = (0..64).map(|k| if k % 3 == 0 { 0.2 } else { -0.1 }).collect();
/// let torque = |k: usize, sign: f64| 2.0 * x[k] + sign * e[k] + 0.01 * (k as f64 * sign).cos();
/// let tau = |sign: f64| -> Vec<f64> { (0..64).map(|k| torque(k, sign)).collect() };
/// let joints = vec!["joint1".into(), "joint2".into()];
/// let mut problem = CrossProblem::new(vec!["gain".into()], joints, vec![vec![0], vec![0]])?;
/// let mut rows = SegmentedFactor::new(problem.width(), SegmentSettings { max_segments: 8, first_length_rows: 8 })?;
/// rows.absorb(&[x.clone(), tau(1.0), x.clone(), tau(-1.0)].concat(), 64)?;
/// problem.add("run", rows)?;
/// let found = generalized_least_squares(&problem, &WeightedSettings::default())?;
/// assert!((found.estimate.values[0] - 2.0).abs() < 0.01);
/// assert!(found.noise_correlation[(0, 1)] < -0.9);
/// # Ok::<(), dynident_estimation::EstimationError>(())
/// ```
#[derive(Clone, Debug)]
pub struct CrossProblem {
    columns: Vec<String>,
    joints: Vec<String>,
    joint_columns: Vec<Vec<usize>>,
    fallback: Vec<f64>,
    unexcited: Unexcited,
    logs: Vec<(String, SegmentedFactor)>,
}

/// Result of [`generalized_least_squares`].
#[derive(Clone, Debug, PartialEq)]
pub struct GeneralizedEstimate {
    /// Values with covariance. A cluster is one time segment of all joints. The score inflation and the two segment
    /// correlations of the estimate refer to all joints together.
    pub estimate: Estimate,
    /// Ω, covariance of the joints' errors at one instant, (joints, joints), squared torque.
    pub noise_covariance: DMatrix<f64>,
    /// Correlation matrix of Ω.
    pub noise_correlation: DMatrix<f64>,
}

impl CrossProblem {
    /// Creates a problem without data from the names of columns and joints and the columns of each joint.
    ///
    /// # Errors
    /// [`EstimationError::Empty`] without joints; [`EstimationError::Mismatch`] for a wrong number of lists;
    /// [`EstimationError::Column`] for a column out of range or duplicate.
    pub fn new(
        columns: Vec<String>,
        joints: Vec<String>,
        joint_columns: Vec<Vec<usize>>,
    ) -> Result<Self, EstimationError> {
        if joints.is_empty() {
            return Err(EstimationError::Empty);
        }
        expect("lists of columns, one for each joint", joints.len(), joint_columns.len())?;
        for (joint, list) in joints.iter().zip(&joint_columns) {
            let mut seen = vec![false; columns.len()];
            for &column in list {
                if column >= seen.len() || std::mem::replace(&mut seen[column], true) {
                    let (joint, columns) = (joint.clone(), columns.len());
                    return Err(EstimationError::Column { log: "any".into(), joint, column, columns });
                }
            }
        }
        Ok(Self {
            fallback: vec![0.0; columns.len()],
            unexcited: Unexcited::default(),
            columns,
            joints,
            joint_columns,
            logs: Vec::new(),
        })
    }

    /// Number of columns of a log's factor: columns of all joints and torques of all joints except the last.
    pub fn width(&self) -> usize {
        self.joint_columns.iter().map(|list| list.len() + 1).sum::<usize>().saturating_sub(1)
    }

    /// Adds a log: rows `[W_1 τ_1 | … | W_n τ_n]` in order of time, with the columns of each joint in the order given
    /// to `new`.
    ///
    /// # Errors
    /// [`EstimationError::Mismatch`] if the factor has another [`width`](Self::width).
    pub fn add(&mut self, log: &str, rows: SegmentedFactor) -> Result<(), EstimationError> {
        expect("columns of all joints together", self.width(), rows.columns())?;
        self.logs.push((log.into(), rows));
        Ok(())
    }

    /// Sets the values of columns that the data do not excite; zero by default.
    ///
    /// # Errors
    /// Same as for [`LinearProblem::with_fallback`].
    pub fn with_fallback(mut self, values: Vec<f64>) -> Result<Self, EstimationError> {
        LinearProblem::new(self.columns.clone(), self.joints.clone()).with_fallback(values.clone())?;
        self.fallback = values;
        Ok(self)
    }

    /// Sets columns to hold at their fallback values, like [`LinearProblem::with_unexcited`].
    ///
    /// # Errors
    /// Same as for [`LinearProblem::with_unexcited`].
    pub fn with_unexcited(mut self, unexcited: Unexcited) -> Result<Self, EstimationError> {
        let checked = LinearProblem::new(self.columns.clone(), self.joints.clone()).with_unexcited(unexcited)?;
        self.unexcited = checked.unexcited().clone();
        Ok(self)
    }

    fn rows(&self) -> usize {
        self.logs.iter().map(|(_, factor)| factor.rows()).sum()
    }

    /// First column of each joint in a log's factor.
    fn starts(&self) -> Vec<usize> {
        let mut next = 0;
        let mut start = |list: &Vec<usize>| {
            next += list.len() + 1;
            next - list.len() - 1
        };
        self.joint_columns.iter().map(&mut start).collect()
    }

    /// `EᵀE` of the residuals `E = [τ_1 − W_1 θ, …]`, and `‖τ_j‖²` of every joint j.
    fn residual_products(&self, theta: &[f64]) -> (DMatrix<f64>, Vec<f64>) {
        let (size, joints) = (self.width() + 1, self.joints.len());
        let mut choice = DMatrix::zeros(size, joints);
        let starts = self.starts();
        for (joint, list) in self.joint_columns.iter().enumerate() {
            for (place, &column) in list.iter().enumerate() {
                choice[(starts[joint] + place, joint)] = -theta[column];
            }
            choice[(starts[joint] + list.len(), joint)] = 1.0;
        }
        let mut products = DMatrix::zeros(joints, joints);
        let mut torque = vec![0.0; joints];
        for (_, factor) in &self.logs {
            let total = factor.total();
            let triangle = DMatrix::from_fn(size, size, |row, column| total.entry(row, column));
            let errors = &triangle * &choice;
            products += errors.tr_mul(&errors);
            for (joint, list) in self.joint_columns.iter().enumerate() {
                torque[joint] += triangle.column(starts[joint] + list.len()).norm_squared();
            }
        }
        (products, torque)
    }

    /// Rows `Σ_j L⁻¹_kj [W_j | τ_j]` for every k, as a problem of one joint.
    fn whitened(&self, whitener: &DMatrix<f64>) -> Result<LinearProblem, EstimationError> {
        let (size, count) = (self.width() + 1, self.columns.len());
        let starts = self.starts();
        let block = |k: usize| {
            let mut block = DMatrix::zeros(size, count + 1);
            for (joint, list) in self.joint_columns.iter().enumerate() {
                for (place, &column) in list.iter().enumerate() {
                    block[(starts[joint] + place, column)] = whitener[(k, joint)];
                }
                block[(starts[joint] + list.len(), count)] = whitener[(k, joint)];
            }
            block
        };
        let blocks: Vec<DMatrix<f64>> = (0..self.joints.len()).map(block).collect();
        let mut problem = LinearProblem::new(self.columns.clone(), vec!["all joints".into()])
            .with_fallback(self.fallback.clone())?
            .with_unexcited(self.unexcited.clone())?;
        for (log, factor) in &self.logs {
            problem.add(log, 0, (0..count).collect(), factor.transformed(&blocks))?;
        }
        Ok(problem)
    }
}

/// Limit of the correlation of two joints' errors. Above it the whitening would amplify the rounding of their
/// difference.
const MAX_CORRELATION: f64 = 1.0 - 1.0e-9;

/// Solves `θ = argmin Σ_t e_tᵀ Ω⁻¹ e_t`. `e_t = τ_t − W_t θ` is the error of all joints at instant t. `Ω = Σ_t e_t
/// e_tᵀ / (N − p/n)` is iterated from the unit matrix to convergence; p estimated columns, n joints, N instants.
///
/// With `Ω = L Lᵀ` the rows are multiplied by L⁻¹, without another pass over the log. The white covariance is `(Σ
/// W_tᵀΩ⁻¹W_t)⁻¹`; for the covariance from segments a cluster is a segment of all joints. Zellner, J. Am. Stat. Assoc.
/// 57 (1962) 348 (seemingly unrelated regressions, iterated).
///
/// # Errors
/// [`EstimationError::Empty`], [`EstimationError::TooFewRows`] (there must be more instants than the columns' share
/// plus the joints), [`EstimationError::Setting`], and those of the covariance. Proportional errors of two joints are
/// whitened with a correlation of 1 − 1e-9.
#[doc(alias("gls", "sur", "zellner"))]
pub fn generalized_least_squares(
    problem: &CrossProblem,
    settings: &WeightedSettings,
) -> Result<GeneralizedEstimate, EstimationError> {
    settings.validate()?;
    let rows = problem.rows();
    let joints = problem.joints.len();
    if rows == 0 {
        return Err(EstimationError::Empty);
    }
    // Start: independent joints with equal noise.
    let mut whitener = DMatrix::identity(joints, joints);
    let mut whitened = problem.whitened(&whitener)?;
    let mut triangle = whitened.stacked().combined(&[1.0])?;
    let choice = split(&triangle, &settings.rank, whitened.unexcited());
    let share = choice.free.len() as f64 / joints as f64;
    let degrees_of_freedom = rows as f64 - share;
    if degrees_of_freedom <= joints as f64 {
        let (what, parameters) = ("every joint".to_owned(), share + joints as f64);
        return Err(EstimationError::TooFewRows { what, rows, parameters });
    }
    let mut solution = solve(&triangle, &choice, &settings.rank, &problem.fallback);
    let mut omega: DMatrix<f64>;
    let mut previous: Option<DMatrix<f64>> = None;
    let (mut iterations, mut converged) = (1, false);
    // Alternates between the covariance from residuals and the solution from the covariance.
    loop {
        let (products, torque) = problem.residual_products(&solution.values);
        let squares: Vec<f64> = products.diagonal().iter().copied().collect();
        let sigma = noise_of_joints(&squares, &torque, &vec![degrees_of_freedom; joints]);
        omega = noise_covariance(&products, &sigma, degrees_of_freedom);
        if let Some(previous) = &previous {
            let change = |i: usize, j: usize| ((omega[(i, j)] - previous[(i, j)]) / (sigma[i] * sigma[j])).abs();
            let largest = (0..joints).flat_map(|i| (0..joints).map(move |j| (i, j))).map(|(i, j)| change(i, j));
            converged = largest.fold(0.0, f64::max) <= settings.tolerance;
        }
        if converged || iterations == settings.max_iterations {
            break;
        }
        whitener = inverse_root(&omega, &sigma);
        whitened = problem.whitened(&whitener)?;
        triangle = whitened.stacked().combined(&[1.0])?;
        solution = solve(&triangle, &choice, &settings.rank, &problem.fallback);
        previous = Some(omega);
        iterations += 1;
    }
    // All joints form one whitened problem and share its diagnostics.
    let sigma: Vec<f64> = omega.diagonal().iter().map(|variance| variance.sqrt()).collect();
    let fitted = PointEstimate {
        triangle,
        split: choice,
        solution,
        weights: vec![1.0],
        joint_sigma: vec![1.0],
        weighted_variance: 1.0,
        iterations,
        converged,
    };
    let mut estimate = fitted.into_estimate(&whitened.stacked(), &settings.rank, settings.covariance)?;
    let all = |values: &mut Vec<f64>| *values = vec![values.first().copied().unwrap_or(0.0); joints];
    all(&mut estimate.score_inflation);
    all(&mut estimate.effective_lag1);
    all(&mut estimate.segment_correlation);
    let noise_correlation = DMatrix::from_fn(joints, joints, |i, j| omega[(i, j)] / (sigma[i] * sigma[j]));
    estimate.joint_sigma = sigma;
    Ok(GeneralizedEstimate { estimate, noise_covariance: omega, noise_correlation })
}

/// Covariance of the joints' noise with the standard deviations `sigma` and bounded correlations.
fn noise_covariance(products: &DMatrix<f64>, sigma: &[f64], degrees_of_freedom: f64) -> DMatrix<f64> {
    DMatrix::from_fn(sigma.len(), sigma.len(), |i, j| {
        if i == j {
            sigma[i] * sigma[i]
        } else {
            let bound = MAX_CORRELATION * sigma[i] * sigma[j];
            (products[(i, j)] / degrees_of_freedom).clamp(-bound, bound)
        }
    })
}

/// L⁻¹ with L Lᵀ = Ω. If clamped correlations made Ω indefinite, it is shrunk towards its diagonal until it is
/// positive definite.
fn inverse_root(omega: &DMatrix<f64>, sigma: &[f64]) -> DMatrix<f64> {
    let joints = sigma.len();
    let diagonal = DMatrix::from_diagonal(&DVector::from_iterator(joints, sigma.iter().map(|s| s * s)));
    let mut shrink = 0.0;
    for _ in 0..12 {
        let mixed = omega * (1.0 - shrink) + &diagonal * shrink;
        let root = mixed.cholesky().and_then(|factor| factor.l().try_inverse());
        if let Some(inverse) = root.filter(|inverse| inverse.iter().all(|value| value.is_finite())) {
            return inverse;
        }
        shrink = if shrink == 0.0 { 1.0e-9 } else { (shrink * 10.0_f64).min(1.0) };
    }
    DMatrix::from_diagonal(&DVector::from_iterator(joints, sigma.iter().map(|s| 1.0 / s)))
}
