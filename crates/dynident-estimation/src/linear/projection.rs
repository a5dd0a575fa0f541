//! First stage of two-stage least squares: projection of the regressor on the instruments.

use crate::error::EstimationError;
use crate::factor::{
    FactorWorkspace, InstrumentedProblem, RankSettings, StackedProblem, TriangularFactor, Unexcited, split,
};
use nalgebra::DMatrix;

/// Decomposes `W = Z Π + V` with `ZᵀV = 0`, over the weighted rows of all joints, from the triangle of `[Z | W | τ]`
/// (instruments, regressor, torque).
///
/// ```text
///     [Z | W | τ] = Q [ R_Z  M    m ]     Π = R_Z⁻¹ M,   W̃ = Z Π,   W̃ᵀW̃ = MᵀM,   VᵀV = R_VᵀR_V
///                     [  0  R_V   v ]
///                     [  0   0    ρ ]
/// ```
///
/// No product ZᵀW is formed, so the condition number of the instruments is not squared. Instruments that depend on
/// earlier ones are excluded.
pub(crate) struct Projection {
    /// `[M | m]` as a factor: the factor of the rows `[W̃ | P_Z τ]`.
    pub(crate) explained: TriangularFactor,
    /// `[R_V | v]`: unexplained part of regressor and torque.
    pub(crate) left: TriangularFactor,
    /// Π, shape (columns, columns); zero rows for excluded instruments.
    pub(crate) coefficients: DMatrix<f64>,
    pub(crate) instruments: usize,
}

impl Projection {
    pub(crate) fn new(
        problem: &InstrumentedProblem,
        stacked: &StackedProblem<'_>,
        weights: &[f64],
        rank: &RankSettings,
    ) -> Result<Self, EstimationError> {
        let count = problem.columns().len();
        let triangle = stacked.combined(weights)?;
        let mut workspace = FactorWorkspace::default();
        // Rank of the instruments, on their own columns scaled by their norms.
        let mut alone = TriangularFactor::new(count);
        alone.absorb_entries(
            &mut workspace,
            count,
            |row, column| if column < count { triangle.entry(row, column) } else { 0.0 },
        );
        let kept = split(&alone, rank, &Unexcited::default()).free;
        let k = kept.len();
        let norms = alone.column_norms();
        // The triangular form is restored without the dependent instruments.
        let mut reduced = TriangularFactor::new(k + count);
        reduced.absorb_entries(&mut workspace, 2 * count + 1, |row, column| {
            if column < k {
                triangle.entry(row, kept[column]) / norms[kept[column]]
            } else {
                triangle.entry(row, count + column - k)
            }
        });
        let mut explained = TriangularFactor::new(count);
        explained.absorb_entries(&mut workspace, k, |row, column| reduced.entry(row, k + column));
        explained.count(triangle.rows());
        let mut left = TriangularFactor::new(count);
        left.absorb_entries(&mut workspace, count + 1, |row, column| reduced.entry(k + row, k + column));
        left.count(triangle.rows());
        let mut coefficients = DMatrix::zeros(count, count);
        for column in 0..count {
            for row in (0..k).rev() {
                let known: f64 = (row + 1..k)
                    .map(|i| reduced.entry(row, i) * coefficients[(kept[i], column)] * norms[kept[i]])
                    .sum();
                coefficients[(kept[row], column)] =
                    (reduced.entry(row, k + column) - known) / (reduced.entry(row, row) * norms[kept[row]]);
            }
        }
        Ok(Self { explained, left, coefficients, instruments: k })
    }

    /// Coefficients that map an equation's `[Z | W | τ]`, with columns `local`, to `[Z Π | W − Z Π]` over all
    /// columns.
    pub(crate) fn parts(&self, local: &[usize]) -> (DMatrix<f64>, DMatrix<f64>) {
        let count = self.coefficients.ncols();
        let mut fitted = DMatrix::zeros(2 * local.len() + 1, count);
        for (place, &column) in local.iter().enumerate() {
            fitted.set_row(place, &self.coefficients.row(column));
        }
        let mut left = -&fitted;
        for (place, &column) in local.iter().enumerate() {
            left[(local.len() + place, column)] += 1.0;
        }
        (fitted, left)
    }
}
