//! Savitzky-Golay differentiator: a polynomial that is fitted to a sliding window.

use super::differentiator::{Derivatives, Differentiator, Place, SampleRanges};
use crate::error::{FilterError, require};
use crate::filter::orthonormal::orthonormal_polynomials;

/// Computes value and derivatives at the centre of the least-squares polynomial of degree `degree` on `window` samples.
/// In the first and last half window, the polynomial of the first and last full window is evaluated. Equals
/// `scipy.signal.savgol_filter(q, window, degree, deriv=d, delta=1/rate, mode="interp")`. Source: Savitzky and Golay,
/// Anal. Chem. 36 (1964) 1627.
#[derive(Clone, Debug, PartialEq)]
pub struct SavitzkyGolay {
    window: usize,
    /// For each place in the window: weights of value, first and second derivative at unit step.
    weights: Vec<[Vec<f64>; 3]>,
}

impl SavitzkyGolay {
    /// Creates a filter over `window` samples.
    ///
    /// # Errors
    /// If `window` is even or beyond 501, or `degree` is not 2 to 8 and below `window`.
    pub fn new(window: usize, degree: usize) -> Result<Self, FilterError> {
        let fix = "give an odd number, 3 to 501";
        require(window % 2 == 1 && (3..=501).contains(&window), "window", window as f64, fix)?;
        let fix = "give 2 to 8, below the window";
        require((2..=8).contains(&degree) && degree < window, "degree", degree as f64, fix)?;
        Ok(Self { window, weights: polynomial_weights(window, degree) })
    }
}

/// Weights from polynomials that are orthonormal over the window, with the abscissa scaled to ±1.
fn polynomial_weights(window: usize, degree: usize) -> Vec<[Vec<f64>; 3]> {
    let half = (window / 2) as f64;
    let basis = orthonormal_polynomials(window, degree);
    (0..window)
        .map(|place| {
            [0, 1, 2].map(|derivative| {
                let step = half.powi(-(derivative as i32));
                (0..window).map(|j| step * basis.iter().map(|p| p[derivative][place] * p[0][j]).sum::<f64>()).collect()
            })
        })
        .collect()
}

impl SavitzkyGolay {
    fn at(&self, signal: &[f64], i: usize, derivative: usize) -> f64 {
        let from = i.saturating_sub(self.window / 2).min(signal.len() - self.window);
        let points = &signal[from..from + self.window];
        let weights = &self.weights[i - from][derivative];
        // Values are relative to the sample itself, so that rounding errors scale with the motion. The weights of the
        // value sum to one.
        let sum: f64 = weights.iter().zip(points).map(|(w, x)| w * (x - signal[i])).sum();
        if derivative == 0 { sum + signal[i] } else { sum }
    }
}

impl Differentiator for SavitzkyGolay {
    fn name(&self) -> &'static str {
        "savitzky-golay"
    }

    fn context_samples(&self, _rate_hz: f64) -> Option<usize> {
        Some(self.window)
    }

    fn minimum_samples(&self) -> usize {
        self.window
    }

    fn differentiate_at(&self, place: Place, q: &[f64], out: Derivatives<'_>) -> Result<SampleRanges, FilterError> {
        let rate_hz = place.rate_hz;
        self.check_length(q.len())?;
        for i in 0..q.len() {
            out.q[i] = self.at(q, i, 0);
            out.dq[i] = rate_hz * self.at(q, i, 1);
            out.ddq[i] = rate_hz * rate_hz * self.at(q, i, 2);
        }
        Ok(Vec::new())
    }

    fn smooth(&self, _rate_hz: f64, signal: &[f64], out: &mut [f64]) -> Result<(), FilterError> {
        self.check_length(signal.len())?;
        for (i, out) in out.iter_mut().enumerate().take(signal.len()) {
            *out = self.at(signal, i, 0);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_five_point_cubic_has_the_published_weights() {
        // Savitzky and Golay, table I: (-3, 12, 17, 12, -3) / 35.
        let filter = SavitzkyGolay::new(5, 3).unwrap();
        for (weight, published) in filter.weights[2][0].iter().zip([-3.0, 12.0, 17.0, 12.0, -3.0]) {
            assert!((weight - published / 35.0).abs() < 1e-14, "{weight}");
        }
    }

    #[test]
    fn bad_windows_are_refused() {
        for (window, degree) in [(4, 2), (3, 3), (0, 2), (1, 2), (100_001, 2), (5, 1)] {
            assert!(SavitzkyGolay::new(window, degree).is_err(), "{window} {degree}");
        }
    }
}
