//! Prediction error on left-out blocks of time relative to the error that the fit predicts.

use crate::error::{EstimationError, expect};
use crate::factor::{FactorWorkspace, LinearProblem, TriangularFactor};
use crate::uncertainty::Estimate;
use nalgebra::{Cholesky, DMatrix, DVector};
use std::collections::BTreeMap;

struct Block {
    joint: usize,
    columns: Vec<usize>,
    factor: TriangularFactor,
}

/// Ratio, for every joint, of the prediction error on left-out blocks to the error expected from the covariance and
/// the joint's noise, at least 1:
///
/// ```text
/// κ_j² = Σ_k n_jk / n_j · ‖τ_jk − W_jk θ₋ₖ‖² / (tr(W_jk V₋ₖ W_jkᵀ) + n_jk σ_j²)
/// θ₋ₖ = θ − A₋ₖ⁻¹ s_k,   V₋ₖ = A₋ₖ⁻¹ A V A A₋ₖ⁻¹,   A = Σ W_jᵀW_j / σ_j²,   s_k = Σ_j W_jkᵀ(τ_jk − W_jk θ) / σ_j²
/// ```
///
/// with the estimate θ, its covariance V and the joints' noise σ_j (Nm, N); block k has n_jk rows of joint j. A is
/// the information of all rows and of the prior, A₋ₖ the information without block k. Columns that were not estimated
/// are not changed. Every log is divided into the same number of blocks of equal length, at least `blocks` in all. A
/// block is ignored if the other blocks do not determine the parameters.
///
/// For a correct model κ is about 1. A model that drifts with temperature or lacks a term predicts new data worse than
/// its residuals suggest. One-step deletion is exact for weighted least squares with these weights (Cook and Weisberg,
/// *Residuals and Influence in Regression*, 1982, section 3.6).
///
/// # Errors
/// [`EstimationError::Mismatch`] if columns or joints of estimate and problem differ.
pub fn left_out_ratios(
    problem: &LinearProblem,
    estimate: &Estimate,
    blocks: usize,
) -> Result<Vec<f64>, EstimationError> {
    let (columns, joints) = (problem.columns().len(), problem.joints().len());
    expect("values of an estimate", columns, estimate.values.len())?;
    expect("joints of an estimate", joints, estimate.joint_sigma.len())?;
    let free: Vec<usize> = (0..columns).filter(|&column| estimate.covariance[(column, column)] > 0.0).collect();
    let weights: Vec<f64> = estimate.joint_sigma.iter().map(|sigma| sigma.powi(-2)).collect();
    if free.is_empty() || weights.iter().any(|weight| !weight.is_finite()) {
        return Ok(vec![1.0; joints]);
    }

    // Information and score of every block over the estimated columns.
    let of_time = cut(problem, blocks.div_ceil(problem.logs().len().max(1)).max(1));
    let mut informations = Vec::with_capacity(of_time.len());
    let mut scores = Vec::with_capacity(of_time.len());
    for block in of_time.values() {
        let mut information = DMatrix::zeros(columns, columns);
        let mut score = DVector::zeros(columns);
        for rows in block {
            let (gram, own) = (rows.gram(), rows.factor.score(&rows.local(&estimate.values)));
            for (i, &row) in rows.columns.iter().enumerate() {
                score[row] += weights[rows.joint] * own[i];
                for (k, &column) in rows.columns.iter().enumerate() {
                    information[(row, column)] += weights[rows.joint] * gram[(i, k)];
                }
            }
        }
        informations.push(information.select_rows(&free).select_columns(&free));
        scores.push(score.select_rows(&free));
    }
    let mut all = informations.iter().fold(DMatrix::zeros(free.len(), free.len()), |sum, block| sum + block);
    if let Some(prior) = problem.prior() {
        let rows = prior.sqrt_information().select_columns(&free);
        all += rows.transpose() * rows;
    }
    let covariance = estimate.covariance.select_rows(&free).select_columns(&free);

    // Prediction of each block by the fit to the others.
    let (mut excess, mut counted) = (vec![0.0; joints], vec![0.0; joints]);
    for ((block, information), score) in of_time.values().zip(&informations).zip(&scores) {
        let Some(rest) = Cholesky::new(&all - information) else { continue };
        let step = rest.solve(score);
        let map = rest.solve(&all);
        let (mut theta, mut variance) = (estimate.values.clone(), DMatrix::zeros(columns, columns));
        let of_free = &map * &covariance * map.transpose();
        for (i, &row) in free.iter().enumerate() {
            theta[row] -= step[i];
            for (k, &column) in free.iter().enumerate() {
                variance[(row, column)] = of_free[(i, k)];
            }
        }
        for rows in block {
            let count = rows.factor.rows() as f64;
            let own = variance.select_rows(&rows.columns).select_columns(&rows.columns);
            let expected = rows.gram().dot(&own) + count * estimate.joint_sigma[rows.joint].powi(2);
            let left = rows.factor.residual_sum_of_squares(&rows.local(&theta))?;
            if expected > 0.0 && (left / expected).is_finite() {
                excess[rows.joint] += count * left / expected;
                counted[rows.joint] += count;
            }
        }
    }
    let ratio = |(excess, count): (f64, f64)| if count > 0.0 { (excess / count).max(1.0).sqrt() } else { 1.0 };
    Ok(excess.into_iter().zip(counted).map(ratio).collect())
}

/// The rows by log and block of time, `each` blocks per log.
fn cut(problem: &LinearProblem, each: usize) -> BTreeMap<(usize, usize), Vec<Block>> {
    let mut of_time: BTreeMap<(usize, usize), Vec<Block>> = BTreeMap::new();
    let mut workspace = FactorWorkspace::default();
    for equation in problem.equations() {
        let all = equation.factor.rows().max(1);
        let mut before = 0;
        for segment in equation.factor.segment_factors() {
            let middle = before + segment.rows() / 2;
            before += segment.rows();
            let blocks = of_time.entry((equation.log, (middle * each / all).min(each - 1))).or_default();
            if let Some(block) = blocks.last_mut().filter(|block| block.joint == equation.joint) {
                block.factor.absorb_factor(&mut workspace, &segment);
            } else {
                let (joint, columns) = (equation.joint, equation.columns.clone());
                blocks.push(Block { joint, columns, factor: segment });
            }
        }
    }
    of_time
}

impl Block {
    /// `WᵀW` over the joint's columns.
    fn gram(&self) -> DMatrix<f64> {
        let triangle = self.factor.regressor_triangle();
        triangle.transpose() * triangle
    }

    /// The parameters of the columns of these rows.
    fn local(&self, theta: &[f64]) -> Vec<f64> {
        self.columns.iter().map(|&column| theta[column]).collect()
    }
}
