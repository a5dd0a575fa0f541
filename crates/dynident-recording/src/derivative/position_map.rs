//! Differentiator that computes velocity and acceleration from the position on a known stroke (a commanded motion from
//! rest to rest).

use super::differentiator::{Derivatives, Differentiator, Place, SampleRanges, add_sample};
use super::reference_lag::{check_joint, check_max_lag, lags, samples_of};
use crate::error::FilterError;
use crate::reference::Reference;
use std::sync::Arc;

/// Number of bisections; they reduce the interval for the time within any stroke below the resolution of the time.
const BISECTIONS: usize = 60;

/// On a monotone stroke, the position q determines the velocity and the acceleration: `dq = g(q)`, `ddq = g'(q) g(q)`.
/// For logistic strokes, there is a closed form (Eqs. 15 and 16 of *Iterative Identification of Robot Dynamic
/// Parameters Based on Logistic Function*, [`LogisticPath::rates`](crate::LogisticPath::rates)). For any other
/// reference q_d, `q_d(s) = q` is solved for the time s within the stroke.
///
/// * The stroke and its direction (there or back) are selected for the time `t - δ` with the estimated lag δ of the
///   joint (one lag for each stroke, by least squares), because a joint that lags is still on the previous stroke.
/// * Samples are marked as invalid outside the range of the stroke, where the formulas have the wrong sign, and on
///   strokes that reverse or that the joint does not follow within the maximum lag.
/// * Where the reference rests, velocity and acceleration are those of the reference, at most 1e-3 of their peaks.
///
/// Position noise σ causes at most ωσ in dq and ω²σ in ddq. A pure lag causes no error; any other tracking error e =
/// q_d - q biases dq by `ė - g'(q) e`, |g'| <= ω. The position is not filtered. The selection by lag and the rejection
/// of samples were developed for Dynident.
#[derive(Clone, Debug)]
pub struct PositionMap {
    reference: Arc<Reference>,
    max_lag_s: f64,
}

impl PositionMap {
    /// Creates a differentiator for joints that follow `reference` with a lag of at most `max_lag_s`.
    ///
    /// # Errors
    /// If `max_lag_s` is not positive and at most 60.
    pub fn new(reference: Arc<Reference>, max_lag_s: f64) -> Result<Self, FilterError> {
        check_max_lag(max_lag_s)?;
        Ok(Self { reference, max_lag_s })
    }

    /// Velocity and acceleration at `q` on the stroke of a sampled reference between two times.
    fn rates_at_position(&self, joint: usize, q: f64, from_s: f64, to_s: f64) -> Option<[f64; 2]> {
        let [start, end] = [from_s, to_s].map(|t| self.reference.at(joint, t)[0]);
        let upward = end > start;
        let below = |x: f64| if upward { x < q } else { x > q };
        if !(below(start) && (end != q) && !below(end)) {
            return None;
        }
        let (mut low, mut high) = (from_s, to_s);
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if below(self.reference.at(joint, middle)[0]) {
                low = middle;
            } else {
                high = middle;
            }
        }
        let [_, dq, ddq] = self.reference.at(joint, 0.5 * (low + high));
        Some([dq, ddq])
    }
}

impl Differentiator for PositionMap {
    fn name(&self) -> &'static str {
        "position-map"
    }

    fn minimum_samples(&self) -> usize {
        2
    }

    fn differentiate_at(&self, place: Place, q: &[f64], out: Derivatives<'_>) -> Result<SampleRanges, FilterError> {
        let reference = &*self.reference;
        check_joint(reference, place)?;
        let joint = place.joint;
        out.q[..q.len()].copy_from_slice(q);
        out.dq[..q.len()].fill(0.0);
        out.ddq[..q.len()].fill(0.0);
        let mut marked = Vec::new();
        let (common, strokes) = lags(reference, place, q, self.max_lag_s)?;
        for lag in strokes {
            let stroke = lag.stroke;
            for i in samples_of(&stroke, common, place, q.len()) {
                let time_s = place.time_s(i) - lag.lag_s;
                let rates = if lag.at_limit {
                    None
                } else if reference.rests(joint, time_s) {
                    let [_, dq, ddq] = reference.at(joint, time_s);
                    Some([dq, ddq])
                } else if !stroke.monotone {
                    None
                } else if let Some(path) = reference.logistic_path(joint) {
                    path.rates(q[i], reference.goes_there(joint, time_s))
                } else {
                    self.rates_at_position(joint, q[i], stroke.from_s, stroke.to_s)
                };
                match rates {
                    Some(rates) => [out.dq[i], out.ddq[i]] = rates,
                    None => add_sample(&mut marked, i),
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
        LogisticPath { amplitude: -1.5, omega: 1.3, offset: 0.4, period_s: 40.0 / 1.3, repetitions: 2 };

    fn place() -> Place {
        Place { rate_hz: 100.0, joint: 0, first_time_s: 0.0 }
    }

    fn mapped(reference: Reference, q: &[f64]) -> ([Vec<f64>; 3], Vec<Range<usize>>) {
        let mut out = [vec![0.0; q.len()], vec![0.0; q.len()], vec![0.0; q.len()]];
        let [y, dy, ddy] = &mut out;
        let map = PositionMap::new(Arc::new(reference), 0.5).unwrap();
        let marked = map.differentiate_at(place(), q, Derivatives { q: y, dq: dy, ddq: ddy }).unwrap();
        (out, marked)
    }

    fn sampled() -> Reference {
        let times: Vec<f64> = (0..6155).map(|i| f64::from(i) * 0.01).collect();
        let columns = [0, 1, 2].map(|order| times.iter().map(|t| PATH.at(*t)[order]).collect());
        Reference::sampled(&times, &[columns]).unwrap()
    }

    #[test]
    fn a_lagging_joint_is_mapped_exactly_also_past_the_splices() {
        let lag = 0.31;
        let q: Vec<f64> = (0..6100).map(|i| PATH.at(place().time_s(i) - lag)[0]).collect();
        // The sampled reference equals the closed form to 1e-12 in q; near the ends of a stroke the error of its
        // inverse is divided by the small velocity.
        for (reference, tolerance) in [(Reference::logistic(&[PATH]).unwrap(), 1e-6), (sampled(), 1e-5)] {
            let ([_, dq, ddq], marked) = mapped(reference, &q);
            assert!(marked.is_empty(), "{marked:?}");
            for i in 0..q.len() {
                let t = place().time_s(i) - lag;
                let [_, exact, second] = PATH.at(t);
                // A splice is at rest only to 1e-3 of the peak, and the estimated lag is not yet valid at the first
                // sample.
                let near_rest = 1e-3 * PATH.peaks()[0];
                if exact.abs() > 2.0 * near_rest {
                    assert!((dq[i] - exact).abs() < tolerance && (ddq[i] - second).abs() < tolerance, "{i}");
                } else {
                    assert!(dq[i].abs() < 4.0 * near_rest, "{i}: {}", dq[i]);
                }
            }
        }
    }

    #[test]
    fn a_wrong_branch_would_show_and_samples_outside_the_stroke_are_marked() {
        // An overshoot by 5 %: the position exceeds h + A while the reference still moves.
        let q: Vec<f64> =
            (0..6100).map(|i| PATH.offset + 1.05 * (PATH.at(place().time_s(i))[0] - PATH.offset)).collect();
        let outside = |x: f64| !(0.0..=1.0).contains(&((x - PATH.offset) / PATH.amplitude));
        for reference in [Reference::logistic(&[PATH]).unwrap(), sampled()] {
            let ([_, dq, _], marked) = mapped(reference, &q);
            assert!(!marked.is_empty());
            let is_marked = |i: usize| marked.iter().any(|range| range.contains(&i));
            for i in 0..q.len() {
                let t = place().time_s(i);
                let exact = PATH.at(t)[1];
                if is_marked(i) {
                    assert_eq!(dq[i], 0.0);
                } else if exact.abs() > 0.05 {
                    assert!(!outside(q[i]) && dq[i] * exact > 0.0, "{i}: the wrong sign");
                }
            }
        }
    }

    #[test]
    fn noise_grows_by_omega_and_its_square_at_most() {
        let sigma = 1e-4;
        let n = 6100;
        let clean: Vec<f64> = (0..n).map(|i| PATH.at(place().time_s(i))[0]).collect();
        let noise = normal(1, n);
        let noisy: Vec<f64> = clean.iter().zip(&noise).map(|(q, e)| q + sigma * e).collect();
        let ([_, dq, ddq], marked) = mapped(Reference::logistic(&[PATH]).unwrap(), &noisy);
        let middle: Vec<usize> = (0..n).filter(|&i| PATH.at(place().time_s(i))[1].abs() > 0.1).collect();
        assert!(marked.iter().all(|range| middle.iter().all(|i| !range.contains(i))));
        let mut errors = [Vec::new(), Vec::new()];
        let mut expected = [0.0, 0.0];
        for &i in &middle {
            let [q, speed, acceleration] = PATH.at(place().time_s(i));
            errors[0].push(dq[i] - speed);
            errors[1].push(ddq[i] - acceleration);
            // g' = ±ω(1 - 2s) and (g'g)' = ω²(1 - 6s + 6s²), with s the completed share of the stroke.
            let s = (q - PATH.offset) / PATH.amplitude;
            expected[0] += (PATH.omega * (1.0 - 2.0 * s)).powi(2) / middle.len() as f64;
            expected[1] += (PATH.omega.powi(2) * (1.0 - 6.0 * s + 6.0 * s * s)).powi(2) / middle.len() as f64;
        }
        for order in 0..2 {
            let bound = sigma * PATH.omega.powi(order as i32 + 1);
            assert!(rms(&errors[order]) <= bound);
            // About 2000 samples: 2 % standard deviation; five deviations are allowed.
            assert!((rms(&errors[order]) / (sigma * expected[order].sqrt()) - 1.0).abs() < 0.1, "{order}");
        }
    }

    #[test]
    fn a_joint_that_does_not_follow_is_marked_and_one_at_rest_is_at_rest() {
        let q: Vec<f64> = (0..3000).map(|i| PATH.at(place().time_s(i) - 2.0)[0]).collect();
        let (_, marked) = mapped(Reference::logistic(&[PATH]).unwrap(), &q);
        assert!(!marked.is_empty());
        let still = LogisticPath { amplitude: 0.0, ..PATH };
        let ([_, dq, _], marked) = mapped(Reference::logistic(&[still]).unwrap(), &[0.41; 100]);
        assert!(marked.is_empty() && dq.iter().all(|x| *x == 0.0));
    }
}
