//! Jarque-Bera test for normally distributed residuals.

use serde::{Deserialize, Serialize};

/// Streaming moments, and the test of Jarque and Bera, International Statistical Review 55 (1987) 163:
///
/// ```text
///     JB = N/6 (S² + (K − 3)²/4) ~ χ²(2),   S = m₃ / m₂^(3/2),   K = m₄ / m₂²
/// ```
///
/// Heavy tails (K far above 3) are usual on robots: friction at reversals, contacts, lost samples. The test assumes
/// independent residuals; with coloured ones it rejects too often.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[doc(alias("jarque-bera"))]
pub struct Normality {
    count: f64,
    mean: f64,
    second: f64,
    third: f64,
    fourth: f64,
}

/// Result of the test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct NormalityReport {
    /// Mean residual, Nm (N).
    pub mean_nm: f64,
    /// S: 0 for a symmetric distribution.
    pub skewness: f64,
    /// K: 3 for the normal distribution.
    pub kurtosis: f64,
    /// JB, the test statistic.
    pub jarque_bera: f64,
    /// p-value: probability of a larger JB if the residuals were normally distributed and independent.
    pub p_value: f64,
}

impl Normality {
    /// Adds a residual. Central moments are updated without cancellation: Pébay, Sandia report SAND2008-6212 (2008).
    pub fn add(&mut self, residual: f64) {
        let before = self.count;
        self.count += 1.0;
        let n = self.count;
        let delta = residual - self.mean;
        let step = delta / n;
        let term = delta * step * before;
        self.mean += step;
        self.fourth +=
            term * step * step * (n * n - 3.0 * n + 3.0) + 6.0 * step * step * self.second - 4.0 * step * self.third;
        self.third += term * step * (n - 2.0) - 3.0 * step * self.second;
        self.second += term;
    }

    /// Result of the test; `None` for fewer than eight or all equal residuals.
    pub fn report(&self) -> Option<NormalityReport> {
        let (n, variance) = (self.count, self.second / self.count);
        if n < 8.0 || variance.is_nan() || variance <= 0.0 || !self.fourth.is_finite() {
            return None;
        }
        let skewness = self.third / n / variance.powf(1.5);
        let kurtosis = self.fourth / n / (variance * variance);
        let jarque_bera = n / 6.0 * (skewness * skewness + 0.25 * (kurtosis - 3.0).powi(2));
        // χ²(2) is exponential.
        Some(NormalityReport {
            mean_nm: self.mean,
            skewness,
            kurtosis,
            jarque_bera,
            p_value: (-0.5 * jarque_bera).exp(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Moments of the whole numbers 0..n: symmetric, kurtosis 3/5 (3n² − 7)/(n² − 1).
    #[test]
    fn moments_of_a_uniform_grid() {
        let n = 1000.0;
        let mut normality = Normality::default();
        (0..1000).for_each(|k| normality.add(1e3 + f64::from((k * 7) % 1000)));
        let report = normality.report().unwrap();
        assert!((report.mean_nm - 1499.5).abs() < 1e-9 && report.skewness.abs() < 1e-10, "{report:?}");
        let kurtosis = 0.6 * (3.0 * n * n - 7.0) / (n * n - 1.0);
        assert!((report.kurtosis - kurtosis).abs() < 1e-9 && report.p_value < 1e-6, "{report:?}");
        assert_eq!(Normality::default().report(), None);
    }
}
