//! Differentiator that evaluates the commanded motion (reference) at a shifted time, with one shift per stroke.

use super::differentiator::{Derivatives, Differentiator, Place, SampleRanges, add_sample};
use super::reference_lag::{check_joint, check_max_lag, lags, samples_of};
use crate::error::FilterError;
use crate::reference::Reference;
use std::sync::Arc;

/// Takes the derivatives of the reference q_d at a shifted time: `dq(t) = dq_d(t - δ_s)`, `ddq(t) = ddq_d(t - δ_s)`,
/// with one lag δ_s for each stroke s of the joint (by least squares). The position is not filtered.
///
/// The result is exact if the lag is constant over a stroke. White position noise σ causes `|ddq_d| σ/√(Σ dq_d²)` in dq
/// and `|jerk_d| σ/√(Σ dq_d²)` in ddq. With a thousand samples, this is a thirtieth of the noise of
/// [`PositionMap`](super::PositionMap). Any other deviation (overshoot, vibration, wrong amplitude) is ignored and
/// causes bias. Samples of strokes that the joint does not follow within the maximum lag are marked as invalid. This
/// method was developed for Dynident.
#[derive(Clone, Debug)]
pub struct TimeWarp {
    reference: Arc<Reference>,
    max_lag_s: f64,
}

impl TimeWarp {
    /// Creates a differentiator for joints that follow `reference` with a lag of at most `max_lag_s`.
    ///
    /// # Errors
    /// If `max_lag_s` is not positive and at most 60.
    pub fn new(reference: Arc<Reference>, max_lag_s: f64) -> Result<Self, FilterError> {
        check_max_lag(max_lag_s)?;
        Ok(Self { reference, max_lag_s })
    }
}

impl Differentiator for TimeWarp {
    fn name(&self) -> &'static str {
        "time-warp"
    }

    fn minimum_samples(&self) -> usize {
        2
    }

    fn differentiate_at(&self, place: Place, q: &[f64], out: Derivatives<'_>) -> Result<SampleRanges, FilterError> {
        check_joint(&self.reference, place)?;
        out.q[..q.len()].copy_from_slice(q);
        out.dq[..q.len()].fill(0.0);
        out.ddq[..q.len()].fill(0.0);
        let mut marked = Vec::new();
        let (common, strokes) = lags(&self.reference, place, q, self.max_lag_s)?;
        for lag in strokes {
            for i in samples_of(&lag.stroke, common, place, q.len()) {
                let time_s = place.time_s(i) - lag.lag_s;
                if lag.at_limit || !self.reference.covers(place.joint, time_s) {
                    add_sample(&mut marked, i);
                } else {
                    [_, out.dq[i], out.ddq[i]] = self.reference.at(place.joint, time_s);
                }
            }
        }
        Ok(marked)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::derivative::test_signals::{normal, rms};
    use crate::reference::LogisticPath;
    use core::ops::Range;

    const PATH: LogisticPath =
        LogisticPath { amplitude: 1.8, omega: 1.1, offset: 0.0, period_s: 40.0 / 1.1, repetitions: 1 };

    fn warped(q: &[f64]) -> ([Vec<f64>; 3], Vec<Range<usize>>) {
        let mut out = [vec![0.0; q.len()], vec![0.0; q.len()], vec![0.0; q.len()]];
        let [y, dy, ddy] = &mut out;
        let warp = TimeWarp::new(Arc::new(Reference::logistic(&[PATH]).unwrap()), 0.4).unwrap();
        let place = Place { rate_hz: 100.0, joint: 0, first_time_s: 0.0 };
        let marked = warp.differentiate_at(place, q, Derivatives { q: y, dq: dy, ddq: ddy }).unwrap();
        (out, marked)
    }

    #[test]
    fn noise_decreases_with_the_length_of_a_stroke() {
        let (sigma, n, lag) = (1e-3, 1800_usize, 0.07);
        let exact: Vec<[f64; 3]> = (0..n).map(|i| PATH.at(i as f64 / 100.0 - lag)).collect();
        let power: f64 = exact.iter().map(|x| x[1] * x[1]).sum();
        let at = (0..n).max_by(|a, b| exact[*a][2].total_cmp(&exact[*b][2])).unwrap();
        let errors: Vec<f64> = (0..100)
            .map(|run| {
                let q: Vec<f64> = exact.iter().zip(normal(run, n)).map(|(x, e)| x[0] + sigma * e).collect();
                let (out, marked) = warped(&q);
                assert!(marked.is_empty());
                out[1][at] - exact[at][1]
            })
            .collect();
        // 100 runs: 7 % standard deviation; four deviations are allowed.
        let expected = exact[at][2].abs() * sigma / power.sqrt();
        assert!((rms(&errors) / expected - 1.0).abs() < 0.28, "{} {expected}", rms(&errors));
    }

    #[test]
    fn a_joint_that_does_not_follow_is_marked() {
        let q: Vec<f64> = (0..1800).map(|i| PATH.at(f64::from(i) / 100.0 - 3.0)[0]).collect();
        let (out, marked) = warped(&q);
        assert!(!marked.is_empty() && out[1][marked[0].start] == 0.0);
    }
}
