//! Differentiator that smooths only the deviation of a joint from its commanded motion (reference).

use super::differentiator::{Derivatives, Differentiator, Place, SampleRanges, add_sample};
use super::reference_lag::{check_joint, check_max_lag, piece_lag};
use crate::error::FilterError;
use crate::reference::Reference;
use std::sync::Arc;

/// The position is `q = q_d + e` with the reference q_d and the deviation e. Another differentiator S smooths and
/// differentiates e, and the exact derivatives of the reference are added:
///
/// `dq = dq_d + S{e}'`, `ddq = ddq_d + S{e}''`
///
/// A linear smoother with the frequency response H removes `(1 - H) e` instead of `(1 - H) q`. Its bias is therefore
/// smaller by the ratio of e to q, and its noise is unchanged: there is less bias at equal noise, or, with a lower
/// cut-off, less noise at equal bias. With `max_lag_s`, the reference is first shifted by the lag of the whole piece,
/// so that a delay does not contribute to e. If the reference ends in motion, samples after its end are marked as
/// invalid. This method was developed for Dynident.
#[derive(Debug)]
pub struct Deviation {
    reference: Arc<Reference>,
    smoother: Box<dyn Differentiator>,
    max_lag_s: Option<f64>,
}

impl Deviation {
    /// Creates a differentiator that smooths the deviation from `reference` by `smoother`. If `max_lag_s` is given, the
    /// reference is first shifted by a lag of at most this time.
    ///
    /// # Errors
    /// If `max_lag_s` is not positive and at most 60.
    pub fn new(
        reference: Arc<Reference>,
        smoother: Box<dyn Differentiator>,
        max_lag_s: Option<f64>,
    ) -> Result<Self, FilterError> {
        if let Some(max_lag_s) = max_lag_s {
            check_max_lag(max_lag_s)?;
        }
        Ok(Self { reference, smoother, max_lag_s })
    }
}

impl Differentiator for Deviation {
    fn name(&self) -> &'static str {
        "deviation"
    }

    fn context_samples(&self, rate_hz: f64) -> Option<usize> {
        if self.max_lag_s.is_some() { None } else { self.smoother.context_samples(rate_hz) }
    }

    fn minimum_samples(&self) -> usize {
        self.smoother.minimum_samples()
    }

    fn differentiate_at(&self, place: Place, q: &[f64], out: Derivatives<'_>) -> Result<SampleRanges, FilterError> {
        check_joint(&self.reference, place)?;
        let lag_s = match self.max_lag_s {
            Some(longest) => piece_lag(&self.reference, place, q, longest)?,
            None => 0.0,
        };
        let time_s = |i: usize| place.time_s(i) - lag_s;
        // Where the reference is not known, the deviation of the nearest known sample is repeated, because a jump would
        // disturb valid samples.
        let known: Vec<bool> = (0..q.len()).map(|i| self.reference.covers(place.joint, time_s(i))).collect();
        let mut deviation = vec![0.0; q.len()];
        let mut last = (0..q.len()).find(|&i| known[i]).unwrap_or(0);
        for i in 0..q.len() {
            last = if known[i] { i } else { last };
            deviation[i] = q[last] - self.reference.at(place.joint, time_s(last))[0];
        }
        let inner = Derivatives { q: &mut *out.q, dq: &mut *out.dq, ddq: &mut *out.ddq };
        let mut marked = self.smoother.differentiate_at(place, &deviation, inner)?;
        for i in 0..q.len() {
            let [q_d, dq_d, ddq_d] = self.reference.at(place.joint, time_s(i));
            out.q[i] += q_d;
            out.dq[i] += dq_d;
            out.ddq[i] += ddq_d;
            if !known[i] {
                add_sample(&mut marked, i);
            }
        }
        Ok(marked)
    }

    fn smooth(&self, rate_hz: f64, signal: &[f64], out: &mut [f64]) -> Result<(), FilterError> {
        self.smoother.smooth(rate_hz, signal, out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::derivative::butterworth::ButterworthZeroPhase;
    use crate::derivative::test_signals::{differentiated, normal};
    use crate::reference::LogisticPath;

    const PATH: LogisticPath =
        LogisticPath { amplitude: 1.8, omega: 3.0, offset: 0.0, period_s: 40.0 / 3.0, repetitions: 1 };

    fn deviation(cutoff_hz: f64, max_lag_s: Option<f64>) -> Deviation {
        let smoother = Box::new(ButterworthZeroPhase::new(4, cutoff_hz).unwrap());
        Deviation::new(Arc::new(Reference::logistic(&[PATH]).unwrap()), smoother, max_lag_s).unwrap()
    }

    #[test]
    fn a_perfect_follower_is_differentiated_exactly_by_any_smoother() {
        for (lag, max_lag_s) in [(0.0, None), (0.0, Some(0.2)), (0.11, Some(0.2))] {
            let exact: Vec<[f64; 3]> = (0..1300).map(|i| PATH.at(f64::from(i) / 100.0 - lag)).collect();
            let q: Vec<f64> = exact.iter().map(|x| x[0]).collect();
            // The cut-off is far below the motion, but the deviation is zero.
            let out = differentiated(&deviation(0.2, max_lag_s), 100.0, &q);
            for i in 0..1300 {
                for order in 0..3 {
                    // The lag is accurate to 1e-6 s at least, multiplied by the velocities.
                    assert!((out[order][i] - exact[i][order]).abs() < 2e-5, "{order} {i}");
                }
            }
        }
    }

    #[test]
    fn noise_is_smoothed_and_the_reference_is_exact() {
        // Because the smoother is linear, the noise is that of the smoother, for any reference.
        let n = 1000;
        let noise: Vec<f64> = normal(2, n).iter().map(|e| 1e-3 * e).collect();
        let clean: Vec<f64> = (0..n).map(|i| PATH.at(i as f64 / 100.0)[0]).collect();
        let q: Vec<f64> = clean.iter().zip(&noise).map(|(q, e)| q + e).collect();
        let ours = differentiated(&deviation(5.0, None), 100.0, &q);
        let smoothed = differentiated(&ButterworthZeroPhase::new(4, 5.0).unwrap(), 100.0, &noise);
        for i in 0..n {
            let exact = PATH.at(i as f64 / 100.0);
            for order in 0..3 {
                assert!((ours[order][i] - exact[order] - smoothed[order][i]).abs() < 1e-10);
            }
        }
    }

    #[test]
    fn samples_after_a_reference_that_ends_in_motion_are_marked() {
        let times: Vec<f64> = (0..101).map(|i| f64::from(i) * 0.01).collect();
        let columns = [times.clone(), vec![1.0; 101], vec![0.0; 101]];
        let reference = Arc::new(Reference::sampled(&times, &[columns]).unwrap());
        let smoother = Box::new(crate::derivative::CentralDifferences::new(2).unwrap());
        let differentiator = Deviation::new(reference, smoother, None).unwrap();
        let q: Vec<f64> = (0..150).map(|i| f64::from(i) * 0.01).collect();
        let mut out = [vec![0.0; 150], vec![0.0; 150], vec![0.0; 150]];
        let [y, dy, ddy] = &mut out;
        let place = Place { rate_hz: 100.0, joint: 0, first_time_s: 0.0 };
        let marked = differentiator.differentiate_at(place, &q, Derivatives { q: y, dq: dy, ddq: ddy }).unwrap();
        assert_eq!(marked, vec![101..150; 1]);
        assert!((out[1][50] - 1.0).abs() < 1e-12);
    }
}
