//! Effect of errors in the stated drive gains on an estimated payload.

use super::columns::LoadColumns;
use dynident_estimation::{Estimate, EstimationError, LinearProblem};
use nalgebra::{DMatrix, DVector};

/// Covariance that the error of the gains adds to the payloads of an estimate; `None` without payloads or without an
/// error.
///
/// The estimate x of a payload is linear in the torque: `x = Σ_j x_j`, where
/// `x_j = (Σ_k W_kᵀW_k/σ_k²)⁻¹ W_jᵀ(τ_j − W_j θ_held)/σ_j²` is the contribution of joint j with torque τ_j, regressor
/// W_j and noise σ_j. A relative gain error ε_j multiplies x_j by `1 + ε_j`. A known arm (columns `held`, values
/// θ_held), which was identified with the same gains, has the same error, so its torque is subtracted first. If the
/// gain errors of the joints are independent with the relative standard deviation `share`, the covariance of the
/// payload grows by `share² Σ_j x_j x_jᵀ`.
pub(crate) fn gain_error(
    problem: &LinearProblem,
    columns: &LoadColumns,
    estimate: &Estimate,
    held: &[usize],
    share: f64,
) -> Result<Option<DMatrix<f64>>, EstimationError> {
    let count = problem.columns().len();
    let payload: Vec<usize> = columns.payloads.iter().flat_map(|own| own.first..own.first + own.kept.len()).collect();
    if share <= 0.0 || payload.is_empty() {
        return Ok(None);
    }
    let fixed = |column: usize| estimate.rank.fixed.iter().any(|fixed| fixed.column == column);
    let free: Vec<usize> = (0..count).filter(|&column| !held.contains(&column) && !fixed(column)).collect();
    let weights: Vec<f64> =
        estimate.joint_sigma.iter().map(|sigma| if *sigma > 0.0 { sigma.recip() } else { 1.0 }).collect();
    let mut triangle = problem.combined(&weights)?.regressor_triangle().select_columns(&free);
    let norms: Vec<f64> = triangle.column_iter().map(|column| column.norm().max(f64::MIN_POSITIVE)).collect();
    for (mut column, norm) in triangle.column_iter_mut().zip(&norms) {
        column /= *norm;
    }
    let r = triangle.qr().r();
    let known = DVector::from_fn(count, |column, _| if held.contains(&column) { estimate.values[column] } else { 0.0 });
    let mut further = DMatrix::zeros(count, count);
    for joint in 0..problem.joints().len() {
        let mut score = DVector::<f64>::zeros(count);
        for equation in problem.equations().iter().filter(|equation| equation.joint == joint) {
            let own: Vec<f64> = equation.columns.iter().map(|&column| known[column]).collect();
            let scores = equation.factor.scores(&own)?;
            for of_segment in scores {
                for (&column, value) in equation.columns.iter().zip(of_segment.iter()) {
                    score[column] += weights[joint] * weights[joint] * value;
                }
            }
        }
        let scaled = DVector::from_fn(free.len(), |place, _| score[free[place]] / norms[place]);
        let Some(half) = r.tr_solve_upper_triangular(&scaled) else { continue };
        let Some(part) = r.solve_upper_triangular(&half) else { continue };
        let mut of_joint = DVector::<f64>::zeros(count);
        for (place, &column) in free.iter().enumerate() {
            of_joint[column] = part[place] / norms[place];
        }
        for &row in &payload {
            for &column in &payload {
                further[(row, column)] += share * share * of_joint[row] * of_joint[column];
            }
        }
    }
    Ok(Some(further))
}
