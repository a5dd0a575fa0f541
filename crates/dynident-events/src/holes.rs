//! Holes of a log that were filled by straight lines.

use crate::rows::{TorquePiece, median};

/// Minimum number of successive samples on one straight line.
const MIN_SAMPLES: usize = 6;
/// Maximum second difference on a straight line, relative to the median of the channel. By chance, 3 % of the samples
/// of a joint are below it.
const MAX_CURVATURE: f64 = 0.04;
/// Maximum share of samples on straight lines. A larger share is a property of the recorder.
const MAX_SHARE: f64 = 0.3;
/// Minimum number of joints whose torque changes along the line: at rest, a torque without noise is constant.
const MIN_SLOPED: usize = 1;

/// Intervals (s) during which the torques of all joints follow exact straight lines, and at least one torque changes.
pub(crate) fn straight_lines(pieces: &[TorquePiece]) -> Vec<[f64; 2]> {
    let mut found = Vec::new();
    let (mut straight, mut all) = (0, 0);
    for piece in pieces {
        let samples = piece.tau.first().map_or(0, Vec::len);
        all += samples;
        if samples < 3 * MIN_SAMPLES {
            continue;
        }
        let usual: Vec<f64> = piece
            .tau
            .iter()
            .map(|tau| median(tau.windows(3).map(|three| (three[0] - 2.0 * three[1] + three[2]).abs()).collect()))
            .collect();
        // A torque without noise is nearly straight in many places.
        if piece.tau.iter().zip(&usual).any(|(tau, usual)| is_smooth(tau, *usual)) {
            continue;
        }
        let is_straight = |at: usize| {
            piece
                .tau
                .iter()
                .zip(&usual)
                .all(|(tau, usual)| (tau[at - 1] - 2.0 * tau[at] + tau[at + 1]).abs() <= MAX_CURVATURE * usual)
        };
        let mut from = 1;
        while from + 1 < samples {
            let to = (from..samples - 1).find(|&at| !is_straight(at)).unwrap_or(samples - 1);
            // Sample `from - 1` and sample `to` were measured; the samples between them are on the line.
            let sloped =
                piece.tau.iter().zip(&usual).filter(|(tau, usual)| (tau[to] - tau[from - 1]).abs() > 0.1 * **usual);
            if to - from >= MIN_SAMPLES && sloped.count() >= MIN_SLOPED {
                let at = |sample: usize| piece.first_s + sample as f64 / piece.rate_hz;
                found.push([at(from), at(to)]);
                straight += to - from;
            }
            from = to + 1;
        }
    }
    if straight as f64 > MAX_SHARE * all as f64 { Vec::new() } else { found }
}

/// Whether a torque has no noise: its third differences are smaller than its second differences.
fn is_smooth(tau: &[f64], usual: f64) -> bool {
    let third = median(tau.windows(4).map(|four| (four[3] - 3.0 * four[2] + 3.0 * four[1] - four[0]).abs()).collect());
    // Ratio of third to second differences: 1.8 for white noise, 0.3 for a sine with 20 samples per period.
    third < 0.6 * usual || usual == 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::sample::Random;

    fn piece(noise: f64) -> TorquePiece {
        let mut random = Random::new(7);
        let mut joint = |phase: f64| -> Vec<f64> {
            (0..2000).map(|k| 20.0 * (0.01 * f64::from(k) + phase).sin() + noise * random.normal()).collect()
        };
        TorquePiece { first_s: 2.0, rate_hz: 100.0, tau: vec![joint(0.0), joint(1.0), joint(2.0)] }
    }

    fn filled(piece: &mut TorquePiece, from: usize, to: usize) {
        for tau in &mut piece.tau {
            let (before, after) = (tau[from - 1], tau[to]);
            for at in from..to {
                tau[at] = before + (after - before) * (at + 1 - from) as f64 / (to + 1 - from) as f64;
            }
        }
    }

    #[test]
    fn filled_holes_are_found_to_a_sample() {
        let mut piece = piece(0.3);
        assert!(straight_lines(&[piece.clone()]).is_empty());
        filled(&mut piece, 500, 530);
        let found = straight_lines(&[piece]);
        assert_eq!(found.len(), 1);
        assert!((found[0][0] - 7.0).abs() < 0.011 && (found[0][1] - 7.3).abs() < 0.011, "{found:?}");
    }

    #[test]
    fn a_smooth_torque_and_a_slower_recorder_are_no_holes() {
        assert!(straight_lines(&[piece(0.0)]).is_empty());
        let mut slow = piece(0.3);
        for from in (1..1980).step_by(10) {
            filled(&mut slow, from, from + 9);
        }
        assert!(straight_lines(&[slow]).is_empty());
    }
}
