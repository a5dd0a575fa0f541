//! Custom estimators: a function of the caller computes values from the rows `[W | τ]`.

use super::ordinary::OrdinarySettings;
use super::weighted::{WeightedSettings, weighted_values};
use crate::error::{EstimationError, expect};
use crate::factor::{LinearProblem, Solution, Split, solve, split};
use crate::uncertainty::{CovarianceMethod, Estimate, PointEstimate, joint_degrees_of_freedom, student_half_width};
use nalgebra::{DMatrix, DVector};

/// Input of a custom estimator: the rows of every joint, reduced to as many rows as columns plus one.
///
/// The rows are the triangular factors: for each joint and every θ, `‖τ - W θ‖²` and `Wᵀ(τ - W θ)` are equal to those
/// over all samples. Unexcited columns are excluded; their torque at the fallback values is subtracted from τ.
#[derive(Clone, Debug, PartialEq)]
pub struct EstimatorRows {
    /// Names of the columns.
    pub names: Vec<String>,
    /// Names of the joints.
    pub joints: Vec<String>,
    /// Regressor, one row for each entry of `torque`.
    pub regressor: DMatrix<f64>,
    /// Torque, Nm (N).
    pub torque: DVector<f64>,
    /// Joint number of each row.
    pub joint_of_row: Vec<usize>,
    /// Number of samples per joint before the reduction.
    pub samples: Vec<usize>,
    /// Noise σ_j of each joint by weighted least squares, Nm (N). Rows divided by σ_j have unit noise.
    pub joint_sigma: Vec<f64>,
}

/// Output of a custom estimator.
#[derive(Clone, Debug, PartialEq)]
pub struct CustomEstimate {
    /// One value for each column of the rows.
    pub values: Vec<f64>,
    /// Covariance of the values; if `None`, error bars are those of ordinary least squares with the residuals of
    /// `values`.
    pub covariance: Option<DMatrix<f64>>,
}

/// Estimates a problem with the custom `rule`; `name` appears in error messages.
///
/// # Errors
/// As [`ordinary_least_squares`](super::ordinary_least_squares); [`EstimationError::Own`] for values or a covariance
/// of the wrong size or not finite, and for a negative variance.
pub fn estimate_by(
    problem: &LinearProblem,
    settings: &OrdinarySettings,
    name: &str,
    rule: impl FnOnce(&EstimatorRows) -> CustomEstimate,
) -> Result<Estimate, EstimationError> {
    settings.validate()?;
    if problem.prior().is_some() {
        return Err(EstimationError::PriorWithoutNoiseLevel);
    }
    let stacked = problem.stacked();
    let joints = problem.joints().len();
    let weights = vec![1.0; joints];
    let triangle = stacked.combined(&weights)?;
    let split = split(&triangle, &settings.rank, problem.unexcited());
    let degrees_of_freedom = joint_degrees_of_freedom(&stacked, split.free.len())?;
    let mut solution = solve(&triangle, &split, &settings.rank, problem.fallback());

    let rows = estimator_rows(problem, settings, &split, &solution)?;
    let own = rule(&rows);
    check(name, &own, rows.names.len())?;
    for (&column, value) in split.free.iter().zip(&own.values) {
        solution.values[column] = *value;
    }

    let (squares, _) = stacked.joint_squares(&solution.values)?;
    let joint_sigma = squares.iter().zip(&degrees_of_freedom).map(|(square, f)| (square / f).sqrt()).collect();
    let weighted_variance = squares.iter().sum::<f64>() / (triangle.rows() - split.free.len()) as f64;
    let free = split.free.clone();
    let method = if own.covariance.is_some() { CovarianceMethod::White } else { settings.covariance };
    let point = PointEstimate {
        triangle,
        split,
        solution,
        weights,
        joint_sigma,
        weighted_variance,
        iterations: 1,
        converged: true,
    };
    let mut estimate = point.into_estimate(&stacked, &settings.rank, method)?;
    if let Some(covariance) = own.covariance {
        with_covariance(&mut estimate, &free, &covariance);
    }
    Ok(estimate)
}

/// Rows of the free columns by joint, minus the contribution of the held columns.
fn estimator_rows(
    problem: &LinearProblem,
    settings: &OrdinarySettings,
    split: &Split,
    solution: &Solution,
) -> Result<EstimatorRows, EstimationError> {
    let stacked = problem.stacked();
    let joints = problem.joints().len();
    let mut known = solution.values.clone();
    split.free.iter().for_each(|&column| known[column] = 0.0);
    let each = problem.columns().len() + 1;
    let mut regressor = DMatrix::zeros(joints * each, split.free.len());
    let mut torque = DVector::zeros(joints * each);
    for joint in 0..joints {
        let mut alone = vec![0.0; joints];
        alone[joint] = 1.0;
        let own = stacked.combined(&alone)?;
        // The last row has no regressor.
        torque[joint * each + each - 1] = own.entry(each - 1, each - 1);
        for (row, value) in own.residual(&known).iter().enumerate() {
            torque[joint * each + row] = *value;
            for (place, &column) in split.free.iter().enumerate() {
                regressor[(joint * each + row, place)] = own.entry(row, column);
            }
        }
    }
    let weighted = WeightedSettings { rank: settings.rank, ..WeightedSettings::default() };
    Ok(EstimatorRows {
        names: split.free.iter().map(|&column| problem.columns()[column].clone()).collect(),
        joints: problem.joints().to_vec(),
        regressor,
        torque,
        joint_of_row: (0..joints).flat_map(|joint| core::iter::repeat_n(joint, each)).collect(),
        samples: problem.joint_rows(),
        joint_sigma: weighted_values(problem, &weighted)?.joint_sigma,
    })
}

fn check(name: &str, own: &CustomEstimate, columns: usize) -> Result<(), EstimationError> {
    let wrong = |problem: String| EstimationError::Own { name: name.to_owned(), problem };
    expect("values of a caller's own estimator", columns, own.values.len())?;
    if let Some(place) = own.values.iter().position(|value| !value.is_finite()) {
        return Err(wrong(format!("value {place} is {}: use finite numbers", own.values[place])));
    }
    let Some(covariance) = &own.covariance else { return Ok(()) };
    if covariance.shape() != (columns, columns) {
        let (rows, found) = covariance.shape();
        return Err(wrong(format!("a covariance of shape ({rows}, {found}): use ({columns}, {columns})")));
    }
    if covariance.iter().any(|value| !value.is_finite()) {
        return Err(wrong("the covariance contains values that are not finite: use finite numbers".to_owned()));
    }
    if let Some(place) = (0..columns).find(|&k| covariance[(k, k)] < 0.0) {
        return Err(wrong(format!("variance {place} of the covariance is negative: use nonnegative variances")));
    }
    Ok(())
}

/// Error bars from the caller's covariance, for normally distributed errors.
fn with_covariance(estimate: &mut Estimate, free: &[usize], covariance: &DMatrix<f64>) {
    let normal = student_half_width(0.95, f64::INFINITY);
    estimate.clusters = 0;
    for (a, &i) in free.iter().enumerate() {
        for (b, &j) in free.iter().enumerate() {
            let value = 0.5 * (covariance[(a, b)] + covariance[(b, a)]);
            estimate.covariance[(i, j)] = value;
            estimate.covariance_white[(i, j)] = value;
        }
        let std = covariance[(a, a)].sqrt();
        (estimate.std[i], estimate.noise_std[i], estimate.half_width_95[i]) = (std, std, normal * std);
        let value = estimate.values[i];
        estimate.relative_std_percent[i] = (std > 0.0 && value != 0.0).then(|| 100.0 * std / value.abs());
    }
}
