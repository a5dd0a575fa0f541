//! Which columns say more than the noise of the regressor does.
//!
//! A joint at rest whose encoder has noise has columns that are not zero: noise makes them. Least squares would take
//! them for information, with parameters of any size. Here directions of the parameters are held against what the
//! noise alone makes of them.

use super::problem::LinearProblem;
use super::unexcited::Unexcited;
use crate::error::{EstimationError, expect};

/// A column counts as excited when what no other excited column explains of it has at least this many times the square
/// sum that the noise makes there. Noise alone gives one, and less for columns of products of noise; with few rows and
/// with a noise level that is itself an estimate, up to two or three. At four the part that is motion has three times
/// the power of the noise.
const ABOVE_NOISE: f64 = 4.0;

/// A column is dependent when at most this share of its norm is its own: the default of
/// [`RankSettings`](super::RankSettings).
const DEPENDENT: f64 = 1.0e-8;

/// The columns that are not excited: nothing but noise and other columns. Columns that depend on others exactly are not
/// among them: which of those are held is for the rank decision.
///
/// `noise` is a problem of the same columns whose rows are what noise in the motion adds to the rows of `problem`, so
/// that `NᵀN` is what it adds to `WᵀW`; `weights` are those of the joints, 1/σ. `scales`, where they are known, say how
/// large an error of each parameter is to be expected.
///
/// One column after another is taken, and what it explains is taken off all others: from `W_c` what is left is
/// `r_c = W_c − W_F k`, and noise makes `n_c = N_c − N_F k` of it, with the same k. As long as some column has
/// `‖r_c‖² ≥ 4 ‖n_c‖²`, the next is the one of them whose error would make the most torque, `scale ‖r_c‖` (without
/// scales: the one that is clearest above the noise). Units, the order of joints and of columns do not matter.
/// Golub and Van Loan, Matrix Computations, 5.5.7 (subset selection), with the noise as threshold.
///
/// # Errors
/// [`EstimationError::Mismatch`] for another number of columns, joints, weights or scales.
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
    // A column without a scale is taken last: where nothing is known of it, others are estimated before it.
    let worth = |column: usize| scales.map_or(f64::INFINITY, |scales| scales[column] * norms[column]);
    let mut left: Vec<usize> = (0..count).filter(|&column| norms[column] > 0.0).collect();
    loop {
        let mut next: Option<(usize, [f64; 2])> = None;
        for (place, &column) in left.iter().enumerate() {
            let own = rows.column(column).norm_squared();
            let threshold = ABOVE_NOISE * made.column(column).norm_squared();
            if own <= DEPENDENT * DEPENDENT || own < threshold {
                continue;
            }
            // Rounding in place of no noise at all: a column that is exact comes before none that is exact too.
            let clear = own / threshold.max(DEPENDENT * DEPENDENT);
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
    // A column that others explain to the last digit is not the noise's business: rank decides which of them is held.
    left.retain(|&column| rows.column(column).norm_squared() > DEPENDENT * DEPENDENT);
    // What the others explain of a column of noise is chance, and no larger than noise either.
    let is_noise = |column: &usize| 1.0 - rows.column(*column).norm_squared() <= ABOVE_NOISE * of_noise[*column];
    let mut silent: Vec<usize> = left.iter().copied().filter(is_noise).collect();
    let empty = (0..count).filter(|&column| norms[column] <= 0.0);
    silent.extend(empty.clone());
    left.extend(empty);
    silent.sort_unstable();
    left.sort_unstable();
    Ok(Unexcited { columns: left, silent })
}
