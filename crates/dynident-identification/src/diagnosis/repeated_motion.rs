//! Held-out motion that repeats the training motion.

use super::motion_rows::MotionRows;
use crate::diagnosis_settings::HeldOutSettings;

/// Whether almost all instants of `held_out` have the positions and velocities of an instant of `training`.
pub(super) fn repeats_motion(training: &MotionRows, held_out: &MotionRows, settings: &HeldOutSettings) -> bool {
    let ranges: Vec<f64> = training.q.iter().chain(&training.dq).map(|values| range(values)).collect();
    let state = |rows: &MotionRows, row: usize| -> Vec<f64> {
        let values = rows.q.iter().chain(&rows.dq).zip(&ranges);
        values.map(|(values, range)| values[row] / range.max(f64::MIN_POSITIVE)).collect()
    };
    let path: Vec<Vec<f64>> = (0..training.len()).map(|row| state(training, row)).collect();
    let is_near = |row: &usize| {
        let state = state(held_out, *row);
        path.windows(2).any(|ends| distance(&state, &ends[0], &ends[1]) <= settings.max_distance_of_repeat)
    };
    let near = (0..held_out.len()).filter(is_near).count();
    training.q.len() >= settings.min_joints_of_repeat
        && near as f64 >= settings.min_share_of_repeat * held_out.len().max(1) as f64
}

fn range(values: &[f64]) -> f64 {
    let (low, high) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
    high - low
}

/// Root mean square distance of a point from the line between two others.
fn distance(point: &[f64], from: &[f64], to: &[f64]) -> f64 {
    let along: f64 = point.iter().zip(from).zip(to).map(|((point, from), to)| (point - from) * (to - from)).sum();
    let length: f64 = from.iter().zip(to).map(|(from, to)| (to - from).powi(2)).sum();
    let share = if length > 0.0 { (along / length).clamp(0.0, 1.0) } else { 0.0 };
    let square = |((point, from), to): ((&f64, &f64), &f64)| (point - from - share * (to - from)).powi(2);
    (point.iter().zip(from).zip(to).map(square).sum::<f64>() / point.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sines of three joints from `start_s`, at `speed`, every 0.1 s.
    fn rows(start_s: f64, speed: f64) -> MotionRows {
        let time = |k: usize| speed * (start_s + 0.1 * k as f64);
        let of = |value: &dyn Fn(f64, f64) -> f64| -> Vec<Vec<f64>> {
            (1..=3).map(|joint| (0..200).map(|k| value(f64::from(joint).sqrt(), time(k))).collect()).collect()
        };
        let q = of(&|w, t| (w * t).sin());
        let dq = of(&|w, t| speed * w * (w * t).cos());
        MotionRows { ddq: q.clone(), tau: q.clone(), q, dq, ..MotionRows::default() }
    }

    #[test]
    fn a_shifted_repetition_repeats_and_another_speed_does_not() {
        let settings = HeldOutSettings::default();
        assert!(repeats_motion(&rows(0.0, 1.0), &rows(0.03, 1.0), &settings));
        assert!(!repeats_motion(&rows(0.0, 1.0), &rows(0.0, 1.3), &settings));
        assert!(!repeats_motion(&rows(0.0, 1.0), &rows(100.0, 1.0), &settings));
    }
}
