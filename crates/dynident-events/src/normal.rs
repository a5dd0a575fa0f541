//! Normal equations of the least-squares fit of one joint.

use crate::rows::LogRows;
use core::ops::Range;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Regularisation relative to the mean diagonal; columns have similar scales.
const RIDGE: f64 = 1e-7;

/// `[W τ]ᵀ V⁻¹ [W τ]` over some bins of one joint, with the weights of the bins.
#[derive(Clone, Debug)]
pub(crate) struct Normal {
    /// Sum of the weights of the bins.
    pub(crate) weight: f64,
    gram: DMatrix<f64>,
}

impl Normal {
    pub(crate) fn zero(width: usize) -> Self {
        Self { weight: 0.0, gram: DMatrix::zeros(width + 1, width + 1) }
    }

    /// Sums over a range of bins, without unusable and excluded bins. `further` appends columns to each bin.
    pub(crate) fn of_range(
        rows: &LogRows,
        joint: usize,
        range: Range<usize>,
        is_kept: impl Fn(usize) -> bool,
        further: impl Fn(usize, &mut Vec<f64>),
    ) -> Self {
        let kept: Vec<usize> = range.filter(|&bin| rows.usable[bin] && is_kept(bin)).collect();
        let (mut values, mut weight) = (Vec::new(), 0.0);
        for &bin in &kept {
            let first = values.len();
            values.extend_from_slice(rows.row(joint, bin));
            further(bin, &mut values);
            values.push(rows.tau[joint][bin]);
            let own = rows.weight[joint][bin];
            weight += own;
            for value in &mut values[first..] {
                *value *= own.sqrt();
            }
        }
        if kept.is_empty() {
            let mut none = Vec::new();
            further(0, &mut none);
            return Self::zero(rows.width[joint] + none.len());
        }
        let width = values.len() / kept.len();
        // Column-major storage of the transposed rows.
        let transposed = DMatrix::from_vec(width, kept.len(), values);
        Self { weight, gram: &transposed * transposed.transpose() }
    }

    /// Number of columns without the torque.
    pub(crate) fn width(&self) -> usize {
        self.gram.nrows() - 1
    }

    pub(crate) fn add(&mut self, other: &Self) {
        self.weight += other.weight;
        self.gram += &other.gram;
    }

    /// Least squares parameters; `None` without rows.
    pub(crate) fn solution(&self) -> Option<DVector<f64>> {
        let width = self.width();
        Some(self.factor()?.solve(&self.gram.view((0, width), (width, 1)).column(0).into_owned()))
    }

    /// Variance of the predicted torque for this row of columns, relative to the variance of a bin with the weight 1;
    /// `None` without rows.
    pub(crate) fn leverage(&self, row: &DVector<f64>) -> Option<f64> {
        Some(row.dot(&self.factor()?.solve(row)))
    }

    fn factor(&self) -> Option<Cholesky<f64, Dyn>> {
        let width = self.width();
        if width == 0 || self.weight == 0.0 {
            return None;
        }
        let mut matrix = self.gram.view((0, 0), (width, width)).into_owned();
        let ridge = RIDGE * matrix.trace() / width as f64 + f64::MIN_POSITIVE;
        for place in 0..width {
            matrix[(place, place)] += ridge;
        }
        matrix.cholesky()
    }

    /// Weighted sum of squared residuals with the given parameters.
    pub(crate) fn squares(&self, theta: &DVector<f64>) -> f64 {
        let width = theta.len();
        let product = self.gram.view((0, 0), (width, width)) * theta;
        let right = self.gram.view((0, width), (width, 1));
        (self.gram[(width, width)] - 2.0 * theta.dot(&right.column(0)) + theta.dot(&product)).max(0.0)
    }
}
