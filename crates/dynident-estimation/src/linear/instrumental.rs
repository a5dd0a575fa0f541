//! Instrumental variables: estimates that are not biased towards zero by noise in the regressor.

use super::projection::Projection;
use super::weighted::{WeightedSettings, noise_change, noise_of_joints};
use crate::error::{EstimationError, require};
use crate::factor::{FactorWorkspace, InstrumentedProblem, RankSettings, Split, TriangularFactor, solve, split};
use crate::uncertainty::{CovarianceMethod, Estimate, PointEstimate, joint_degrees_of_freedom};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Settings of [`instrumental_variables`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct InstrumentalSettings {
    /// Criteria for an excited column, for the part of the regressor that the instruments explain.
    pub rank: RankSettings,
    /// Method of the reported covariance; from time segments by default.
    pub covariance: CovarianceMethod,
    /// The iteration of the weights ends when no joint's σ changes by more than this share. Default 1e-6.
    pub tolerance: f64,
    /// Maximum number of solutions. Default 50.
    pub max_iterations: usize,
    /// The instruments are weak if the first-stage F is below this value. Default 10, the rule of thumb of Staiger
    /// and Stock, Econometrica 65 (1997) 557.
    pub weak_below: f64,
}

impl Default for InstrumentalSettings {
    fn default() -> Self {
        Self {
            rank: RankSettings::default(),
            covariance: CovarianceMethod::default(),
            tolerance: 1.0e-6,
            max_iterations: 50,
            weak_below: 10.0,
        }
    }
}

impl InstrumentalSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`EstimationError::Setting`] for a tolerance outside 1e-12 to 1, zero iterations, a limit of F that is not
    /// positive, or rank settings out of range.
    pub fn validate(&self) -> Result<(), EstimationError> {
        let (rank, covariance) = (self.rank, self.covariance);
        let (tolerance, max_iterations) = (self.tolerance, self.max_iterations);
        WeightedSettings { rank, covariance, tolerance, max_iterations }.validate()?;
        let fix = "use a positive limit for the first-stage F (default 10)";
        require(self.weak_below.is_finite() && self.weak_below > 0.0, "weak_below", self.weak_below, fix)
    }
}

/// Strength of the instruments.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct InstrumentReport {
    /// Number of independent instruments.
    pub instruments: usize,
    /// Columns that contain noise which the instruments do not explain. All other columns are explained completely
    /// and are their own instruments.
    pub noisy_columns: Vec<String>,
    /// Smallest first-stage F over all directions in the noisy columns (Cragg-Donald): `λ_min(Σ_V⁻¹ W̃ᵀW̃) / k` with
    /// `Σ_V = VᵀV/(N − k)`, k instruments, N rows, other columns projected out. `None` without noisy columns.
    pub weakest_f: Option<f64>,
    /// The noisy column with the largest component in the direction of the smallest F, in units of its noise.
    pub weakest_column: Option<String>,
    /// Whether the smallest F is below the limit: the estimate is then biased towards least squares and its error bars
    /// are too small.
    pub weak: bool,
}

/// Result of [`instrumental_variables`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct InstrumentalEstimate {
    /// Values with covariance; `joint_sigma` is that of `τ − W θ`, including noise of W.
    pub estimate: Estimate,
    /// Strength of the instruments in the first stage.
    pub instruments: InstrumentReport,
}

/// A column is noisy if the share that the instruments do not explain exceeds this value; rounding is far smaller.
pub(crate) const MIN_NOISE_SHARE: f64 = 1.0e-7;

/// `θ = (Σ_j Z_jᵀW_j/σ_j²)⁻¹ Σ_j Z_jᵀτ_j/σ_j²`, with `σ_j² = ‖τ_j − W_j θ‖²/(N_j − p/n)` iterated from one as in
/// weighted least squares.
///
/// Solved in two stages from the triangle of `[Z | W | τ]`: `θ = argmin ‖Q_Zᵀτ − Q_ZᵀW θ‖`. With as many independent
/// instruments as estimated columns, this equals the formula above. With more instruments it is two-stage least
/// squares.
/// The estimate is consistent if Z is uncorrelated with the noise of W and τ, whereas least squares is biased towards
/// zero. The covariance is the sandwich `A⁻¹ (Σ_g s_g s_gᵀ) A⁻¹` with `A = W̃ᵀW̃`, `s_g = W̃_gᵀ(τ_g − W_g θ)`, `W̃ =
/// Z(ZᵀZ)⁻¹ZᵀW`, or its delete-one-segment form.
///
/// For instruments simulated with the current model (IDIM-IV) repeat the call with new Z until θ converges. Janot,
/// Vandanjon and Gautier, IEEE Trans. Control Syst. Technol. 22 (2014) 132; weak instruments: Cragg and Donald,
/// Econometric Theory 9 (1993) 222.
///
/// # Errors
/// As [`weighted_least_squares`](crate::weighted_least_squares). Columns that the instruments do not distinguish are
/// fixed and listed in the rank report; weak instruments are reported. Neither is an error.
#[doc(alias("iv", "idim-iv", "2sls", "tsls"))]
pub fn instrumental_variables(
    problem: &InstrumentedProblem,
    settings: &InstrumentalSettings,
) -> Result<InstrumentalEstimate, EstimationError> {
    settings.validate()?;
    let stacked = problem.rows.stacked();
    let mut weights = vec![1.0; problem.joints().len()];
    let mut projection = Projection::new(problem, &stacked, &weights, &settings.rank)?;
    let choice = split(&projection.explained, &settings.rank, problem.unexcited());
    let degrees_of_freedom = joint_degrees_of_freedom(&stacked, choice.free.len())?;
    let mut solution = solve(&projection.explained, &choice, &settings.rank, problem.fallback());
    let mut joint_sigma;
    let (mut iterations, mut converged) = (1, false);
    loop {
        let (squares, torque) = stacked.joint_squares(&problem.over_both(&solution.values))?;
        joint_sigma = noise_of_joints(&squares, &torque, &degrees_of_freedom);
        if iterations > 1 {
            converged = noise_change(&joint_sigma, &weights) <= settings.tolerance;
        }
        if converged || iterations == settings.max_iterations {
            break;
        }
        for (weight, sigma) in weights.iter_mut().zip(&joint_sigma) {
            *weight = 1.0 / sigma;
        }
        projection = Projection::new(problem, &stacked, &weights, &settings.rank)?;
        solution = solve(&projection.explained, &choice, &settings.rank, problem.fallback());
        iterations += 1;
    }
    let instruments = report(problem, &projection, &choice, settings);
    // Least squares of τ − V θ on W̃ has the same solution and the residual τ − W θ, and therefore the sandwich
    // covariance of the instrumental estimate.
    let theta = DVector::from_column_slice(&solution.values);
    let second = problem.combined(problem.columns().to_vec(), problem.fallback().to_vec(), |local| {
        let (fitted, left) = projection.parts(local);
        let mut rows = DMatrix::zeros(fitted.nrows(), fitted.ncols() + 1);
        rows.view_mut((0, 0), fitted.shape()).copy_from(&fitted);
        let mut torque = -(left * &theta);
        torque[2 * local.len()] += 1.0;
        rows.set_column(fitted.ncols(), &torque);
        rows
    })?;
    let second = second.stacked();
    let estimate = PointEstimate {
        triangle: projection.explained,
        split: choice,
        solution,
        weights,
        joint_sigma,
        weighted_variance: 1.0,
        iterations,
        converged,
    }
    .into_estimate(&second, &settings.rank, settings.covariance)?;
    Ok(InstrumentalEstimate { estimate, instruments })
}

/// Free columns that the instruments do not explain completely.
pub(crate) fn noisy_columns(projection: &Projection, free: &[usize]) -> Vec<usize> {
    let (explained, left) = (projection.explained.column_norms(), projection.left.column_norms());
    free.iter()
        .copied()
        .filter(|&column| left[column] > MIN_NOISE_SHARE * explained[column].hypot(left[column]))
        .collect()
}

fn report(
    problem: &InstrumentedProblem,
    projection: &Projection,
    choice: &Split,
    settings: &InstrumentalSettings,
) -> InstrumentReport {
    let noisy = noisy_columns(projection, &choice.free);
    let k = projection.instruments;
    let name = |column: usize| problem.columns()[column].clone();
    let mut report = InstrumentReport {
        instruments: k,
        noisy_columns: noisy.iter().map(|&column| name(column)).collect(),
        weakest_f: None,
        weakest_column: None,
        weak: false,
    };
    let rows = projection.left.rows();
    if noisy.is_empty() || rows <= k {
        return report;
    }
    // Explained part of the noisy columns with all others projected out: the last rows of a triangle with the others
    // first.
    let others: Vec<usize> = choice.free.iter().copied().filter(|column| !noisy.contains(column)).collect();
    let order: Vec<usize> = others.iter().chain(&noisy).copied().collect();
    let reordered = |source: &TriangularFactor, order: &[usize]| {
        let mut factor = TriangularFactor::new(order.len());
        factor.absorb_entries(&mut FactorWorkspace::default(), source.columns(), |row, column| {
            order.get(column).map_or(0.0, |&column| source.entry(row, column))
        });
        factor.regressor_triangle()
    };
    let (first, count) = (others.len(), noisy.len());
    let explained = reordered(&projection.explained, &order).view((first, first), (count, count)).into_owned();
    let left = reordered(&projection.left, &noisy);
    let scales: Vec<f64> = left.column_iter().map(|column| column.norm()).collect();
    let scaled =
        |matrix: DMatrix<f64>| DMatrix::from_fn(count, count, |row, column| matrix[(row, column)] / scales[column]);
    let (explained, left) = (scaled(explained), scaled(left));
    // The smallest σ of E V⁻¹ is the reciprocal of the largest of V E⁻¹; E is regular, because its columns are
    // independent.
    let Some(inverse) = explained.clone().try_inverse() else { return report };
    let decomposition = (left * &inverse).svd(false, true);
    let (Some(largest), Some(right)) =
        (decomposition.singular_values.iter().copied().reduce(f64::max), decomposition.v_t)
    else {
        return report;
    };
    if !(largest.is_finite() && largest > 0.0) {
        return report;
    }
    let f = (rows - k) as f64 / k as f64 / (largest * largest);
    let place = decomposition.singular_values.imax();
    let direction = &inverse * right.row(place).transpose();
    report.weakest_f = Some(f);
    report.weakest_column = Some(name(noisy[direction.icamax()]));
    report.weak = f < settings.weak_below;
    report
}
