//! Detects torque that does not respond while a joint leaves its trajectory. In the log of a stopped run this
//! indicates drive saturation.

use super::envelope::target_at;
use dynident_simulation::{Record, Reference};

/// The analysed interval begins when the tracking error was last below this share of its final value.
const BEGIN_ERROR_SHARE: f64 = 0.5;
/// The torque has not responded if the torques in both halves of the interval differ by at most this ratio (while the
/// tracking error has doubled).
const MAX_TORQUE_CHANGE: f64 = 0.1;
/// Number of standard deviations of the noise within which a response may be hidden.
const NOISE_SIGMAS: f64 = 2.0;
const MIN_SAMPLES: usize = 8;

/// Torque of a joint while its tracking error doubled.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct HeldTorque {
    joint: String,
    /// Mean torque, Nm (N).
    torque: f64,
    duration_s: f64,
    /// Tracking error at the beginning and at the end of the interval, rad (m).
    distances: [f64; 2],
}

impl core::fmt::Display for HeldTorque {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { joint, torque, duration_s, distances: [from, to] } = self;
        write!(
            f,
            "the torque of {joint} stayed at {torque:.3} for {duration_s:.3} s while its tracking error \
             grew from {from:.3} to {to:.3}: its drive is saturated, or its gains are too low"
        )
    }
}

/// Torque of a joint that was too far from the trajectory at a time, s, if the torque opposed the error and did not
/// grow; `None` otherwise.
pub(super) fn held_torque(reference: &Reference, record: &Record, name: &str, time_s: f64) -> Option<HeldTorque> {
    let joint = record.joints.iter().position(|own| own == name)?;
    let (q, tau) = (&record.q[record.of(joint)], &record.tau[record.of(joint)]);
    let end = record.times_s.partition_point(|own| *own <= time_s);
    let distance = |k: usize| q[k] - target_at(reference, joint, record.times_s[k]);
    let last = distance(end.checked_sub(1)?);
    let begin = (0..end).rev().find(|&k| distance(k) * last.signum() < BEGIN_ERROR_SHARE * last.abs())? + 1;
    let torques = &tau[begin..end];
    if torques.len() < MIN_SAMPLES {
        return None;
    }
    let mean = |own: &[f64]| own.iter().sum::<f64>() / own.len() as f64;
    let (earlier, later) = torques.split_at(torques.len() / 2);
    let spread = |own: &[f64]| {
        let middle = mean(own);
        own.iter().map(|tau| (tau - middle).powi(2)).sum::<f64>() / (own.len() as f64 * (own.len() - 1) as f64)
    };
    let torque = mean(torques);
    let noise = (spread(earlier) + spread(later)).sqrt();
    let pushes_back = torque * last < 0.0 && torque.abs() > NOISE_SIGMAS * noise;
    // A response has the same sign as the torque.
    let response = (mean(later) - mean(earlier)) * torque.signum();
    let is_held = pushes_back
        && response < MAX_TORQUE_CHANGE * torque.abs()
        && NOISE_SIGMAS * noise < MAX_TORQUE_CHANGE * torque.abs();
    is_held.then(|| HeldTorque {
        joint: name.to_owned(),
        torque,
        duration_s: record.times_s[end - 1] - record.times_s[begin],
        distances: [distance(begin).abs(), last.abs()],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f64 = 500.0;

    /// A joint that should rest at 0 and falls to 0.3 rad within half a second with this torque and 2 % of noise.
    fn fallen(torque: impl Fn(f64) -> f64) -> Option<HeldTorque> {
        let samples = 250;
        let q: Vec<f64> = (0..samples).map(|k| -0.3 * (k as f64 / (samples - 1) as f64).powi(2)).collect();
        let noise = |k: usize| 1.0 + 0.02 * (2.4 * k as f64).sin();
        let tau = q.iter().enumerate().map(|(k, q)| torque(*q) * noise(k)).collect();
        let times_s = (0..samples).map(|k| k as f64 / RATE_HZ).collect();
        let record = Record { joints: vec!["elbow".to_owned()], rate_hz: RATE_HZ, samples, times_s, q, tau };
        held_torque(&Reference::standing(&[0.0], RATE_HZ, 2.0).unwrap(), &record, "elbow", 0.5)
    }

    /// 300 Nm/rad, saturated at 3.5 Nm.
    #[test]
    fn a_drive_that_gives_no_more_is_seen() {
        let found = fallen(|q| (-300.0 * q).min(3.5)).unwrap();
        assert!((found.torque - 3.5).abs() < 0.05 && found.duration_s > 0.1, "{found:?}");
        assert!(found.to_string().starts_with("the torque of elbow stayed at 3.5"), "{found}");
    }

    /// Weak gains respond with twice the torque to twice the error; a torque in the direction of the error does not
    /// oppose it.
    #[test]
    fn a_torque_that_answers_is_none_that_is_held() {
        assert_eq!(fallen(|q| -10.0 * q), None);
        assert_eq!(fallen(|_| -3.5), None);
    }
}
