//! Holes of a log that were filled by straight lines.

use crate::rows::{TorquePiece, median};
use crate::settings::FilledHoleSettings;

/// Intervals (s) during which the torques of all joints follow exact straight lines, and at least one torque changes.
pub(crate) fn straight_lines(pieces: &[TorquePiece], settings: &FilledHoleSettings) -> Vec<[f64; 2]> {
    let mut found = Vec::new();
    let (mut straight, mut all) = (0, 0);
    for piece in pieces {
        let samples = piece.tau.first().map_or(0, Vec::len);
        all += samples;
        if samples < 3 * settings.min_samples {
            continue;
        }
        let usual: Vec<f64> = piece
            .tau
            .iter()
            .map(|tau| median(tau.windows(3).map(|three| (three[0] - 2.0 * three[1] + three[2]).abs()).collect()))
            .collect();
        // A torque without noise is nearly straight in many places.
        if piece.tau.iter().zip(&usual).any(|(tau, usual)| is_smooth(tau, *usual, settings.max_smooth_ratio)) {
            continue;
        }
        let is_straight =
            |at: usize| {
                piece.tau.iter().zip(&usual).all(|(tau, usual)| {
                    (tau[at - 1] - 2.0 * tau[at] + tau[at + 1]).abs() <= settings.max_curvature * usual
                })
            };
        let mut from = 1;
        while from + 1 < samples {
            let to = (from..samples - 1).find(|&at| !is_straight(at)).unwrap_or(samples - 1);
            // Sample `from - 1` and sample `to` were measured; the samples between them are on the line.
            let sloped = piece
                .tau
                .iter()
                .zip(&usual)
                .filter(|(tau, usual)| (tau[to] - tau[from - 1]).abs() > settings.min_slope * **usual);
            if to - from >= settings.min_samples && sloped.count() >= settings.min_sloped_joints {
                let at = |sample: usize| piece.first_s + sample as f64 / piece.rate_hz;
                found.push([at(from), at(to)]);
                straight += to - from;
            }
            from = to + 1;
        }
    }
    if straight as f64 > settings.max_share * all as f64 { Vec::new() } else { found }
}

/// Whether a torque has no noise: its third differences are smaller than its second differences.
fn is_smooth(tau: &[f64], usual: f64, max_ratio: f64) -> bool {
    let third = median(tau.windows(4).map(|four| (four[3] - 3.0 * four[2] + 3.0 * four[1] - four[0]).abs()).collect());
    third < max_ratio * usual || usual == 0.0
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

    fn lines(piece: TorquePiece) -> Vec<[f64; 2]> {
        straight_lines(&[piece], &FilledHoleSettings::default())
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
        assert!(lines(piece.clone()).is_empty());
        filled(&mut piece, 500, 530);
        let found = lines(piece);
        assert_eq!(found.len(), 1);
        assert!((found[0][0] - 7.0).abs() < 0.011 && (found[0][1] - 7.3).abs() < 0.011, "{found:?}");
    }

    #[test]
    fn a_smooth_torque_and_a_slower_recorder_are_no_holes() {
        assert!(lines(piece(0.0)).is_empty());
        let mut slow = piece(0.3);
        for from in (1..1980).step_by(10) {
            filled(&mut slow, from, from + 9);
        }
        assert!(lines(slow).is_empty());
    }
}
