//! A caller's own estimator: any rule that makes values of the rows `[W | τ]`.

use super::ordinary::OrdinarySettings;
use super::weighted::{WeightedSettings, weighted_values};
use crate::error::{EstimationError, expect};
use crate::factor::{LinearProblem, Solution, Split, solve, split};
use crate::uncertainty::{CovarianceMethod, Estimate, PointEstimate, joint_degrees_of_freedom, student_half_width};
use nalgebra::{DMatrix, DVector};

/// What an estimator of a caller gets: the rows of every joint, reduced to as many as there are columns and one more.
///
/// They are the triangular factors of the rows: for each joint and every θ, `‖τ - W θ‖²` and `Wᵀ(τ - W θ)` over them
/// are those over all samples. Columns that the data do not excite are not among them; what they give at their fallback
/// values is taken from τ.
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
    /// Of each row the number of its joint.
    pub joint_of_row: Vec<usize>,
    /// Samples of each joint that the rows stand for.
    pub samples: Vec<usize>,
    /// Noise of each joint by weighted least squares, Nm (N): `1/σ_j` whitens its rows.
    pub joint_sigma: Vec<f64>,
}

/// What it gives.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnEstimate {
    /// One value for each column of the rows.
    pub values: Vec<f64>,
    /// Their covariance; without one, error bars are those of ordinary least squares at the residuals of `values`.
    pub covariance: Option<DMatrix<f64>>,
}

/// The estimate that `rule` makes of a problem's rows; `name` is what messages call it.
///
/// # Errors
/// As [`ordinary_least_squares`](super::ordinary_least_squares); [`EstimationError::Own`] for values or a covariance of
/// another size, that are not finite, and for a negative variance.
pub fn estimate_by(
    problem: &LinearProblem,
    settings: &OrdinarySettings,
    name: &str,
    rule: impl FnOnce(&EstimatorRows) -> OwnEstimate,
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

/// The rows of the free columns, joint by joint, less what the held columns explain.
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
        // What no θ explains: the last row, whose regressor is zero.
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

/// That values and covariance are numbers, and as many as there are columns.
fn check(name: &str, own: &OwnEstimate, columns: usize) -> Result<(), EstimationError> {
    let wrong = |problem: String| EstimationError::Own { name: name.to_owned(), problem };
    expect("values of a caller's own estimator", columns, own.values.len())?;
    if let Some(place) = own.values.iter().position(|value| !value.is_finite()) {
        return Err(wrong(format!("value {place} is {}: give finite numbers", own.values[place])));
    }
    let Some(covariance) = &own.covariance else { return Ok(()) };
    if covariance.shape() != (columns, columns) {
        let (rows, found) = covariance.shape();
        return Err(wrong(format!("a covariance of shape ({rows}, {found}): give ({columns}, {columns})")));
    }
    if covariance.iter().any(|value| !value.is_finite()) {
        return Err(wrong("the covariance holds numbers that are not finite".to_owned()));
    }
    if let Some(place) = (0..columns).find(|&k| covariance[(k, k)] < 0.0) {
        return Err(wrong(format!("variance {place} of the covariance is negative")));
    }
    Ok(())
}

/// Bars by a covariance that the caller gave, as normally distributed errors.
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
