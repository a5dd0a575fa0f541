//! Detection of columns that the motion does not excite above the noise of the regressor.
//!
//! The columns of a joint at rest are not zero if its encoder has noise. Least squares would treat this noise as
//! information and estimate parameters of arbitrary size. This module compares directions of the parameters with the
//! effect of the noise alone.

use super::problem::LinearProblem;
use super::unexcited::Unexcited;
use crate::error::{EstimationError, expect};

/// Minimum ratio of a column's sum of squares, after removal of the other excited columns, to that of the noise in
/// the column. The ratio is about 1 if the column contains only noise (less for products of noise, up to 3 with few
/// rows and an estimated noise level). At 4 the motion has three times the power of the noise.
const MIN_POWER_OVER_NOISE: f64 = 4.0;

/// Relative norm of the remainder below which other columns explain a column completely: the default of
/// [`RankSettings`](super::RankSettings).
const DEPENDENCE_TOLERANCE: f64 = 1.0e-8;

/// Finds the columns that are not excited: they contain only noise and combinations of other columns. Columns that
/// depend exactly on others are not included: the rank decision selects which of these are held.
///
/// `noise` is a problem over the same columns: `NᵀN` is the contribution of the noise of the motion to `WᵀW`.
/// `weights` are the weights 1/σ of the joints. `scales`, if known, are the expected errors of the parameters.
///
/// Greedy selection: each selected column is projected out of all others. The remainder of column c is `r_c = W_c −
/// W_F k`, and that of its noise is `n_c = N_c − N_F k` with the same k. While some column has `‖r_c‖² ≥ 4 ‖n_c‖²`,
/// the next selected column is the one with the largest torque error, `scale ‖r_c‖` (without scales: the one with the
/// largest ratio to its noise). The result does not depend on units or on the order of joints and columns. Golub and
/// Van Loan, Matrix Computations, 5.5.7 (subset selection), with the noise as threshold.
///
/// # Errors
/// [`EstimationError::Mismatch`] if the numbers of columns, joints, weights or scales disagree.
pub fn unexcited_columns(
    problem: &LinearProblem,
    noise: &LinearProblem,
    weights: &[f64],
    scales: Option<&[f64]>,
) -> Result<Unexcited, EstimationError> {
    let count = problem.columns().len();
    expect("columns of the regressor's noise", count, noise.columns().len())?;
    if let Some(scales) = scales {
        expect("scales of the columns", count, scales.len())?;
    }
    let mut rows = problem.combined(weights)?.regressor_triangle();
    let mut made = noise.combined(weights)?.regressor_triangle();
    let norms: Vec<f64> = rows.column_iter().map(|column| column.norm()).collect();
    for (column, norm) in norms.iter().enumerate().filter(|(_, norm)| **norm > 0.0) {
        rows.column_mut(column).unscale_mut(*norm);
        made.column_mut(column).unscale_mut(*norm);
    }
    let of_noise: Vec<f64> = made.column_iter().map(|column| column.norm_squared()).collect();
    let worth = |column: usize| scales.map_or(f64::INFINITY, |scales| scales[column] * norms[column]);
    let mut left: Vec<usize> = (0..count).filter(|&column| norms[column] > 0.0).collect();
    loop {
        let mut next: Option<(usize, [f64; 2])> = None;
        for (place, &column) in left.iter().enumerate() {
            let own = rows.column(column).norm_squared();
            let threshold = MIN_POWER_OVER_NOISE * made.column(column).norm_squared();
            if own <= DEPENDENCE_TOLERANCE * DEPENDENCE_TOLERANCE || own < threshold {
                continue;
            }
            // Rounding replaces zero noise, so that exact columns are also ordered by their remainder.
            let clear = own / threshold.max(DEPENDENCE_TOLERANCE * DEPENDENCE_TOLERANCE);
            let rank = [own.sqrt() * worth(column), clear];
            if next.as_ref().is_none_or(|(_, best)| rank > *best) {
                next = Some((place, rank));
            }
        }
        let Some((place, _)) = next else { break };
        let chosen = left.remove(place);
        let (direction, noise) = (rows.column(chosen).into_owned(), made.column(chosen).into_owned());
        let square = direction.norm_squared();
        for &column in &left {
            let share = direction.dot(&rows.column(column)) / square;
            rows.column_mut(column).axpy(-share, &direction, 1.0);
            made.column_mut(column).axpy(-share, &noise, 1.0);
        }
    }
    // Columns that others explain up to rounding are left to the rank decision.
    left.retain(|&column| rows.column(column).norm_squared() > DEPENDENCE_TOLERANCE * DEPENDENCE_TOLERANCE);
    // The part of a noise column that other columns explain is a chance correlation, not larger than the noise.
    let is_noise =
        |column: &usize| 1.0 - rows.column(*column).norm_squared() <= MIN_POWER_OVER_NOISE * of_noise[*column];
    let mut silent: Vec<usize> = left.iter().copied().filter(is_noise).collect();
    let empty = (0..count).filter(|&column| norms[column] <= 0.0);
    silent.extend(empty.clone());
    left.extend(empty);
    silent.sort_unstable();
    left.sort_unstable();
    Ok(Unexcited { columns: left, silent })
}
