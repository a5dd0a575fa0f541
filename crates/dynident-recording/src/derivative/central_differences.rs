//! Central differences of order 2 to 8 of the logged positions, without a filter.

use super::differentiator::{Derivatives, Differentiator, Place, SampleRanges};
use crate::error::{FilterError, require};

/// Finite differences on `order + 1` points: central inside the log, one-sided at its ends, exact for polynomials of
/// degree `order`. The position is not filtered.
///
/// The weights come from Fornberg's recursion: Math. Comp. 51 (1988) 699. The first derivative of order 2 is
/// `numpy.gradient(q, h, edge_order=2)`.
#[derive(Clone, Debug, PartialEq)]
pub struct CentralDifferences {
    order: usize,
    /// Weights of the first and second derivative at unit step, for each place among the points.
    weights: Vec<[Vec<f64>; 2]>,
}

impl CentralDifferences {
    /// Creates differences of accuracy `order`.
    ///
    /// # Errors
    /// If `order` is not 2, 4, 6 or 8.
    pub fn new(order: usize) -> Result<Self, FilterError> {
        require(matches!(order, 2 | 4 | 6 | 8), "order", order as f64, "give 2, 4, 6 or 8")?;
        let points: Vec<f64> = (0..=order).map(|i| i as f64).collect();
        let weights = (0..=order).map(|place| fornberg(place as f64, &points)).collect();
        Ok(Self { order, weights })
    }
}

impl Differentiator for CentralDifferences {
    fn name(&self) -> &'static str {
        "central-differences"
    }

    fn context_samples(&self, _rate_hz: f64) -> Option<usize> {
        Some(self.order)
    }

    fn minimum_samples(&self) -> usize {
        self.order + 1
    }

    fn differentiate_at(&self, place: Place, q: &[f64], out: Derivatives<'_>) -> Result<SampleRanges, FilterError> {
        let rate_hz = place.rate_hz;
        let (n, half) = (q.len(), self.order / 2);
        self.check_length(n)?;
        for i in 0..n {
            let from = i.saturating_sub(half).min(n - 1 - self.order);
            let [first, second] = &self.weights[i - from];
            let points = &q[from..=from + self.order];
            // Differences from the sample itself are used, so that rounding errors are relative to the motion and not
            // to the position.
            let sum = |weights: &[f64]| weights.iter().zip(points).map(|(w, x)| w * (x - q[i])).sum::<f64>();
            out.q[i] = q[i];
            out.dq[i] = rate_hz * sum(first);
            out.ddq[i] = rate_hz * rate_hz * sum(second);
        }
        Ok(Vec::new())
    }
}

/// Weights of the first and second derivative at `at`, for values at `points`.
fn fornberg(at: f64, points: &[f64]) -> [Vec<f64>; 2] {
    let n = points.len();
    let mut c = vec![[0.0; 3]; n];
    c[0][0] = 1.0;
    let mut c1 = 1.0;
    for i in 1..n {
        let highest = i.min(2);
        let mut c2 = 1.0;
        for j in 0..i {
            let c3 = points[i] - points[j];
            c2 *= c3;
            if j == i - 1 {
                for k in (0..=highest).rev() {
                    let lower = if k > 0 { k as f64 * c[i - 1][k - 1] } else { 0.0 };
                    c[i][k] = c1 * (lower - (points[i - 1] - at) * c[i - 1][k]) / c2;
                }
            }
            for k in (0..=highest).rev() {
                let lower = if k > 0 { k as f64 * c[j][k - 1] } else { 0.0 };
                c[j][k] = ((points[i] - at) * c[j][k] - lower) / c3;
            }
        }
        c1 = c2;
    }
    [1, 2].map(|k| c.iter().map(|weights| weights[k]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::derivative::test_signals::{differentiated, normal, rms};

    #[test]
    fn polynomials_up_to_the_order_are_differentiated_exactly_everywhere() {
        for order in [2_usize, 4, 6, 8] {
            let (n, rate) = (order + 5, 10.0);
            let t = |i: usize| i as f64 / rate;
            let power = order as i32;
            let q: Vec<f64> = (0..n).map(|i| t(i).powi(power) + t(i)).collect();
            let (mut y, mut dq, mut ddq) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
            let out = Derivatives { q: &mut y, dq: &mut dq, ddq: &mut ddq };
            CentralDifferences::new(order).unwrap().differentiate(rate, &q, out).unwrap();
            let p = f64::from(power);
            for i in 0..n {
                // Rounding: weights of up to 1e2, rate² = 1e2, 1e-16 each: far below 1e-10.
                assert!((dq[i] - p * t(i).powi(power - 1) - 1.0).abs() < 1e-10, "order {order}, sample {i}");
                assert!((ddq[i] - p * (p - 1.0) * t(i).powi(power - 2)).abs() < 1e-10, "order {order}, sample {i}");
            }
        }
    }

    #[test]
    fn noise_gain_follows_the_closed_form() {
        let (rate, n) = (1000.0, 40_000);
        let out = differentiated(&CentralDifferences::new(2).unwrap(), rate, &normal(11, n));
        // 1/(√2 dt) and √6/dt². For 40 000 samples one standard deviation is below 1 %; four are allowed.
        assert!((rms(&out[1]) / (rate / 2.0_f64.sqrt()) - 1.0).abs() < 0.04);
        assert!((rms(&out[2]) / (rate * rate * 6.0_f64.sqrt()) - 1.0).abs() < 0.04);
    }

    #[test]
    fn odd_orders_are_refused() {
        assert!(CentralDifferences::new(3).is_err());
        assert!(CentralDifferences::new(0).is_err());
    }
}
