//! Columns of a log that are not what the study states: the same column for two joints, or torques without a sign.

use super::channels::Channels;
use super::motion_rows::MotionRows;
use super::span::dot;
use crate::diagnosis_settings::ChannelSettings;

/// Two joints whose values come from the same column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DuplicateChannel {
    /// Whether the positions or the torques are duplicates; both if the position of the first joint is the torque of
    /// the second.
    pub channels: Channels,
    /// Indices of the two joints.
    pub joints: [usize; 2],
}

/// Finds joints with the same column, up to a factor, if much of the torque of one of them is unexplained. A position
/// and a torque may also come from one column. `left` is the unexplained share of each joint's torque.
pub(super) fn duplicate_channels(rows: &MotionRows, left: &[f64], settings: &ChannelSettings) -> Vec<DuplicateChannel> {
    let is_compared = |a: usize, b: usize| left[a].max(left[b]) > settings.min_unexplained_of_duplicate;
    let mut found = Vec::new();
    for (channels, columns) in [(Channels::Position, &rows.q), (Channels::Torque, &rows.tau)] {
        for a in 0..columns.len() {
            for b in a + 1..columns.len() {
                if is_compared(a, b) && is_multiple(&columns[a], &columns[b], settings.max_difference_of_duplicate) {
                    found.push(DuplicateChannel { channels, joints: [a, b] });
                }
            }
        }
    }
    for (a, q) in rows.q.iter().enumerate() {
        for (b, tau) in rows.tau.iter().enumerate() {
            if is_compared(a, b) && is_multiple(q, tau, settings.max_difference_of_filters) {
                found.push(DuplicateChannel { channels: Channels::Both, joints: [a, b] });
            }
        }
    }
    found
}

/// Whether two columns that are not constant are equal up to a factor and an offset.
fn is_multiple(a: &[f64], b: &[f64], max_difference: f64) -> bool {
    let [a, b] = [a, b].map(|values| {
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        values.iter().map(|value| value - mean).collect::<Vec<f64>>()
    });
    let [aa, ab, bb] = [dot(&a, &a), dot(&a, &b), dot(&b, &b)];
    // The squared sine of the angle between the columns is below the limit.
    aa > 0.0 && bb > 0.0 && aa * bb - ab * ab < max_difference * max_difference * aa * bb
}

/// Whether all torques are magnitudes: never negative although the joints move back and forth, and not explained by any
/// physically consistent robot. `left_of_all` is the unexplained share of the torque of all joints.
pub(super) fn has_lost_signs(rows: &MotionRows, left_of_all: f64, settings: &ChannelSettings) -> bool {
    let is_back_and_forth = |dq: &[f64]| dq.iter().any(|&dq| dq > 0.0) && dq.iter().any(|&dq| dq < 0.0);
    let is_positive = |tau: &[f64]| {
        let largest = tau.iter().fold(0.0_f64, |largest, tau| largest.max(*tau));
        tau.iter().all(|&tau| tau >= -settings.max_undershoot * largest)
    };
    rows.tau.len() > 1
        && left_of_all > settings.min_unexplained_of_duplicate
        && rows.dq.iter().all(|dq| is_back_and_forth(dq))
        && rows.tau.iter().all(|tau| is_positive(tau))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn duplicates(tau: &[&[f64]], left: &[f64]) -> Vec<DuplicateChannel> {
        duplicate_channels(&rows(tau.iter().map(|tau| tau.to_vec()).collect()), left, &ChannelSettings::default())
    }

    fn rows(tau: Vec<Vec<f64>>) -> MotionRows {
        let motion = |phase: f64| (0..50).map(|k| (0.3 * f64::from(k) + phase).sin()).collect::<Vec<f64>>();
        let dq = vec![motion(0.0), motion(1.0)];
        let independent = dq[0].len() as f64;
        MotionRows { q: dq.clone(), dq: dq.clone(), ddq: dq, tau, rate_hz: 100.0, independent }
    }

    #[test]
    fn finds_one_column_for_two_joints() {
        let torque: Vec<f64> = (0..50).map(|k| (0.2 * f64::from(k)).cos()).collect();
        let twice: Vec<f64> = torque.iter().map(|tau| 3.0 - 2.0 * tau).collect();
        let found = duplicates(&[&torque, &twice], &[0.0, 0.5]);
        assert_eq!(found, [DuplicateChannel { channels: Channels::Torque, joints: [0, 1] }]);
        assert_eq!(duplicates(&[&torque, &twice], &[0.01, 0.02]), []);
        let other: Vec<f64> = torque.iter().enumerate().map(|(k, tau)| tau + 1e-4 * (k % 2) as f64).collect();
        assert_eq!(duplicates(&[&torque, &other], &[0.5, 0.5]), []);
        let mut spoilt = rows(vec![torque.clone(), torque.iter().map(|tau| tau * tau).collect()]);
        spoilt.q[1] = torque.iter().map(|tau| 0.1 * tau - 2.0).collect();
        let found = duplicate_channels(&spoilt, &[0.5, 0.5], &ChannelSettings::default());
        assert_eq!(found, [DuplicateChannel { channels: Channels::Both, joints: [1, 0] }]);
    }

    #[test]
    fn magnitudes_have_lost_their_signs() {
        let torque = |shift: f64| (0..50).map(|k| (0.2 * f64::from(k)).cos() + shift).collect::<Vec<f64>>();
        let magnitude = |values: Vec<f64>| values.into_iter().map(f64::abs).collect::<Vec<f64>>();
        let is_lost = |tau: Vec<Vec<f64>>, left: f64| has_lost_signs(&rows(tau), left, &ChannelSettings::default());
        assert!(is_lost(vec![magnitude(torque(0.0)), magnitude(torque(0.1))], 0.4));
        assert!(!is_lost(vec![torque(0.0), magnitude(torque(0.1))], 0.4));
        // The gravity torque of a joint may have the same sign all the time.
        assert!(!is_lost(vec![torque(2.0), torque(1.5)], 0.01));
    }
}
