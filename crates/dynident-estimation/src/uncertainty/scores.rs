//! Scores of a fit in coordinates where its information is the unit matrix.
//!
//! The information of the free columns is `A = RᵀR`, so `R⁻ᵀ` whitens scores. A covariance method computes a matrix M
//! from `R⁻ᵀ s_g` of each time segment g of each joint in each log. `R⁻¹ M R⁻ᵀ` is then the covariance of the
//! columns.

use crate::error::EstimationError;
use crate::factor::{JointRows, ReducedRows, Solution, Split, StackedProblem};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::sync::OnceLock;

pub(crate) struct Fit<'a> {
    pub(crate) split: &'a Split,
    pub(crate) solution: &'a Solution,
    /// w_j: weight of the rows of joint j.
    pub(crate) weights: &'a [f64],
    /// Noise of joint j, in the unit of its torque.
    pub(crate) joint_sigma: &'a [f64],
    /// Variance of the weighted rows under white noise.
    pub(crate) weighted_variance: f64,
    pub(crate) rows: usize,
}

pub(super) struct Scores<'a> {
    /// Scores of each equation of the problem, in the same order.
    pub(super) joints: Vec<JointScores<'a>>,
    pub(super) free: usize,
    /// R⁻¹ of the free columns.
    inverse: &'a DMatrix<f64>,
    /// Index of every column among the free columns.
    place: Vec<Option<usize>>,
}

pub(super) struct JointScores<'a> {
    pub(super) rows: &'a JointRows,
    weight: f64,
    /// Parameters of the columns of these rows, and the corresponding rows of R⁻¹.
    theta: Vec<f64>,
    local_inverse: DMatrix<f64>,
    /// `R⁻ᵀ w² W_gᵀ(τ_g − W_g θ)` for every segment g.
    pub(super) scores: Vec<DVector<f64>>,
    /// `‖w W R⁻¹‖²`: expected sum of the squared scores under unit white noise.
    information: f64,
    /// Reduced rows of every segment, computed on demand.
    segments: OnceLock<Vec<ReducedRows>>,
}

impl<'a> Scores<'a> {
    pub(super) fn new(stacked: &StackedProblem<'a>, fit: &Fit<'a>) -> Result<Self, EstimationError> {
        let problem = stacked.problem;
        let inverse = &fit.solution.inverse;
        let free = inverse.ncols();
        let mut place = vec![None; problem.columns().len()];
        for (k, &column) in fit.split.free.iter().enumerate() {
            place[column] = Some(k);
        }
        let joints = problem.equations().iter().zip(&stacked.totals).map(|(rows, total)| {
            let weight = fit.weights[rows.joint];
            let mut local_inverse = DMatrix::zeros(total.columns(), free);
            for (local, &column) in rows.columns.iter().enumerate() {
                if let Some(k) = place[column] {
                    local_inverse.set_row(local, &inverse.row(k));
                }
            }
            let information = (total.regressor_triangle() * &local_inverse * weight).norm_squared();
            let theta = rows.local(&fit.solution.values);
            let scores = whitened(&local_inverse, &rows.factor.scores(&theta)?, weight * weight);
            Ok(JointScores { rows, weight, theta, local_inverse, scores, information, segments: OnceLock::new() })
        });
        Ok(Self { joints: joints.collect::<Result<_, EstimationError>>()?, free, inverse, place })
    }

    pub(super) fn clusters(&self) -> usize {
        self.joints.iter().map(|joint| joint.scores.len()).sum()
    }

    /// For every joint, the squared scores relative to white noise, and the correlation of the scores of neighbouring
    /// segments.
    pub(super) fn inflation_and_neighbours(&self, fit: &Fit<'_>) -> (Vec<f64>, Vec<f64>) {
        let count = fit.joint_sigma.len();
        let (mut found, mut expected, mut products) = (vec![0.0; count], vec![0.0; count], vec![0.0; count]);
        for own in &self.joints {
            let joint = own.rows.joint;
            expected[joint] += own.information * (own.weight * fit.joint_sigma[joint]).powi(2);
            for (g, score) in own.scores.iter().enumerate() {
                found[joint] += score.norm_squared();
                if g > 0 {
                    products[joint] += own.scores[g - 1].dot(score);
                }
            }
        }
        let inflation = found.iter().zip(&expected).map(|(f, e)| if *e > 0.0 { f / e } else { 1.0 }).collect();
        let neighbours = products.iter().zip(&found).map(|(s, f)| if *f > 0.0 { s / f } else { 0.0 }).collect();
        (inflation, neighbours)
    }

    /// `R⁻¹ M R⁻ᵀ` over all columns, zero for fixed ones.
    pub(super) fn spread(&self, moment: &DMatrix<f64>) -> DMatrix<f64> {
        let small = self.inverse * moment * self.inverse.transpose();
        let columns = self.place.len();
        DMatrix::from_fn(columns, columns, |row, column| match (self.place[row], self.place[column]) {
            (Some(i), Some(j)) => 0.5 * (small[(i, j)] + small[(j, i)]),
            _ => 0.0,
        })
    }

    /// Degrees of freedom of every column's variance: `independent` times the degrees of freedom of its clusters
    /// under white noise; infinite for fixed columns.
    pub(super) fn degrees_of_freedom(&self, independent: f64) -> Vec<f64> {
        let shares: Vec<Vec<f64>> = self.joints.par_iter().flat_map_iter(|joint| joint.shares(self.inverse)).collect();
        let degrees_of_freedom =
            |place: &Option<usize>| place.map_or(f64::INFINITY, |k| (independent * satterthwaite(&shares, k)).max(1.0));
        self.place.iter().map(degrees_of_freedom).collect()
    }
}

impl JointScores<'_> {
    fn segments(&self) -> &[ReducedRows] {
        self.segments.get_or_init(|| self.rows.factor.reduced_segments())
    }

    /// Information of every segment in whitened coordinates, `w² R⁻ᵀ W_gᵀ W_g R⁻¹`.
    pub(super) fn informations(&self) -> impl Iterator<Item = DMatrix<f64>> {
        self.segments().iter().map(|segment| {
            let whitened = &segment.regressor * &self.local_inverse * self.weight;
            whitened.tr_mul(&whitened)
        })
    }

    /// Change of the estimate when one segment is left out, for every segment: `R⁻ᵀ w W_gᵀ (I − H_g)⁻¹ w (τ_g − W_g
    /// θ)` with the segment's block of the hat matrix, `H_g = w² W_g A⁻¹ W_gᵀ`.
    pub(super) fn changes_without(&self) -> Vec<DVector<f64>> {
        // If a segment alone determines a direction, its residual and 1 − leverage are both zero there; the ridge
        // avoids 0/0.
        const LEVERAGE_RIDGE: f64 = 1.0e-6;
        let theta = DVector::from_column_slice(&self.theta);
        // Square root of w² A⁻¹ over the columns of these rows: the triangle L of R⁻¹ = L Q.
        let root = self.local_inverse.transpose().qr().unpack_r().transpose() * self.weight;
        let change = |segment: &ReducedRows| {
            let ReducedRows { regressor, torque } = segment;
            let rest = (torque - regressor * &theta) * self.weight;
            let half = regressor * &root;
            let left = DMatrix::identity(rest.len(), rest.len()) * (1.0 + LEVERAGE_RIDGE) - &half * half.transpose();
            // Positive definite up to rounding: the segment is part of the total, whose hat matrix is the unit matrix.
            let without = left.cholesky().map_or_else(|| rest.clone(), |factor| factor.solve(&rest));
            regressor.tr_mul(&without)
        };
        let changes: Vec<DVector<f64>> = self.segments().iter().map(change).collect();
        whitened(&self.local_inverse, &changes, self.weight)
    }

    /// For every segment its share of the variance of every free column under white noise, `‖w W_g A⁻¹‖²` by column.
    fn shares(&self, inverse: &DMatrix<f64>) -> Vec<Vec<f64>> {
        let local_covariance = &self.local_inverse * inverse.transpose() * self.weight;
        let share = |segment: &ReducedRows| {
            let part = &segment.regressor * &local_covariance;
            part.column_iter().map(|column| column.norm_squared()).collect()
        };
        self.segments().iter().map(share).collect()
    }
}

/// `R⁻ᵀ` times vectors over the columns of one joint's rows, times a factor.
fn whitened(local_inverse: &DMatrix<f64>, vectors: &[DVector<f64>], times: f64) -> Vec<DVector<f64>> {
    let stacked = DMatrix::from_fn(local_inverse.nrows(), vectors.len(), |row, g| vectors[g][row]);
    let product = local_inverse.transpose() * stacked * times;
    product.column_iter().map(nalgebra::Matrix::into_owned).collect()
}

/// Degrees of freedom of a sum of independent squares with expectations h_g: `(Σ_g h_g)² / Σ_g h_g² − 1`.
///
/// Satterthwaite, Biometrics Bulletin 2 (1946) 110; for clusters Bell and McCaffrey, Survey Methodology 28 (2002) 169,
/// here without the correlation that the fit causes between clusters. One degree is subtracted for the jackknife
/// factor (G − 1)/G.
fn satterthwaite(shares: &[Vec<f64>], k: usize) -> f64 {
    let (sum, square) = shares.iter().fold((0.0, 0.0), |(sum, square), h| (sum + h[k], square + h[k] * h[k]));
    if square > 0.0 { (sum * sum / square - 1.0).max(1.0) } else { 1.0 }
}
