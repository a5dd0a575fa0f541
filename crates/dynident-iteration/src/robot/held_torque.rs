//! Torque that does not answer while a joint gets away from its trajectory: what a drive at its limit looks like in
//! the log of a run that was stopped before that limit could be told by itself.

use super::envelope::target_at;
use dynident_simulation::{Record, Reference};

/// The time that counts: since the distance was last below this share of what the run was stopped at.
const SINCE: f64 = 0.5;
/// A torque whose halves of that time differ by less than this share of it did not answer to a distance that doubled.
const SAME: f64 = 0.1;
/// Times the deviation of the halves' difference by which noise may hide an answer.
const NOISE: f64 = 2.0;
/// Fewest samples of that time.
const FEWEST: usize = 8;

/// A joint's torque while its distance from the trajectory doubled.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct HeldTorque {
    joint: String,
    /// Its mean, Nm (N).
    torque: f64,
    /// For how long, s.
    duration_s: f64,
    /// Distance at the begin and at the end, rad (m).
    distances: [f64; 2],
}

impl core::fmt::Display for HeldTorque {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { joint, torque, duration_s, distances: [from, to] } = self;
        write!(
            f,
            "the torque of {joint} stayed at {torque:.3} for {duration_s:.3} s while its distance from the trajectory \
             grew from {from:.3} to {to:.3}: its drive gives no more, or its gains ask for no more"
        )
    }
}

/// What the record shows of a joint that was too far from the trajectory at a time, s: its torque, where that pushed
/// the joint back and did not grow. `None` where it did.
pub(super) fn held_torque(reference: &Reference, record: &Record, name: &str, time_s: f64) -> Option<HeldTorque> {
    let joint = record.joints.iter().position(|own| own == name)?;
    let (q, tau) = (&record.q[record.of(joint)], &record.tau[record.of(joint)]);
    let end = record.times_s.partition_point(|own| *own <= time_s);
    let distance = |k: usize| q[k] - target_at(reference, joint, record.times_s[k]);
    let last = distance(end.checked_sub(1)?);
    let begin = (0..end).rev().find(|&k| distance(k) * last.signum() < SINCE * last.abs())? + 1;
    let torques = &tau[begin..end];
    if torques.len() < FEWEST {
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
    let pushes_back = torque * last < 0.0 && torque.abs() > NOISE * noise;
    // An answer is more of the same sign.
    let answer = (mean(later) - mean(earlier)) * torque.signum();
    let is_held = pushes_back && answer < SAME * torque.abs() && NOISE * noise < SAME * torque.abs();
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

    /// A joint that should rest at 0 and falls to 0.3 rad within half a second, under this torque; 2 % of noise.
    fn fallen(torque: impl Fn(f64) -> f64) -> Option<HeldTorque> {
        let samples = 250;
        let q: Vec<f64> = (0..samples).map(|k| -0.3 * (k as f64 / (samples - 1) as f64).powi(2)).collect();
        let noise = |k: usize| 1.0 + 0.02 * (2.4 * k as f64).sin();
        let tau = q.iter().enumerate().map(|(k, q)| torque(*q) * noise(k)).collect();
        let times_s = (0..samples).map(|k| k as f64 / RATE_HZ).collect();
        let record = Record { joints: vec!["elbow".to_owned()], rate_hz: RATE_HZ, samples, times_s, q, tau };
        held_torque(&Reference::standing(&[0.0], RATE_HZ, 2.0).unwrap(), &record, "elbow", 0.5)
    }

    /// 300 Nm/rad that end at 3.5 Nm, where the drive has no more.
    #[test]
    fn a_drive_that_gives_no_more_is_seen() {
        let found = fallen(|q| (-300.0 * q).min(3.5)).unwrap();
        assert!((found.torque - 3.5).abs() < 0.05 && found.duration_s > 0.1, "{found:?}");
        assert!(found.to_string().starts_with("the torque of elbow stayed at 3.5"), "{found}");
    }

    /// Gains that are too weak push back twice as hard at twice the distance; what pushes on does not push back.
    #[test]
    fn a_torque_that_answers_is_none_that_is_held() {
        assert_eq!(fallen(|q| -10.0 * q), None);
        assert_eq!(fallen(|_| -3.5), None);
    }
}
