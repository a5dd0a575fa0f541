//! Torque at the drive's limit, as the log shows it.

use crate::evidence::Clipping;
use dynident_simulation::Record;

/// How near a stated limit a torque counts as at it: a share of the limit, or so many deviations of the log's noise.
const NEAR: f64 = 1e-3;
const NEAR_NOISE: f64 = 3.0;

/// A flat top: the band below the largest torque (a share of that, or so many deviations of the noise) holds at least
/// this share of the samples and so many times those of the next band. Of a sine the ratio is 2.4, of Gaussian noise
/// below one.
const BAND: f64 = 2e-3;
const BAND_NOISE: f64 = 7.0;
const LEAST_SHARE: f64 = 0.02;
const LEAST_RATIO: f64 = 5.0;
/// Noise so large that its band is more than this share of the torque hides any flat top.
const WIDEST_BAND: f64 = 0.05;

/// Samples of one joint at its drive's limit, over the records of all legs: at a stated limit; or, where the torque
/// never reaches one, at the largest torque of the log if its samples heap up there as no smooth torque's do.
pub(crate) fn clipping(records: &[Record], joint: usize, limit: Option<f64>, noise: f64) -> Option<Clipping> {
    let torques: Vec<f64> = records.iter().flat_map(|record| &record.tau[record.of(joint)]).copied().collect();
    let count = torques.len() as f64;
    let largest = torques.iter().fold(0.0_f64, |most, tau| most.max(tau.abs()));
    if torques.is_empty() || largest == 0.0 {
        return None;
    }
    if let Some(limit) = limit.filter(|limit| limit.is_finite()) {
        let near = (NEAR * limit).max(NEAR_NOISE * noise);
        // A drive that gives more than the stated limit is not clipped there.
        if largest <= limit + 2.0 * near {
            let at = torques.iter().filter(|tau| tau.abs() >= limit - near).count();
            if at > 0 {
                return Some(Clipping { share: at as f64 / count, torque: limit, stated: true });
            }
        }
    }
    let band = (BAND * largest).max(BAND_NOISE * noise);
    if band > WIDEST_BAND * largest {
        return None;
    }
    let within = |from: f64, to: f64| torques.iter().filter(|tau| tau.abs() > from && tau.abs() <= to).count() as f64;
    let (top, next) = (within(largest - band, largest), within(largest - 2.0 * band, largest - band));
    let flat = top >= LEAST_SHARE * count && top >= LEAST_RATIO * next;
    flat.then_some(Clipping { share: top / count, torque: largest, stated: false })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(tau: Vec<f64>) -> Record {
        let samples = tau.len();
        let times_s = (0..samples).map(|k| k as f64 * 1e-3).collect();
        Record { joints: vec!["a".to_owned()], rate_hz: 1000.0, samples, times_s, q: vec![0.0; samples], tau }
    }

    fn sine(amplitude: f64) -> Vec<f64> {
        (0..5000).map(|k| amplitude * (0.005 * f64::from(k)).sin()).collect()
    }

    #[test]
    fn a_cut_torque_is_seen_and_a_smooth_one_is_not() {
        let smooth = [record(sine(10.0))];
        assert_eq!(clipping(&smooth, 0, None, 0.0), None);
        assert_eq!(clipping(&smooth, 0, None, 0.05), None);
        assert_eq!(clipping(&smooth, 0, Some(20.0), 0.05), None);
        let cut: Vec<f64> = sine(10.0).iter().map(|tau| tau.clamp(-8.0, 8.0)).collect();
        // |sin| > 0.8 for 41 % of a turn.
        let seen = clipping(&[record(cut.clone())], 0, None, 0.0).unwrap();
        assert!((seen.share - 0.41).abs() < 0.02 && seen.torque == 8.0 && !seen.stated, "{seen:?}");
        // The same by its stated limit; with noise that hides the edge.
        let noisy = cut.iter().enumerate().map(|(k, tau)| tau + 0.04 * (12.9898 * k as f64).sin()).collect();
        let noisy = [record(noisy)];
        for limit in [Some(8.0), None, Some(28.0)] {
            let seen = clipping(&noisy, 0, limit, 0.03).unwrap();
            assert!((seen.share - 0.41).abs() < 0.03, "{limit:?} {seen:?}");
            assert_eq!(seen.stated, limit == Some(8.0));
        }
    }

    #[test]
    fn coulomb_friction_with_motion_has_no_flat_top() {
        let tau: Vec<f64> = sine(1.0).iter().map(|dq| 2.0 * (dq / 0.05).tanh() + 0.5 * dq).collect();
        assert_eq!(clipping(&[record(tau)], 0, None, 0.005), None);
    }
}
