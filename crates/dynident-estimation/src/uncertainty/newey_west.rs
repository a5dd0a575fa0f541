//! Newey-West covariance: the scores of time segments are correlated with their neighbours, with a weight that
//! decreases with the lag.
//!
//! ```text
//!     S = Σ_g s_g s_gᵀ + Σ_{l=1}^{L} (1 − l/(L+1)) Σ_g (s_g s_{g−l}ᵀ + s_{g−l} s_gᵀ)
//! ```
//!
//! The series are the segments of one joint in one log; with segments of one row it is the textbook form. Newey and
//! West, Econometrica 55 (1987) 703; bandwidth of Review of Economic Studies 61 (1994) 631, with the trace of the
//! whitened scores' autocovariances (independent of units) in place of the arbitrary weights.

use nalgebra::{DMatrix, DVector};

/// Bandwidth of Bartlett's kernel.
///
/// `L = ⌊1.1447 (s₁/s₀)^(2/3) T^(1/3)⌋`, `s₀ = γ_0 + 2 Σ γ_l`, `s₁ = 2 Σ l γ_l` over l = 1..⌊4 (T/100)^(2/9)⌋, at most
/// T − 1.
pub(super) fn bandwidth(series: &[DVector<f64>]) -> usize {
    let count = series.len();
    if count < 3 {
        return 0;
    }
    let pilot = ((4.0 * (count as f64 / 100.0).powf(2.0 / 9.0)) as usize).clamp(1, count - 1);
    let (mut s0, mut s1) = (autocovariance(series, 0), 0.0);
    for lag in 1..=pilot {
        let value = autocovariance(series, lag);
        s0 += 2.0 * value;
        s1 += 2.0 * lag as f64 * value;
    }
    // A sum that is not positive (alternating scores) gives no decay time.
    if s0 <= 0.0 {
        return 0;
    }
    let bandwidth = 1.1447 * ((s1 / s0).powi(2)).cbrt() * (count as f64).cbrt();
    (bandwidth as usize).min(count - 1)
}

fn autocovariance(series: &[DVector<f64>], lag: usize) -> f64 {
    series.iter().zip(&series[lag..]).map(|(early, late)| early.dot(late)).sum()
}

/// Long-run covariance S of one series with the given bandwidth; positive semi-definite.
pub(super) fn long_run(series: &[DVector<f64>], size: usize, bandwidth: usize) -> DMatrix<f64> {
    let mut sum = DMatrix::zeros(size, size);
    for score in series {
        sum.ger(1.0, score, score, 1.0);
    }
    for lag in 1..=bandwidth.min(series.len().saturating_sub(1)) {
        let weight = 1.0 - lag as f64 / (bandwidth + 1) as f64;
        for (early, late) in series.iter().zip(&series[lag..]) {
            sum.ger(weight, early, late, 1.0);
            sum.ger(weight, late, early, 1.0);
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two scores a and b with L = 1: aa + bb + ½ (ab + ba).
    #[test]
    fn by_hand() {
        let series = [DVector::from_vec(vec![1.0, 2.0]), DVector::from_vec(vec![3.0, -1.0])];
        let expected =
            DMatrix::from_row_slice(2, 2, &[1.0 + 9.0 + 3.0, 2.0 - 3.0 + 2.5, 2.0 - 3.0 + 2.5, 4.0 + 1.0 - 2.0]);
        assert_eq!(long_run(&series, 2, 1), expected);
    }

    /// Scores that keep their sign for many steps need a longer kernel than independent ones. Alternating scores also
    /// need a long one, because the rule squares s₁/s₀.
    #[test]
    fn the_bandwidth_follows_the_correlation() {
        let one = |value: f64| DVector::from_vec(vec![value]);
        let slow: Vec<_> = (0..200).map(|k| one(if (k / 20) % 2 == 0 { 1.0 } else { -1.0 })).collect();
        let mut random = dynident_model::sample::Random::new(2);
        let fast: Vec<_> = (0..200).map(|_| one(random.normal())).collect();
        assert!(bandwidth(&slow) > 5, "{}", bandwidth(&slow));
        assert!(bandwidth(&fast) < bandwidth(&slow));
        assert_eq!(bandwidth(&slow[..2]), 0);
    }
}
