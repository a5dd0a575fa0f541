//! Total least squares: errors of known size in the columns as well as in the torque.

use crate::error::{EstimationError, expect};
use crate::factor::{
    FactorWorkspace, LinearProblem, RankSettings, Split, StackedProblem, TriangularFactor, solve, split,
};
use crate::uncertainty::{CovarianceMethod, Estimate, Fitted, joint_freedom, student_half_width};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Settings of [`total_least_squares`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TotalSettings {
    /// Standard deviation of the error in each column, in its own unit; zero for a column that is known exactly (an
    /// offset). Where joints differ in `torque_std` this is the error in the rows of the joint with the largest; that
    /// of the others is smaller in proportion.
    pub column_std: Vec<f64>,
    /// Standard deviation of the error in each joint's torque, N m (N); positive. Only ratios to `column_std` matter.
    pub torque_std: Vec<f64>,
    /// When a column counts as excited.
    #[serde(default)]
    pub rank: RankSettings,
    /// `White`, or by time segments for any other choice: the estimate cannot be made without a segment from that
    /// segment's triangle alone.
    #[serde(default)]
    pub covariance: CovarianceMethod,
}

impl TotalSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`EstimationError::Setting`] for a standard deviation or rank settings out of range.
    pub fn validate(&self) -> Result<(), EstimationError> {
        self.rank.validate()?;
        if let Some(&value) = self.column_std.iter().find(|std| !(std.is_finite() && **std >= 0.0)) {
            let mend = "give a finite standard deviation, 0 for an exact column";
            return Err(EstimationError::Setting { setting: "column_std", value, mend });
        }
        if let Some(&value) = self.torque_std.iter().find(|std| !(std.is_finite() && **std > 0.0)) {
            let mend = "give a finite standard deviation above 0";
            return Err(EstimationError::Setting { setting: "torque_std", value, mend });
        }
        Ok(())
    }
}

/// What [`total_least_squares`] found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TotalEstimate {
    /// Values with covariance; `joint_sigma` is that of `τ − W θ`.
    pub estimate: Estimate,
    /// By how much all the errors given are too small (below one: too large) for what is left: `√(λ/(N − p))`.
    pub error_scale: f64,
}

/// ```text
///     min ‖[ΔW D⁻¹ | Δτ]‖²  with  (W + ΔW) θ = τ + Δτ
/// ```
///
/// with D of `column_std` over `torque_std`. Exact columns are taken out by the triangle; the smallest singular value
/// √λ of what is left of `[W D⁻¹ | τ]` and its right vector give the others, which is mixed least squares and total
/// least squares. Equivalently `(WᵀW − λD²) θ = Wᵀτ`. Consistent where D is right: Golub and Van Loan, SIAM J. Numer.
/// Anal. 17 (1980) 883; Van Huffel and Vandewalle, The Total Least Squares Problem (1991), 3.5. Covariance: `H⁻¹ (Σ_g
/// s_g s_gᵀ) H⁻¹` with `H = WᵀW − λD²`, `s_g = W_gᵀe_g + D²θ ‖e_g‖²/(1 + θᵀD²θ)`, `e = τ − W θ` (Fuller, Measurement
/// Error Models (1987), 2.3); white: `σ_e² H⁻¹ WᵀW H⁻¹`.
///
/// Errors are taken to be independent between columns; those of q̇ and q̈ made from one position are not, and
/// instruments are the better cure for them.
///
/// # Errors
/// As [`ordinary_least_squares`](crate::ordinary_least_squares); [`EstimationError::Setting`] for a standard deviation
/// out of range; [`EstimationError::NoTotalSolution`] when the errors given are as large as a column itself, so that
/// nothing is left to estimate from.
///
/// ```
/// use dynident_estimation::*;
/// // w = x ± 1 and τ = 2 x ± 1, errors of one size that have nothing to do with x or each other.
/// let x: Vec<f64> = (0..256).map(|k| f64::from(k / 16) - 7.5).collect();
/// let sign = |k: usize, bit: usize| if (k >> bit) % 2 == 0 { 1.0 } else { -1.0 };
/// let w: Vec<f64> = (0..256).map(|k| x[k] + sign(k, 0)).collect();
/// let tau: Vec<f64> = (0..256).map(|k| 2.0 * x[k] + sign(k, 1)).collect();
/// let mut rows = SegmentedFactor::new(1, SegmentSettings { max_segments: 16, first_length_rows: 16 })?;
/// rows.absorb(&[w, tau].concat(), 256)?;
/// let mut problem = LinearProblem::new(vec!["gain".into()], vec!["joint1".into()]);
/// problem.add("run", 0, vec![0], rows)?;
/// let settings = TotalSettings {
///     column_std: vec![1.0],
///     torque_std: vec![1.0],
///     rank: RankSettings::default(),
///     covariance: CovarianceMethod::Segments,
/// };
/// let found = total_least_squares(&problem, &settings)?;
/// assert!((found.estimate.values[0] - 2.0).abs() < 1e-9);
/// assert!((found.error_scale - 1.0).abs() < 0.01);
/// # Ok::<(), EstimationError>(())
/// ```
#[doc(alias("tls", "errors in variables", "eiv"))]
pub fn total_least_squares(
    problem: &LinearProblem,
    settings: &TotalSettings,
) -> Result<TotalEstimate, EstimationError> {
    check(problem, settings)?;
    let stacked = problem.stacked();
    let reference = settings.torque_std.iter().copied().fold(0.0, f64::max);
    let weights: Vec<f64> = settings.torque_std.iter().map(|std| reference / std).collect();
    let triangle = stacked.combined(&weights)?;
    let choice = split(&triangle, &settings.rank);
    let freedom = joint_freedom(&stacked, choice.free.len())?;
    let mut solution = solve(&triangle, &choice, &settings.rank, problem.fallback());
    let d: Vec<f64> = settings.column_std.iter().map(|std| std / reference).collect();
    let lambda = total_solution(&triangle, &choice, &d, &mut solution.values)?;
    let (squares, _) = stacked.joint_squares(&solution.values)?;
    let joint_sigma = squares.iter().zip(&freedom).map(|(square, freedom)| (square / freedom).sqrt()).collect();
    let rows = triangle.rows();
    let degrees = (rows - choice.free.len()) as f64;
    let information = choice_of(&triangle, &choice, |row, column| triangle.entry(row, column));
    let bent = information.tr_mul(&information)
        - DMatrix::from_diagonal(&DVector::from_iterator(
            choice.free.len(),
            choice.free.iter().map(|&c| lambda * d[c] * d[c]),
        ));
    let inverse = bent.cholesky().ok_or(EstimationError::NoTotalSolution)?.inverse();
    let spread = 1.0 + solution.values.iter().zip(&d).map(|(theta, d)| (theta * d).powi(2)).sum::<f64>();
    let inner = scores(&stacked, &choice, &weights, &solution.values, &d, spread)?;
    let values = solution.values.clone();
    let free = choice.free.clone();
    let white = settings.covariance == CovarianceMethod::White;
    let method = if white { CovarianceMethod::White } else { CovarianceMethod::Segments };
    let fitted = Fitted {
        triangle,
        split: choice,
        solution,
        weights,
        joint_sigma,
        weighted_variance: lambda * spread / degrees,
        iterations: 1,
        converged: true,
    };
    let mut estimate = fitted.into_estimate(&stacked, &settings.rank, method)?;
    let (g, n) = (estimate.clusters as f64, rows as f64);
    let small_sample = if white { 1.0 } else { g / (g - 1.0) * (n - 1.0) / degrees };
    let by_segments = &inverse * inner * &inverse * small_sample;
    let by_rows = &inverse * information.tr_mul(&information) * &inverse * (lambda * spread / degrees);
    for (i, &row) in free.iter().enumerate() {
        for (j, &column) in free.iter().enumerate() {
            estimate.covariance_white[(row, column)] = by_rows[(i, j)];
            estimate.covariance[(row, column)] = if white { by_rows[(i, j)] } else { by_segments[(i, j)] };
        }
        let std = estimate.covariance[(row, row)].max(0.0).sqrt();
        if !(std.is_finite() && values[row].is_finite()) {
            return Err(EstimationError::Overflow { name: problem.columns()[row].clone() });
        }
        estimate.std[row] = std;
        estimate.half_width_95[row] = student_half_width(0.95, estimate.std_freedom[row]) * std;
        estimate.relative_std_percent[row] = (std > 0.0 && values[row] != 0.0).then(|| 100.0 * std / values[row].abs());
    }
    Ok(TotalEstimate { estimate, error_scale: (lambda / degrees).sqrt() / reference })
}

fn check(problem: &LinearProblem, settings: &TotalSettings) -> Result<(), EstimationError> {
    settings.validate()?;
    expect("standard deviations of columns", problem.columns().len(), settings.column_std.len())?;
    expect("standard deviations of torque", problem.joints().len(), settings.torque_std.len())?;
    if problem.prior().is_some() {
        return Err(EstimationError::PriorWithoutNoiseLevel);
    }
    Ok(())
}

/// The free columns of a triangle.
fn choice_of(triangle: &TriangularFactor, choice: &Split, entry: impl Fn(usize, usize) -> f64) -> DMatrix<f64> {
    DMatrix::from_fn(triangle.columns(), choice.free.len(), |row, k| entry(row, choice.free[k]))
}

/// Puts the solution for the free columns into `values` (fixed ones are there already) and gives λ.
fn total_solution(
    triangle: &TriangularFactor,
    choice: &Split,
    d: &[f64],
    values: &mut [f64],
) -> Result<f64, EstimationError> {
    let (exact, uncertain): (Vec<usize>, Vec<usize>) = choice.free.iter().partition(|column| d[**column] == 0.0);
    let order: Vec<usize> = exact.iter().chain(&uncertain).copied().collect();
    let norms = triangle.column_norms();
    let scale = |column: usize| if d[column] == 0.0 { norms[column] } else { d[column] };
    let (size, count, first) = (triangle.columns(), order.len(), exact.len());
    let mut known = values.to_vec();
    for &column in &order {
        known[column] = 0.0;
    }
    let torque = triangle.residual(&known);
    let rho = triangle.entry(size, size);
    let mut ordered = TriangularFactor::new(count);
    ordered.absorb_entries(&mut FactorWorkspace::default(), size + 1, |row, column| {
        match (order.get(column), row < size) {
            (Some(&source), true) => triangle.entry(row, source) / scale(source),
            (Some(_), false) => 0.0,
            (None, true) => torque[row],
            (None, false) => rho,
        }
    });
    let left = uncertain.len();
    let corner = DMatrix::from_fn(left + 1, left + 1, |row, column| ordered.entry(first + row, first + column));
    let decomposition = corner.svd(false, true);
    let right = decomposition.v_t.ok_or(EstimationError::NoTotalSolution)?;
    let place = decomposition.singular_values.imin();
    let (smallest, vector) = (decomposition.singular_values[place], right.row(place));
    // Without a part in the torque the errors explain a whole combination of columns.
    if vector[left].is_nan() || vector[left].abs() < 1.0e-8 {
        return Err(EstimationError::NoTotalSolution);
    }
    let mut solution = vec![0.0; count];
    for k in 0..left {
        solution[first + k] = -vector[k] / vector[left];
    }
    for row in (0..first).rev() {
        let sum: f64 = (row + 1..count).map(|column| ordered.entry(row, column) * solution[column]).sum();
        solution[row] = (ordered.entry(row, count) - sum) / ordered.entry(row, row);
    }
    for (value, &column) in solution.iter().zip(&order) {
        values[column] = value / scale(column);
    }
    Ok(smallest * smallest)
}

/// `Σ_g s_g s_gᵀ` over the free columns.
fn scores(
    stacked: &StackedProblem<'_>,
    choice: &Split,
    weights: &[f64],
    theta: &[f64],
    d: &[f64],
    spread: f64,
) -> Result<DMatrix<f64>, EstimationError> {
    let free = choice.free.len();
    let mut inner = DMatrix::zeros(free, free);
    for equation in stacked.problem.equations() {
        let square = weights[equation.joint].powi(2);
        let local = equation.local(theta);
        for segment in equation.factor.segment_factors() {
            let score = segment.score(&local) * square;
            let errors = segment.residual_sum_of_squares(&local)? * square;
            let sum = DVector::from_fn(free, |k, _| {
                let column = choice.free[k];
                let place = equation.columns.iter().position(|&c| c == column);
                place.map_or(0.0, |place| score[place]) + d[column] * d[column] * theta[column] * errors / spread
            });
            inner += &sum * sum.transpose();
        }
    }
    Ok(inner)
}
