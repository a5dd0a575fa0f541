//! Newton's step for the noise levels of weighted least squares.
//!
//! With `λ_j = 1/σ_j²` the solution `θ(λ)` has the residuals `S_j = ‖τ_j − W_j θ‖²`. The noise levels have converged
//! when `F_j = ln λ_j + ln(S_j / d_j) = 0` for the degrees of freedom `d_j`. The fixed-point iteration `ln λ ← ln λ −
//! F` reduces the error by a factor of two to four per step. Newton's step uses the derivative, from the scores `g_j
//! = W_jᵀ(τ_j − W_j θ)` and the information `A = Σ λ_j W_jᵀW_j + SᵀS` of the solution:
//!
//! ```text
//!     ∂θ/∂λ_j = A⁻¹ g_j,    ∂S_i/∂λ_j = −2 g_iᵀ A⁻¹ g_j,    ∂F_i/∂ln λ_j = δ_ij − 2 λ_j g_iᵀA⁻¹g_j / S_i
//! ```
//!
//! (Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973) 413, for the eliminated parameters.)

use crate::factor::{SolvedValues, Split, StackedProblem};
use nalgebra::{DMatrix, DVector};

/// Maximum step in the logarithm of any `λ_j`; the linearisation is not valid beyond it.
const MAX_LOG_STEP: f64 = 1.5;

/// Weights `1/σ_j` after Newton's step from the `weights` of `solution`, whose residuals have the RMS `joint_sigma`;
/// `None` if the step is too long or undefined.
pub(super) fn newton_weights(
    stacked: &StackedProblem<'_>,
    split: &Split,
    solution: &SolvedValues,
    weights: &[f64],
    joint_sigma: &[f64],
    degrees_of_freedom: &[f64],
) -> Option<Vec<f64>> {
    let joints = weights.len();
    let scores = stacked.joint_scores(&solution.values);
    let whitened = DMatrix::from_columns(
        &scores.iter().map(|score| solution.whitened(&score.select_rows(&split.free))).collect::<Vec<_>>(),
    );
    let products = whitened.tr_mul(&whitened);
    let squares = |joint: usize| degrees_of_freedom[joint] * joint_sigma[joint].powi(2);
    let answer = |i: usize, j: usize| 2.0 * weights[j].powi(2) * products[(i, j)] / squares(i);
    let slope = DMatrix::identity(joints, joints) - DMatrix::from_fn(joints, joints, answer);
    let misfit = DVector::from_fn(joints, |joint, _| 2.0 * (weights[joint] * joint_sigma[joint]).ln());
    let step = slope.lu().solve(&misfit).filter(|step| step.iter().all(|by| by.abs() <= MAX_LOG_STEP));
    step.map(|step| weights.iter().zip(step.iter()).map(|(weight, by)| weight * (-0.5 * by).exp()).collect())
}
