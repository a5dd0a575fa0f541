//! Maximum likelihood with errors of known covariance in motion and torque, for averaged periods of a repeated motion.

use crate::error::{EstimationError, expect, require, within};
use crate::factor::{FactorWorkspace, RankReport, RankSettings, TriangularFactor, Unexcited, report, solve, split};
use crate::uncertainty::{EstimateStatus, covariance_of_all};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use serde::Serialize;

/// All rows of one instant.
#[derive(Clone, Copy, Debug)]
pub struct InstantRows<'a> {
    /// W, shape (joints, columns).
    pub regressor: &'a DMatrix<f64>,
    /// τ, one entry per joint.
    pub torque: &'a DVector<f64>,
    /// `∂W/∂x_i` for every measured variable x_i of the motion at this instant (positions; or positions, velocities
    /// and accelerations), each of W's shape.
    pub regressor_by_motion: &'a [DMatrix<f64>],
}

/// Receives the instants of a pass.
pub type InstantVisitor<'a> = dyn FnMut(&InstantRows<'_>) -> Result<(), EstimationError> + 'a;

/// Settings of [`maximum_likelihood`].
#[derive(Clone, Debug, PartialEq)]
pub struct MaximumLikelihoodSettings {
    /// Σ_q: covariance of the errors of the motion's variables at one instant, after averaging (for P periods, 1/P of
    /// that of one period). Symmetric, positive semidefinite.
    pub motion_covariance: DMatrix<f64>,
    /// Σ_τ: covariance of the torque's errors, (joints, joints), positive definite.
    pub torque_covariance: DMatrix<f64>,
    /// Criteria for an excited column.
    pub rank: RankSettings,
    /// The iteration ends at this step length, in error bars over all directions; 1e-6 is usual.
    pub tolerance: f64,
    /// Maximum number of steps; 50 is sufficient.
    pub max_iterations: usize,
}

/// Result of [`maximum_likelihood`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MaximumLikelihoodEstimate {
    /// Names of the columns.
    pub names: Vec<String>,
    /// One value per column; zero for an unexcited column.
    pub values: Vec<f64>,
    /// `(Σ_k W̃_kᵀ S_k⁻¹ W̃_k)⁻¹`: the Cramér-Rao bound for the given covariances; zero rows and columns for fixed
    /// columns.
    #[serde(skip)]
    pub covariance: DMatrix<f64>,
    /// Square roots of its diagonal.
    pub std: Vec<f64>,
    /// The cost at the values.
    pub cost: f64,
    /// Residuals minus estimated columns. The cost is about this large for a correct model and correct covariances
    /// (χ²), and larger for an incomplete model.
    pub degrees_of_freedom: usize,
    /// Number of steps.
    pub iterations: usize,
    /// Status of the estimator.
    pub status: EstimateStatus,
    /// Rank decisions.
    pub rank: RankReport,
}

/// Results of one pass at θ.
struct PassSums {
    triangle: TriangularFactor,
    cost: f64,
}

/// Minimises
///
/// ```text
///     J(θ) = Σ_k r_kᵀ S_k(θ)⁻¹ r_k,   r_k = τ_k − W_k θ,
///     S_k = D_k Σ_q D_kᵀ + Σ_τ,   D_k = ∂r_k/∂q = −Σ_j θ_j ∂W_kj/∂q
/// ```
///
/// which is the exponent of the likelihood with the best motion near the measured one for every instant. Olsen,
/// Swevers and Verdonck, Int. J. Robotics Research 21 (2002) 895: for periodic excitation Σ_q and Σ_τ are known from
/// the differences between periods. Noise in W biases least squares towards zero, but not this estimate, to first
/// order in the motion's errors.
///
/// Gauss-Newton steps use the regressor at the corrected motion, `W̃ = W + Σ_i (Σ_q Dᵀ S⁻¹ r)_i (−∂W/∂q_i)`, with the
/// exact gradient `∂J/∂θ = −2 Σ W̃ᵀ S⁻¹ r` (Britt and Luecke, Technometrics 15 (1973) 233). A step that does not lower
/// J is halved. The first step, from θ = 0, is generalised least squares.
///
/// `pass` must give the same instants to its visitor at each call.
///
/// # Errors
/// [`EstimationError::Setting`] for invalid covariances or settings, [`EstimationError::Mismatch`] for wrong shapes,
/// [`EstimationError::Empty`], [`EstimationError::TooFewRows`], [`EstimationError::Unusable`], and the errors of
/// `pass`.
#[doc(alias("ml", "mle"))]
pub fn maximum_likelihood<E: From<EstimationError>>(
    names: &[String],
    settings: &MaximumLikelihoodSettings,
    mut pass: impl FnMut(&mut InstantVisitor<'_>) -> Result<(), E>,
) -> Result<MaximumLikelihoodEstimate, E> {
    settings.validate()?;
    let columns = names.len();
    let mut theta = DVector::zeros(columns);
    let mut now = gathered(columns, settings, &theta, &mut pass)?;
    let rows = now.triangle.rows();
    if rows == 0 {
        return Err(EstimationError::Empty.into());
    }
    let choice = split(&now.triangle, &settings.rank, &Unexcited::default());
    let free = choice.free.len();
    if rows <= free {
        let what = "all joints".to_owned();
        return Err(EstimationError::TooFewRows { what, rows, parameters: free as f64 }.into());
    }
    let fallback = vec![0.0; columns];
    let (mut iterations, mut converged) = (0, false);
    while !converged && iterations < settings.max_iterations {
        iterations += 1;
        let goal = DVector::from_vec(solve(&now.triangle, &choice, &settings.rank, &fallback).values);
        let step = goal - &theta;
        let length = (now.triangle.regressor_triangle() * &step).norm() / (free.max(1) as f64).sqrt();
        converged = length <= settings.tolerance;
        let mut share = 1.0;
        let mut better = None;
        while better.is_none() && share > 1.0e-6 {
            let candidate = &theta + &step * share;
            let found = gathered(columns, settings, &candidate, &mut pass)?;
            // At the minimum costs differ by rounding.
            if found.cost <= now.cost * (1.0 + 1.0e-12) {
                better = Some((candidate, found));
            }
            share *= 0.5;
        }
        let Some((candidate, found)) = better else { break };
        (theta, now) = (candidate, found);
    }
    let solution = solve(&now.triangle, &choice, &settings.rank, &fallback);
    let small = &solution.inverse * solution.inverse.transpose();
    let (covariance, std) = covariance_of_all(names, &theta, &choice.free, &small)?;
    let rank = report(&now.triangle, &choice, &settings.rank, names, &fallback);
    Ok(MaximumLikelihoodEstimate {
        names: names.to_vec(),
        values: theta.iter().copied().collect(),
        covariance,
        std,
        cost: now.cost,
        degrees_of_freedom: rows - free,
        iterations,
        status: EstimateStatus::of(converged, &rank),
        rank,
    })
}

impl MaximumLikelihoodSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`EstimationError::Setting`], [`EstimationError::Mismatch`] for a matrix that is not square.
    pub fn validate(&self) -> Result<(), EstimationError> {
        self.rank.validate()?;
        covariance("motion_covariance", &self.motion_covariance, false)?;
        covariance("torque_covariance", &self.torque_covariance, true)?;
        within("tolerance", self.tolerance, 1.0e-12..=1.0, "use a length in error bars from 1e-12 to 1")?;
        require(self.max_iterations > 0, "max_iterations", 0.0, "use at least 1")
    }
}

fn covariance(setting: &'static str, matrix: &DMatrix<f64>, definite: bool) -> Result<(), EstimationError> {
    expect(&format!("columns of {setting}"), matrix.nrows(), matrix.ncols())?;
    let largest = matrix.amax();
    let symmetric = (matrix - matrix.transpose()).amax() <= 1.0e-9 * largest;
    let finite = matrix.iter().all(|value| value.is_finite());
    let least = if finite && matrix.nrows() > 0 { matrix.symmetric_eigenvalues().min() } else { 0.0 };
    let enough = if definite { least > 1.0e-14 * largest && largest > 0.0 } else { least >= -1.0e-9 * largest };
    if finite && symmetric && enough {
        return Ok(());
    }
    let fix = "use a finite, symmetric, positive semidefinite matrix (positive definite for the torque)";
    Err(EstimationError::Setting { setting, value: least, fix })
}

/// Rows `L⁻¹ [W̃ | r + W̃ θ]` with `S = L Lᵀ`, and the cost at θ.
fn gathered<E: From<EstimationError>>(
    columns: usize,
    settings: &MaximumLikelihoodSettings,
    theta: &DVector<f64>,
    pass: &mut impl FnMut(&mut InstantVisitor<'_>) -> Result<(), E>,
) -> Result<PassSums, E> {
    let joints = settings.torque_covariance.nrows();
    let mut triangle = TriangularFactor::new(columns);
    let mut workspace = FactorWorkspace::default();
    let mut cost = 0.0;
    let mut panel = Vec::with_capacity(joints * (columns + 1));
    let mut visit = |instant: &InstantRows<'_>| -> Result<(), EstimationError> {
        expect("joints of an instant", joints, instant.torque.len())?;
        expect("variables of the motion", settings.motion_covariance.nrows(), instant.regressor_by_motion.len())?;
        for matrix in std::iter::once(instant.regressor).chain(instant.regressor_by_motion) {
            expect("joints of an instant's regressor", joints, matrix.nrows())?;
            expect("columns of an instant's regressor", columns, matrix.ncols())?;
        }
        let slopes = DMatrix::from_columns(
            &instant.regressor_by_motion.iter().map(|by| -(by * theta)).collect::<Vec<DVector<f64>>>(),
        );
        let slopes = if instant.regressor_by_motion.is_empty() { DMatrix::zeros(joints, 0) } else { slopes };
        let residual = instant.torque - instant.regressor * theta;
        let spread = &slopes * &settings.motion_covariance;
        let total = &spread * slopes.transpose() + &settings.torque_covariance;
        let Some(factor): Option<Cholesky<f64, Dyn>> = total.cholesky() else {
            return Err(EstimationError::Setting {
                setting: "torque_covariance",
                value: settings.torque_covariance.diagonal().min(),
                fix: "the covariances of torque and motion differ by too many powers of ten: check units",
            });
        };
        let error = spread.tr_mul(&factor.solve(&residual));
        let mut corrected = instant.regressor.clone();
        for (by, &amount) in instant.regressor_by_motion.iter().zip(&error) {
            corrected -= by * amount;
        }
        let mut right = &residual + &corrected * theta;
        let mut plain = residual;
        let lower = factor.l_dirty();
        // The diagonal of a Cholesky factor is positive.
        let _ = lower.solve_lower_triangular_mut(&mut corrected);
        let _ = lower.solve_lower_triangular_mut(&mut right);
        let _ = lower.solve_lower_triangular_mut(&mut plain);
        cost += plain.norm_squared();
        panel.clear();
        panel.extend(corrected.iter().chain(right.iter()));
        triangle.absorb_with(&mut workspace, &panel, joints)
    };
    pass(&mut visit)?;
    Ok(PassSums { triangle, cost })
}
