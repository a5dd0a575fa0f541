use crate::evidence::run_evidence::Clipping;
use dynident_simulation::Record;

/// A torque is clipped if it is closer to the limit than this: a share of the limit, or a number of standard
/// deviations of the noise.
const LIMIT_TOLERANCE_SHARE: f64 = 1e-3;
const LIMIT_TOLERANCE_SIGMAS: f64 = 3.0;

/// Detection of saturation if no limit is given. The band below the largest torque (a share of it, or a number of
/// standard deviations of the noise) must contain at least `MIN_TOP_SHARE` of the samples, and `MIN_TOP_RATIO` times
/// as many samples as the next band. This ratio is 2.4 for a sine and below 1 for Gaussian noise.
const BAND_SHARE: f64 = 2e-3;
const BAND_SIGMAS: f64 = 7.0;
const MIN_TOP_SHARE: f64 = 0.02;
const MIN_TOP_RATIO: f64 = 5.0;
/// Largest width of the band as a share of the torque; with more noise, saturation cannot be detected.
const MAX_BAND_SHARE: f64 = 0.05;

/// Averaging of saturated samples: maximum length of a block in samples, and minimum number of blocks.
const MAX_BLOCK_SAMPLES: usize = 100;
const MIN_BLOCKS: usize = 10;
/// Largest variation of the block means: a multiple of the variation of white noise (correlated noise varies more),
/// plus a share of the torque (rounding).
const MAX_COLOURED_NOISE_RATIO: f64 = 3.0;
const ROUNDING_SHARE: f64 = 1e-4;

/// A joint moves if its position changes by more than `MIN_MOTION_RATIO` times the root mean square of such changes.
/// The changes are measured over this share of a record to either side.
const STEP_SHARE: f64 = 1e-3;
const MIN_MOTION_RATIO: f64 = 0.02;

/// Saturated samples of one joint over the records of all trajectories. They are at the given limit. If the torque
/// never reaches it, they are at the largest torque of the log, if samples of the moving joint accumulate there.
/// Samples at rest are excluded, because an arm at rest also has constant torque.
pub(crate) fn clipping(records: &[Record], joint: usize, limit: Option<f64>, noise: f64) -> Option<Clipping> {
    let torques: Vec<f64> = records.iter().flat_map(|record| &record.tau[record.of(joint)]).copied().collect();
    let count = torques.len() as f64;
    let largest = torques.iter().fold(0.0_f64, |most, tau| most.max(tau.abs()));
    if torques.is_empty() || largest == 0.0 {
        return None;
    }
    if let Some(limit) = limit.filter(|limit| limit.is_finite()) {
        let near = (LIMIT_TOLERANCE_SHARE * limit).max(LIMIT_TOLERANCE_SIGMAS * noise);
        // A drive whose torque exceeds the given limit is not clipped at this limit.
        if largest <= limit + 2.0 * near {
            let at = torques.iter().filter(|tau| tau.abs() >= limit - near).count();
            if at > 0 {
                return Some(Clipping { share: at as f64 / count, torque: limit, stated: true });
            }
        }
    }
    let band = (BAND_SHARE * largest).max(BAND_SIGMAS * noise);
    if band > MAX_BAND_SHARE * largest {
        return None;
    }
    let moving: Vec<f64> = records.iter().flat_map(|record| moving_torques(record, joint)).collect();
    let within = |from: f64, to: f64| moving.iter().filter(|tau| tau.abs() > from && tau.abs() <= to).count() as f64;
    let (top, next) = (within(largest - band, largest), within(largest - 2.0 * band, largest - band));
    let heaped = top >= MIN_TOP_SHARE * count && top >= MIN_TOP_RATIO * next;
    let flat = heaped && is_constant(moving.iter().map(|tau| tau.abs()).filter(|tau| *tau > largest - band), noise);
    flat.then_some(Clipping { share: top / count, torque: largest, stated: false })
}

/// Whether these torques are constant except for noise: (correlated) noise and rounding explain the variation of
/// their block means. If gravity and acceleration balance for a while, torques also accumulate, but near a torque
/// that drifts.
fn is_constant(torques: impl Iterator<Item = f64>, noise: f64) -> bool {
    let torques: Vec<f64> = torques.collect();
    let block = (torques.len() / MIN_BLOCKS).clamp(1, MAX_BLOCK_SAMPLES);
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
    // The standard deviation of a normal distribution is 1.48 times its median absolute deviation.
    1.48 * middle(&mut apart) <= MAX_COLOURED_NOISE_RATIO * noise / (block as f64).sqrt() + ROUNDING_SHARE * typical
}

fn moving_torques(record: &Record, joint: usize) -> Vec<f64> {
    let (q, tau) = (&record.q[record.of(joint)], &record.tau[record.of(joint)]);
    let apart = ((STEP_SHARE * q.len() as f64) as usize).max(1);
    let step = |k: usize| (q[(k + apart).min(q.len() - 1)] - q[k.saturating_sub(apart)]).abs();
    let mean_square = (0..q.len()).map(|k| step(k).powi(2)).sum::<f64>() / q.len().max(1) as f64;
    let least = MIN_MOTION_RATIO * mean_square.sqrt();
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

    /// Gravity torque decreases while the joint accelerates: it varies by 0.3 of 30 Nm for a twentieth of the time.
    #[test]
    fn a_torque_that_balances_for_a_while_is_not_clipped() {
        // Uniform numbers from a linear congruential generator (Knuth's constants).
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

    /// The gravity torque is largest at rest, for a twentieth of the time.
    #[test]
    fn an_arm_at_rest_is_not_clipped() {
        let arm = |rest: f64| {
            let angle = |k: usize| if k < 250 { 0.0 } else { 5e-4 * (k - 250) as f64 };
            let mut held = record((0..5000).map(|k| 10.0 * angle(k).cos()).collect());
            held.q = (0..5000).map(|k| if k < 250 { rest * k as f64 } else { angle(k) }).collect();
            held
        };
        assert_eq!(clipping(&[arm(1e-7)], 0, None, 0.0), None);
        // The same constant torque while the joint moves is saturation.
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
        // The same with a given limit, and with noise that hides the edge.
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
