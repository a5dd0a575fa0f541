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

/// Means of a flat top are over at most so many samples, and at least so many means.
const LONGEST_BLOCK: usize = 100;
const FEWEST_BLOCKS: usize = 10;
/// Times the noise of a mean of white noise, and share of the torque, by which they may differ.
const COLOURED: f64 = 3.0;
const ROUNDING: f64 = 1e-4;

/// A joint moves where it gets, within so large a share of a record to either side, further than this share of the root
/// mean square of all such steps.
const STEP_SHARE: f64 = 1e-3;
const MOVES: f64 = 0.02;

/// Samples of one joint at its drive's limit, over the records of all legs: at a stated limit; or, where the torque
/// never reaches one, at the largest torque of the log if its samples heap up there as no smooth torque's do while the
/// joint moves: an arm that rests where it weighs most holds one torque, too.
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
    let moving: Vec<f64> = records.iter().flat_map(|record| moving_torques(record, joint)).collect();
    let within = |from: f64, to: f64| moving.iter().filter(|tau| tau.abs() > from && tau.abs() <= to).count() as f64;
    let (top, next) = (within(largest - band, largest), within(largest - 2.0 * band, largest - band));
    let heaped = top >= LEAST_SHARE * count && top >= LEAST_RATIO * next;
    let flat = heaped && is_constant(moving.iter().map(|tau| tau.abs()).filter(|tau| *tau > largest - band), noise);
    flat.then_some(Clipping { share: top / count, torque: largest, stated: false })
}

/// Whether these torques are one and the same but for noise: their means over so many samples differ by no more than
/// noise leaves of a mean, three times over for noise that is coloured, and rounding. Gravity and acceleration that
/// balance for a while make a torque that heaps up and wanders.
fn is_constant(torques: impl Iterator<Item = f64>, noise: f64) -> bool {
    let torques: Vec<f64> = torques.collect();
    let block = (torques.len() / FEWEST_BLOCKS).clamp(1, LONGEST_BLOCK);
    let mut means: Vec<f64> = torques.chunks_exact(block).map(|own| own.iter().sum::<f64>() / block as f64).collect();
    let middle = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    if means.is_empty() {
        return false;
    }
    let typical = middle(&mut means);
    let mut apart: Vec<f64> = means.iter().map(|mean| (mean - typical).abs()).collect();
    // 1.48 median deviations are a standard deviation of normal ones.
    1.48 * middle(&mut apart) <= COLOURED * noise / (block as f64).sqrt() + ROUNDING * typical
}

/// The torque of a joint in the samples where it moves.
fn moving_torques(record: &Record, joint: usize) -> Vec<f64> {
    let (q, tau) = (&record.q[record.of(joint)], &record.tau[record.of(joint)]);
    let apart = ((STEP_SHARE * q.len() as f64) as usize).max(1);
    let step = |k: usize| (q[(k + apart).min(q.len() - 1)] - q[k.saturating_sub(apart)]).abs();
    let mean_square = (0..q.len()).map(|k| step(k).powi(2)).sum::<f64>() / q.len().max(1) as f64;
    let least = MOVES * mean_square.sqrt();
    (0..q.len()).filter(|&k| step(k) > least).map(|k| tau[k]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(tau: Vec<f64>) -> Record {
        let samples = tau.len();
        let times_s = (0..samples).map(|k| k as f64 * 1e-3).collect();
        let q = (0..samples).map(|k| (0.007 * k as f64).sin()).collect();
        Record { joints: vec!["a".to_owned()], rate_hz: 1000.0, samples, times_s, q, tau }
    }

    /// Gravity falls as the joint gains speed: 0.3 of 30 Nm for a twentieth of the time.
    #[test]
    fn a_torque_that_balances_for_a_while_is_not_clipped() {
        // Uniform, by a congruential generator (Knuth's constants).
        let mut state = 3_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        let noise: Vec<f64> = (0..5000).map(|_| 0.05 * next()).collect();
        let plateau = |k: usize| if k < 400 { 30.0 + 0.1 * (0.012 * k as f64).sin() } else { 0.002 * k as f64 };
        let wandering = record((0..5000).map(|k| plateau(k) + noise[k]).collect());
        assert_eq!(clipping(&[wandering], 0, None, 0.03), None);
        let flat = |k: usize| if k < 400 { 30.0 } else { 0.002 * k as f64 };
        let clipped = record((0..5000).map(|k| flat(k) + noise[k]).collect());
        assert!(clipping(&[clipped], 0, None, 0.03).is_some());
    }

    /// It weighs most where it rests, for a twentieth of the time.
    #[test]
    fn an_arm_at_rest_is_not_clipped() {
        let arm = |rest: f64| {
            let angle = |k: usize| if k < 250 { 0.0 } else { 5e-4 * (k - 250) as f64 };
            let mut held = record((0..5000).map(|k| 10.0 * angle(k).cos()).collect());
            held.q = (0..5000).map(|k| if k < 250 { rest * k as f64 } else { angle(k) }).collect();
            held
        };
        assert_eq!(clipping(&[arm(1e-7)], 0, None, 0.0), None);
        // The same torque while the joint moves is a limit of the drive.
        assert!(clipping(&[arm(2e-3)], 0, None, 0.0).is_some());
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
