//! Weighted least squares with some parameters known from other data, including their error bars.

use super::weighted::{WeightedSettings, weighted_least_squares};
use crate::error::{EstimationError, expect};
use crate::factor::LinearProblem;
use crate::uncertainty::{Estimate, student_half_width};
use nalgebra::{DMatrix, DVector};

/// Known values of some columns, from other data.
#[derive(Clone, Debug, PartialEq)]
pub struct KnownColumns {
    /// Indices of the known columns in the problem.
    pub columns: Vec<usize>,
    /// Known values of these columns.
    pub values: Vec<f64>,
    /// Covariance of the values in the same order; zero for exact values.
    pub covariance: DMatrix<f64>,
}

/// Estimates the unknown columns: `θ_u = argmin Σ_j ‖τ_j − W_k θ_k − W_u θ_u‖² / σ_j²`.
///
/// The data do not change the known values; the errors of the known values are included in the error bars of the
/// other columns:
///
/// ```text
///     V_u = V_own + G V_k Gᵀ,   cov(θ_u, θ_k) = G V_k,
///     G = ∂θ_u/∂θ_k = −(W_uᵀ Ω W_u)⁻¹ W_uᵀ Ω W_k,   Ω = diag(1/σ_j²)
/// ```
///
/// `V_own` is the covariance from these data by the chosen method. Valid if the known values come from other data. The
/// residual also contains `W_k` times their error, so `V_own` includes part of it twice: the error bars are
/// conservative. The estimate has all columns of the problem; `rank` covers the unknown ones. Murphy and Topel, J.
/// Business and Economic Statistics 3 (1985) 370 (two-step estimation, independent steps).
///
/// ```
/// use dynident_estimation::*;
/// use nalgebra::DMatrix;
/// // τ = 2 x + 3 ± 0.1 with known slope 2 ± 0.5. The mean of x is 1.5: offset uncertainty 1.5 · 0.5.
/// let mut rows = SegmentedFactor::new(2, SegmentSettings { max_segments: 8, first_length_rows: 1 })?;
/// rows.absorb(&[0., 1., 2., 3., 1., 1., 1., 1., 3.1, 4.9, 7.1, 8.9], 4)?;
/// let mut problem = LinearProblem::new(vec!["slope".into(), "offset".into()], vec!["joint1".into()]);
/// problem.add("run", 0, vec![0, 1], rows)?;
/// let known = KnownColumns { columns: vec![0], values: vec![2.0], covariance: DMatrix::from_element(1, 1, 0.25) };
/// let estimate = weighted_least_squares_with_known(&problem, &known, &WeightedSettings::default())?;
/// assert!((estimate.values[1] - 3.0).abs() < 1e-9 && (estimate.std[1] - 0.75).abs() < 0.01);
/// # Ok::<(), EstimationError>(())
/// ```
///
/// # Errors
/// [`EstimationError::Mismatch`] for wrong sizes, duplicate columns, no unknown column, or a problem with a prior;
/// [`EstimationError::Setting`] for values that are not finite; and as [`weighted_least_squares`].
#[doc(alias("payload"))]
pub fn weighted_least_squares_with_known(
    problem: &LinearProblem,
    known: &KnownColumns,
    settings: &WeightedSettings,
) -> Result<Estimate, EstimationError> {
    check(problem, known)?;
    let count = problem.columns().len();
    let mut value = vec![None; count];
    for (&column, &known) in known.columns.iter().zip(&known.values) {
        value[column] = Some(known);
    }
    let free: Vec<usize> = (0..count).filter(|&column| value[column].is_none()).collect();
    let place = |column: usize| free.iter().position(|&c| c == column);
    let names = free.iter().map(|&column| problem.columns()[column].clone()).collect();
    let mut rest = LinearProblem::new(names, problem.joints().to_vec())
        .with_fallback(free.iter().map(|&column| problem.fallback()[column]).collect())?
        .with_unexcited(problem.unexcited().renumbered(place))?;
    for equation in problem.equations() {
        let columns: Vec<usize> = equation.columns.iter().filter_map(|&column| place(column)).collect();
        let mut map = DMatrix::zeros(equation.columns.len() + 1, columns.len() + 1);
        let mut next = 0;
        for (local, &column) in equation.columns.iter().enumerate() {
            if let Some(known) = value[column] {
                map[(local, columns.len())] = -known;
            } else {
                map[(local, next)] = 1.0;
                next += 1;
            }
        }
        map[(equation.columns.len(), columns.len())] = 1.0;
        rest.add(&problem.logs()[equation.log], equation.joint, columns, equation.factor.mapped(&map)?)?;
    }
    let own = weighted_least_squares(&rest, settings)?;
    let sensitivity = sensitivity(problem, known, &free, &own)?;
    Ok(joined(problem, known, &free, own, &sensitivity))
}

fn check(problem: &LinearProblem, known: &KnownColumns) -> Result<(), EstimationError> {
    let count = problem.columns().len();
    expect("values of known columns", known.columns.len(), known.values.len())?;
    expect("rows of the known columns' covariance", known.columns.len(), known.covariance.nrows())?;
    expect("columns of the known columns' covariance", known.columns.len(), known.covariance.ncols())?;
    if problem.prior().is_some() {
        let what = "priors in addition to known columns (use one of them)".into();
        return Err(EstimationError::Mismatch { what, expected: 0, found: 1 });
    }
    let mut seen = vec![false; count];
    for &column in &known.columns {
        if column >= count || std::mem::replace(&mut seen[column], true) {
            let what = "known column, below the number of columns and not duplicate".into();
            return Err(EstimationError::Mismatch { what, expected: count, found: column });
        }
    }
    if seen.iter().all(|&known| known) {
        let what = "known columns, fewer than all".into();
        return Err(EstimationError::Mismatch { what, expected: count.saturating_sub(1), found: count });
    }
    match known.values.iter().chain(known.covariance.iter()).find(|value| !value.is_finite()) {
        Some(&value) => {
            Err(EstimationError::Setting { setting: "known columns", value, fix: "use finite values and covariance" })
        }
        None => Ok(()),
    }
}

/// G, the sensitivity of the free to the known columns, shape (free columns, known columns); zero rows for unexcited
/// columns.
fn sensitivity(
    problem: &LinearProblem,
    known: &KnownColumns,
    free: &[usize],
    own: &Estimate,
) -> Result<DMatrix<f64>, EstimationError> {
    let weights: Vec<f64> = own.joint_sigma.iter().map(|sigma| 1.0 / sigma).collect();
    let triangle = problem.combined(&weights)?.regressor_triangle();
    let determined: Vec<usize> =
        (0..free.len()).filter(|place| own.rank.fixed.iter().all(|fixed| fixed.column != *place)).collect();
    let columns: Vec<usize> = determined.iter().map(|&place| free[place]).collect();
    let mut own_rows = triangle.select_columns(&columns);
    let norms: Vec<f64> = own_rows.column_iter().map(|column| column.norm()).collect();
    for (mut column, norm) in own_rows.column_iter_mut().zip(&norms) {
        column /= if *norm > 0.0 { *norm } else { 1.0 };
    }
    let factor = own_rows.qr();
    let (q, r) = (factor.q(), factor.r());
    let mut solved = q.tr_mul(&triangle.select_columns(&known.columns));
    // The columns are independent, so the diagonal of the triangle has no zero.
    if !r.solve_upper_triangular_mut(&mut solved) {
        return Err(EstimationError::Overflow { name: problem.columns()[free[0]].clone() });
    }
    let mut sensitivity = DMatrix::zeros(free.len(), known.columns.len());
    for (row, (&place, norm)) in determined.iter().zip(&norms).enumerate() {
        sensitivity.set_row(place, &(-solved.row(row) / *norm));
    }
    Ok(sensitivity)
}

fn joined(
    problem: &LinearProblem,
    known: &KnownColumns,
    free: &[usize],
    own: Estimate,
    sensitivity: &DMatrix<f64>,
) -> Estimate {
    let count = problem.columns().len();
    let carried = sensitivity * &known.covariance * sensitivity.transpose();
    let cross = sensitivity * &known.covariance;
    let spread = |rest: &DMatrix<f64>| {
        let mut all = DMatrix::zeros(count, count);
        for (i, &row) in free.iter().enumerate() {
            for (j, &column) in free.iter().enumerate() {
                all[(row, column)] = rest[(i, j)] + 0.5 * (carried[(i, j)] + carried[(j, i)]);
            }
            for (j, &column) in known.columns.iter().enumerate() {
                all[(row, column)] = cross[(i, j)];
                all[(column, row)] = cross[(i, j)];
            }
        }
        for (i, &row) in known.columns.iter().enumerate() {
            for (j, &column) in known.columns.iter().enumerate() {
                all[(row, column)] = known.covariance[(i, j)];
            }
        }
        all
    };
    let (covariance, covariance_white) = (spread(&own.covariance), spread(&own.covariance_white));
    let std: Vec<f64> = DVector::from(covariance.diagonal()).iter().map(|variance| variance.max(0.0).sqrt()).collect();
    let normal = student_half_width(0.95, f64::INFINITY);
    let (mut values, mut half_width_95) = (vec![0.0; count], vec![0.0; count]);
    let mut std_degrees_of_freedom = vec![f64::INFINITY; count];
    for (&column, &value) in known.columns.iter().zip(&known.values) {
        (values[column], half_width_95[column]) = (value, normal * std[column]);
    }
    for (place, &column) in free.iter().enumerate() {
        values[column] = own.values[place];
        half_width_95[column] = own.half_width_95[place].hypot(normal * carried[(place, place)].max(0.0).sqrt());
        std_degrees_of_freedom[column] = own.std_degrees_of_freedom[place];
    }
    let mut rank = own.rank;
    for fixed in &mut rank.fixed {
        fixed.column = free[fixed.column];
    }
    let relative = |(std, value): (&f64, &f64)| (*std > 0.0 && *value != 0.0).then(|| 100.0 * std / value.abs());
    Estimate {
        names: problem.columns().to_vec(),
        relative_std_percent: std.iter().zip(&values).map(relative).collect(),
        values,
        covariance,
        covariance_white,
        noise_std: std.clone(),
        std,
        std_degrees_of_freedom,
        half_width_95,
        rank,
        ..own
    }
}
