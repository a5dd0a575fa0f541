//! Separable least squares: a few nonlinear timing parameters p that all joints share, and linear coefficients c_j of
//! each joint.
//!
//! Minimises `Σ_j ‖y_j − A_j(p) c_j‖² / σ_j² + Σ_i p_i² / s_i²` over the shared p and the coefficients c_j. The
//! coefficients are eliminated (Golub and Pereyra, Inverse Problems 19 (2003) R1, variable projection). p follows
//! from Gauss-Newton steps with finite differences of the projected residuals. σ_j is the residual of joint j, so
//! that a joint that no p explains has little effect on p; s_i is the expected size of p_i.

use nalgebra::{DMatrix, DVector};

/// Maximum number of Gauss-Newton steps. The timing is nearly linear: three steps converge to rounding on most logs;
/// a wrong clock needs more steps.
const MAX_STEPS: usize = 15;
/// Smallest step relative to the finite difference; the search ends at a smaller step.
const MIN_RELATIVE_STEP: f64 = 1e-2;
/// Smallest residual that is used for the weight of a joint, as a share of its torque; without it, exact logs would
/// have infinite weights.
const MIN_RESIDUAL_SHARE: f64 = 1e-4;
/// Singular values below this share of the largest one are treated as zero.
const RANK_TOLERANCE: f64 = 1e-9;

pub(super) const SHARED: usize = 5;

/// One joint's columns, each with the same number of rows.
pub(super) type JointColumns = Vec<Vec<f64>>;

/// A shared parameter: its finite difference, and the standard deviation of its prior.
#[derive(Clone, Copy, Debug)]
pub(super) struct SharedParameter {
    pub(super) difference: f64,
    pub(super) expected: f64,
}

#[derive(Clone, Debug)]
pub(super) struct SeparableFit {
    pub(super) shared: [f64; SHARED],
    pub(super) covariance: Option<DMatrix<f64>>,
    pub(super) columns: Vec<JointColumns>,
}

impl SeparableFit {
    /// Standard deviation of a combination of the shared parameters; infinite if it is not determined.
    pub(super) fn std_of(&self, combination: [f64; SHARED]) -> f64 {
        let Some(covariance) = &self.covariance else { return f64::INFINITY };
        let combination = DVector::from_column_slice(&combination);
        combination.dot(&(covariance * &combination)).max(0.0).sqrt()
    }
}

pub(super) fn separable_fit(
    y: &[Vec<f64>],
    parameters: &[SharedParameter; SHARED],
    starts: &[[f64; SHARED]],
    columns: &mut dyn FnMut(&[f64; SHARED]) -> Vec<JointColumns>,
) -> SeparableFit {
    // There can be several minima, so the search begins at the best start value.
    let starts = starts.iter().map(|start| {
        let shared = *start;
        let at = columns(&shared);
        let residuals = projected(y, &at);
        (shared, at, residuals)
    });
    let share = |residuals: &[Vec<f64>]| -> f64 {
        residuals.iter().zip(y).map(|(r, y)| square(r) / square(y).max(f64::MIN_POSITIVE)).sum()
    };
    let best = starts.min_by(|a, b| share(&a.2).total_cmp(&share(&b.2)));
    let (mut shared, mut at, mut residuals) = best.unwrap_or_else(|| ([0.0; SHARED], Vec::new(), Vec::new()));
    let scale = |residuals: &[Vec<f64>]| -> Vec<f64> {
        let of_joint = |(r, y): (&Vec<f64>, &Vec<f64>)| rms(r).max(MIN_RESIDUAL_SHARE * rms(y)).max(f64::MIN_POSITIVE);
        residuals.iter().zip(y).map(of_joint).collect()
    };
    let cost = |residuals: &[Vec<f64>], sigma: &[f64], shared: &[f64; SHARED]| -> f64 {
        let of_rows: f64 = residuals.iter().zip(sigma).map(|(r, sigma)| square(r) / (sigma * sigma)).sum();
        of_rows + shared.iter().zip(parameters).map(|(p, own)| (p / own.expected).powi(2)).sum::<f64>()
    };
    let mut covariance = None;
    for _ in 0..MAX_STEPS {
        let sigma = scale(&residuals);
        let slopes = slopes(y, parameters, &shared, &residuals, columns);
        let NormalEquations { normal, right } = NormalEquations::new(parameters, &shared, &slopes, &residuals, &sigma);
        let Some(factor) = normal.cholesky() else { break };
        let step = factor.solve(&right);
        covariance = Some(factor.inverse());
        let before = cost(&residuals, &sigma, &shared);
        let mut taken = None;
        for halving in 0..4 {
            let share = 0.5_f64.powi(halving);
            let next: [f64; SHARED] = core::array::from_fn(|k| shared[k] + share * step[k]);
            let there = columns(&next);
            let left = projected(y, &there);
            if cost(&left, &sigma, &next) < before {
                taken = Some((next, there, left));
                break;
            }
        }
        let Some((next, there, left)) = taken else { break };
        let moved = (0..SHARED).map(|k| ((next[k] - shared[k]) / parameters[k].difference).abs()).fold(0.0, f64::max);
        (shared, at, residuals) = (next, there, left);
        if moved < MIN_RELATIVE_STEP {
            break;
        }
    }
    SeparableFit { shared, covariance, columns: at }
}

/// Derivatives of the projected residuals with respect to the shared parameters, joint by joint, by finite differences.
fn slopes(
    y: &[Vec<f64>],
    parameters: &[SharedParameter; SHARED],
    shared: &[f64; SHARED],
    residuals: &[Vec<f64>],
    columns: &mut dyn FnMut(&[f64; SHARED]) -> Vec<JointColumns>,
) -> Vec<Vec<Vec<f64>>> {
    let mut slopes: Vec<Vec<Vec<f64>>> = Vec::with_capacity(SHARED);
    for (place, parameter) in parameters.iter().enumerate() {
        let mut perturbed = *shared;
        perturbed[place] += parameter.difference;
        let moved = projected(y, &columns(&perturbed));
        let slope = |(moved, own): (&Vec<f64>, &Vec<f64>)| {
            moved.iter().zip(own).map(|(a, b)| (a - b) / parameter.difference).collect()
        };
        slopes.push(moved.iter().zip(residuals).map(slope).collect());
    }
    slopes
}

struct NormalEquations {
    normal: DMatrix<f64>,
    right: DVector<f64>,
}

impl NormalEquations {
    fn new(
        parameters: &[SharedParameter; SHARED],
        shared: &[f64; SHARED],
        slopes: &[Vec<Vec<f64>>],
        residuals: &[Vec<f64>],
        sigma: &[f64],
    ) -> Self {
        let mut normal = DMatrix::<f64>::zeros(SHARED, SHARED);
        let mut right = DVector::<f64>::zeros(SHARED);
        for (i, own) in slopes.iter().enumerate() {
            normal[(i, i)] += parameters[i].expected.powi(-2);
            right[i] -= shared[i] * parameters[i].expected.powi(-2);
            for joint in 0..residuals.len() {
                let weight = sigma[joint].powi(-2);
                right[i] -= weight * dot(&own[joint], &residuals[joint]);
                for (k, other) in slopes.iter().enumerate() {
                    normal[(i, k)] += weight * dot(&own[joint], &other[joint]);
                }
            }
        }
        Self { normal, right }
    }
}

fn projected(y: &[Vec<f64>], columns: &[JointColumns]) -> Vec<Vec<f64>> {
    y.iter().zip(columns).map(|(y, columns)| residual_of(columns, y, &coefficients(columns, y))).collect()
}

/// Least squares coefficients of `columns` and then of a constant for `y`; minimum norm for columns that the rows do
/// not distinguish.
pub(super) fn coefficients(columns: &[Vec<f64>], y: &[f64]) -> Vec<f64> {
    let (rows, count) = (y.len(), columns.len() + 1);
    if rows == 0 {
        return vec![0.0; count];
    }
    let column = |k: usize, row: usize| columns.get(k).map_or(1.0, |column| column[row]);
    let norm = |k: usize| (0..rows).map(|row| column(k, row).powi(2)).sum::<f64>().sqrt();
    let norms: Vec<f64> = (0..count).map(norm).map(|norm| if norm > 0.0 { norm } else { 1.0 }).collect();
    let matrix = DMatrix::from_fn(rows, count, |row, k| column(k, row) / norms[k]);
    let svd = matrix.svd(true, true);
    let tolerance = RANK_TOLERANCE * svd.singular_values.max();
    let Ok(solution) = svd.solve(&DVector::from_column_slice(y), tolerance) else { return vec![0.0; count] };
    solution.iter().zip(&norms).map(|(value, norm)| value / norm).collect()
}

/// `y − A c` with the constant as the last coefficient.
pub(super) fn residual_of(columns: &[Vec<f64>], y: &[f64], coefficients: &[f64]) -> Vec<f64> {
    let constant = coefficients.get(columns.len()).copied().unwrap_or(0.0);
    let mut out: Vec<f64> = y.iter().map(|y| y - constant).collect();
    for (column, value) in columns.iter().zip(coefficients) {
        out.iter_mut().zip(column).for_each(|(out, x)| *out -= value * x);
    }
    out
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

pub(super) fn square(values: &[f64]) -> f64 {
    dot(values, values)
}

pub(super) fn rms(values: &[f64]) -> f64 {
    if values.is_empty() { 0.0 } else { (square(values) / values.len() as f64).sqrt() }
}

pub(super) fn centred(values: &[f64]) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.iter().map(|value| value - mean).collect()
}
