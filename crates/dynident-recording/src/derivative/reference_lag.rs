//! Estimation of the lag of a joint behind its commanded motion (reference), stroke by stroke.

use super::differentiator::Place;
use crate::error::{FilterError, require};
use crate::reference::Reference;
use crate::reference::Stroke;

const MAX_COARSE_SAMPLES: usize = 400;
/// Number of lags on either side of zero that the coarse search tries.
const COARSE_LAGS: i32 = 50;
/// Maximum number of Gauss-Newton steps; each step is at most half of the previous one.
const MAX_ITERATIONS: usize = 30;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StrokeLag {
    pub(super) stroke: Stroke,
    /// Lag of the joint behind its reference, s; 0 if no sample of the stroke is in the piece.
    pub(super) lag_s: f64,
    /// Whether the best lag is at the limit of the search. In this case the joint does not follow this reference.
    pub(super) at_limit: bool,
}

/// For every stroke of the joint's reference, the lag δ that minimises `Σ (q(t) - q_d(t - δ))²` over the stroke's
/// samples, |δ| <= `max_lag_s`, with the measured position q and the reference q_d. A coarse search is followed by
/// Gauss-Newton steps with `∂/∂δ q_d(t - δ) = -dq_d(t - δ)`. White position noise σ causes a standard deviation of the
/// lag of `σ/√(Σ dq_d²)`.
///
/// Returns the lag of the whole piece (with which samples are assigned to strokes) and the lags of the strokes.
///
/// # Errors
/// [`FilterError::Setting`] if `max_lag_s` is not positive, finite and at most 60; [`FilterError::Reference`] if the
/// reference has no such joint.
pub(super) fn lags(
    reference: &Reference,
    place: Place,
    q: &[f64],
    max_lag_s: f64,
) -> Result<(f64, Vec<StrokeLag>), FilterError> {
    let common = piece_lag(reference, place, q, max_lag_s)?;
    let strokes = reference.strokes(place.joint).into_iter().map(|stroke| {
        let samples = samples_of(&stroke, common, place, q.len());
        if samples.is_empty() {
            return StrokeLag { stroke, lag_s: 0.0, at_limit: false };
        }
        let (lag_s, at_limit) = best(reference, place, q, samples, [-max_lag_s, max_lag_s]);
        StrokeLag { stroke, lag_s, at_limit }
    });
    Ok((common, strokes.collect()))
}

/// The lag of the whole piece.
///
/// # Errors
/// As [`lags`].
pub(super) fn piece_lag(reference: &Reference, place: Place, q: &[f64], max_lag_s: f64) -> Result<f64, FilterError> {
    check_max_lag(max_lag_s)?;
    check_joint(reference, place)?;
    let (lag_s, _) = best(reference, place, q, 0..q.len(), [-max_lag_s, max_lag_s]);
    Ok(lag_s)
}

pub(super) fn check_max_lag(max_lag_s: f64) -> Result<(), FilterError> {
    require(max_lag_s > 0.0 && max_lag_s <= 60.0, "max_lag_s", max_lag_s, "give seconds, above 0 and at most 60")
}

pub(super) fn check_joint(reference: &Reference, place: Place) -> Result<(), FilterError> {
    if place.joint < reference.joints() {
        return Ok(());
    }
    let problem = format!("it moves {} joints, and the log has more: give one for each", reference.joints());
    Err(FilterError::Reference { problem })
}

/// Samples that belong to a stroke, for a joint with the lag `lag_s`.
pub(super) fn samples_of(stroke: &Stroke, lag_s: f64, place: Place, samples: usize) -> core::ops::Range<usize> {
    // The conversion of infinite times to an index saturates.
    let index =
        |time_s: f64| (((time_s + lag_s - place.first_time_s) * place.rate_hz).ceil().max(0.0) as usize).min(samples);
    index(stroke.owns_from_s)..index(stroke.owns_to_s)
}

/// Best lag over `samples`, and whether it is at the limit of the search.
fn best(
    reference: &Reference,
    place: Place,
    q: &[f64],
    samples: core::ops::Range<usize>,
    range_s: [f64; 2],
) -> (f64, bool) {
    let [least, most] = range_s;
    let joint = place.joint;
    let step = (samples.len() / MAX_COARSE_SAMPLES).max(1);
    let known = |i: usize, lag_s: f64| reference.covers(joint, place.time_s(i) - lag_s);
    let mean_square = |lag_s: f64, step: usize| {
        let (mut squares, mut count) = (0.0, 0);
        for i in samples.clone().step_by(step).filter(|&i| known(i, lag_s)) {
            squares += (q[i] - reference.at(joint, place.time_s(i) - lag_s)[0]).powi(2);
            count += 1;
        }
        if count > 0 { squares / f64::from(count) } else { f64::INFINITY }
    };
    let mut lag_s = (-COARSE_LAGS..=COARSE_LAGS)
        .map(|k| most * f64::from(k) / f64::from(COARSE_LAGS))
        .map(|lag_s| (mean_square(lag_s, step), lag_s))
        .fold((f64::INFINITY, 0.0), |best, tried| if tried.0 < best.0 { tried } else { best })
        .1;
    for _ in 0..MAX_ITERATIONS {
        let (mut gradient, mut curvature) = (0.0, 0.0);
        for i in samples.clone().filter(|&i| known(i, lag_s)) {
            let [q_d, dq_d, _] = reference.at(joint, place.time_s(i) - lag_s);
            gradient += dq_d * (q_d - q[i]);
            curvature += dq_d * dq_d;
        }
        // A step is at most one step of the coarse search, so that the iteration stays in the minimum that the search
        // found.
        let longest = most / f64::from(COARSE_LAGS);
        let change = (gradient / curvature).clamp(-longest, longest);
        if !change.is_finite() {
            break;
        }
        let before = lag_s;
        lag_s = (lag_s + change).clamp(least, most);
        if (lag_s - before).abs() <= 1e-15 + 1e-9 * longest {
            break;
        }
    }
    let moves = reference.peak_velocity(joint) > 0.0;
    let rms = mean_square(lag_s, 1).sqrt();
    (lag_s, moves && (lag_s <= least || lag_s >= most || !rms.is_finite()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::derivative::test_signals::{normal, rms};
    use crate::reference::LogisticPath;

    const PATH: LogisticPath =
        LogisticPath { amplitude: 2.0, omega: 1.2, offset: 0.1, period_s: 40.0 / 1.2, repetitions: 1 };

    fn place() -> Place {
        Place { rate_hz: 100.0, joint: 0, first_time_s: -1.0 }
    }

    #[test]
    fn each_stroke_has_a_separate_lag() {
        let reference = Reference::logistic(&[PATH]).unwrap();
        let half = 0.5 * PATH.period_s;
        let q: Vec<f64> = (0..3600)
            .map(|i| {
                let t = place().time_s(i);
                PATH.at(t - if t < half { 0.123 } else { -0.05 })[0]
            })
            .collect();
        let strokes = lags(&reference, place(), &q, 0.5).unwrap().1;
        assert_eq!(strokes.len(), 2);
        for (found, lag_s) in strokes.iter().zip([0.123, -0.05]) {
            // The rest between strokes is shifted by the wrong lag for some samples, where the reference moves by less
            // than 1e-4 of the stroke.
            assert!((found.lag_s - lag_s).abs() < 1e-5 && !found.at_limit, "{found:?}");
        }
        let late: Vec<f64> = (0..3600).map(|i| PATH.at(place().time_s(i) - 0.9)[0]).collect();
        assert!(lags(&reference, place(), &late, 0.3).unwrap().1.iter().any(|lag| lag.at_limit));
    }

    #[test]
    fn the_lags_noise_is_that_of_the_closed_form() {
        let reference = Reference::logistic(&[PATH]).unwrap();
        let (sigma, runs, n) = (1e-3, 100_u64, 1800_usize);
        let clean: Vec<f64> = (0..n).map(|i| PATH.at(place().time_s(i) - 0.02)[0]).collect();
        let power: f64 = (0..n).map(|i| PATH.at(place().time_s(i) - 0.02)[1].powi(2)).sum();
        let errors: Vec<f64> = (0..runs)
            .map(|run| {
                let q: Vec<f64> = clean.iter().zip(normal(run, n)).map(|(q, e)| q + sigma * e).collect();
                lags(&reference, place(), &q, 0.2).unwrap().1[0].lag_s - 0.02
            })
            .collect();
        // 100 runs: the relative standard deviation is 7 %; four deviations are allowed.
        assert!((rms(&errors) / (sigma / power.sqrt()) - 1.0).abs() < 0.28, "{}", rms(&errors));
    }

    #[test]
    fn bad_settings_are_refused_and_a_joint_at_rest_has_no_lag() {
        let still = LogisticPath { amplitude: 0.0, ..PATH };
        let reference = Reference::logistic(&[still]).unwrap();
        assert_eq!(lags(&reference, place(), &[0.1; 50], 0.1).unwrap().1, []);
        assert!(lags(&reference, place(), &[0.1; 50], 0.0).is_err());
        assert!(lags(&reference, Place { joint: 1, ..place() }, &[0.1; 50], 0.1).is_err());
    }
}
