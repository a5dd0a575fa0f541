//! Factors of small symmetric positive definite matrices, one in each lane: by the steps of [`super::factor`], so that
//! a lane has the bits of a robot by itself.

use super::factor::{factor_over, solve};
use dynident_lanes::Lane;

/// Solves `A x = b` in every lane by `A = L D Lᵀ`; the lower triangle of `a` (row-major, n × n) is used up, `b` holds
/// x. False if some lane's `A` is not positive definite: `bad` is then set there, and x has no meaning.
#[inline(always)]
pub(super) fn factor_and_solve<T: Lane>(a: &mut [T], n: usize, b: &mut [T], bad: &mut [bool; 8]) -> bool {
    let fine = factor_over(a, n, |pivot| is_pivot(pivot, bad));
    solve(a, n, b);
    fine
}

/// Whether a pivot is positive and finite in every lane.
#[inline(always)]
fn is_pivot<T: Lane>(pivot: T, bad: &mut [bool; 8]) -> bool {
    // The least positive number.
    let fine = T::splat(f64::from_bits(1)).all_at_most(pivot) && pivot.all_at_most(T::splat(f64::MAX));
    if !fine {
        let mut lanes = [1.0; 8];
        pivot.store(&mut lanes);
        mark(&lanes, bad);
    }
    fine
}

#[cold]
fn mark(pivots: &[f64; 8], bad: &mut [bool; 8]) {
    for (pivot, bad) in pivots.iter().zip(bad) {
        *bad |= !(*pivot > 0.0 && *pivot < f64::INFINITY);
    }
}
