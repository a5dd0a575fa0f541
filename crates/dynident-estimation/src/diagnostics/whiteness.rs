//! Ljung-Box test for residuals that are correlated in time.

use crate::uncertainty::chi_squared_tail;
use serde::{Deserialize, Serialize};

const LAGS: usize = 10;

/// Streaming autocorrelations up to lag 10, and the test of Ljung and Box, Biometrika 65 (1978) 297:
///
/// ```text
///     Q = N (N + 2) Σ_{l=1}^{10} ρ_l² / (N − l),   ρ_l = Σ r_t r_{t−l} / Σ r_t²,   Q ~ χ²(10) for white residuals
/// ```
///
/// The mean is not subtracted: an offset that the model lacks is also an error. Parameters fitted to other data use no
/// degree of freedom.
///
/// ```
/// use dynident_estimation::Whiteness;
/// let mut whiteness = Whiteness::default();
/// (0..200).for_each(|k| whiteness.add(f64::from(k).sin()));
/// assert!(whiteness.report().unwrap().p_value < 1e-6);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
#[doc(alias("ljung-box"))]
pub struct Whiteness {
    count: usize,
    recent: [f64; LAGS],
    products: [f64; LAGS],
    square: f64,
}

/// Result of the test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct WhitenessReport {
    /// Correlation of consecutive residuals (lag 1).
    pub lag1_correlation: f64,
    /// Q, the test statistic.
    pub ljung_box: f64,
    /// Number of lags in Q.
    pub lags: usize,
    /// p-value: probability of a larger Q if the residuals were white.
    pub p_value: f64,
}

impl Whiteness {
    /// Adds the next residual in order of time.
    pub fn add(&mut self, residual: f64) {
        for lag in 1..=LAGS.min(self.count) {
            self.products[lag - 1] += residual * self.recent[(self.count - lag) % LAGS];
        }
        self.recent[self.count % LAGS] = residual;
        self.square += residual * residual;
        self.count += 1;
    }

    /// Result of the test; `None` for 20 residuals or fewer, or if all are zero.
    pub fn report(&self) -> Option<WhitenessReport> {
        let n = self.count as f64;
        if self.count <= 2 * LAGS || self.square <= 0.0 || !self.square.is_finite() {
            return None;
        }
        let rho = |lag: usize| self.products[lag - 1] / self.square;
        let sum: f64 = (1..=LAGS).map(|lag| rho(lag).powi(2) / (n - lag as f64)).sum();
        let ljung_box = n * (n + 2.0) * sum;
        let p_value = chi_squared_tail(ljung_box, LAGS as f64);
        Some(WhitenessReport { lag1_correlation: rho(1), ljung_box, lags: LAGS, p_value })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::sample::Random;

    /// Of 400 white series the test at 5 % rejects 20 ± 4.4; the tolerance is 4 σ. It always rejects an AR(1) series
    /// with ρ = 0.5.
    #[test]
    fn white_residuals_are_rejected_at_the_nominal_rate() {
        let mut random = Random::new(7);
        let mut rejected = 0;
        for _ in 0..400 {
            let (mut white, mut coloured) = (Whiteness::default(), Whiteness::default());
            let mut last = 0.0;
            for _ in 0..300 {
                let fresh = random.normal();
                last = 0.5 * last + fresh;
                white.add(fresh);
                coloured.add(last);
            }
            rejected += usize::from(white.report().unwrap().p_value < 0.05);
            let found = coloured.report().unwrap();
            assert!(found.p_value < 1e-3 && (found.lag1_correlation - 0.5).abs() < 0.25, "{found:?}");
        }
        assert!((2..=38).contains(&rejected), "{rejected}");
    }

    /// Q computed directly for a short series.
    #[test]
    fn ljung_box_equals_the_formula() {
        let r: Vec<f64> = (0..30).map(|k| f64::from((k * 7) % 11) - 5.0).collect();
        let mut whiteness = Whiteness::default();
        for r in &r {
            whiteness.add(*r);
        }
        let square: f64 = r.iter().map(|x| x * x).sum();
        let q: f64 = (1..=10)
            .map(|lag| (lag..30).map(|t| r[t] * r[t - lag]).sum::<f64>() / square)
            .zip(1..)
            .map(|(rho, lag)| 30.0 * 32.0 * rho * rho / (30.0 - f64::from(lag)))
            .sum();
        assert!((whiteness.report().unwrap().ljung_box / q - 1.0).abs() < 1e-12);
        assert_eq!(Whiteness::default().report(), None);
    }
}
