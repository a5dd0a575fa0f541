//! Signals and helpers for the tests of the differentiators.

use crate::derivative::differentiator::{Derivatives, Differentiator};

/// White noise of unit variance: Box-Muller transform of a linear congruential generator.
pub(crate) fn normal(seed: u64, n: usize) -> Vec<f64> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5851_f42d_4c95_7f2d;
    let mut uniform = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((state >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    };
    for _ in 0..20 {
        uniform();
    }
    (0..n).map(|_| (-2.0 * uniform().ln()).sqrt() * (core::f64::consts::TAU * uniform()).cos()).collect()
}

pub(crate) fn differentiated(differentiator: &dyn Differentiator, rate_hz: f64, q: &[f64]) -> [Vec<f64>; 3] {
    let mut out = [vec![0.0; q.len()], vec![0.0; q.len()], vec![0.0; q.len()]];
    let [y, dy, ddy] = &mut out;
    differentiator.differentiate(rate_hz, q, Derivatives { q: y, dq: dy, ddq: ddy }).unwrap();
    out
}

pub(crate) fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt()
}

/// White noise of unit variance: sums of twelve uniform numbers from a linear congruential generator.
pub(crate) fn sums_of_uniforms(seed: u64, n: usize) -> Vec<f64> {
    let mut state = seed;
    let mut uniform = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..n).map(|_| (0..12).map(|_| uniform()).sum::<f64>() - 6.0).collect()
}
