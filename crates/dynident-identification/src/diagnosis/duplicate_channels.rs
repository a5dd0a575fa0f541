//! Columns that are not what the study states: one column for two joints, torques without a sign.

use super::channels::Channels;
use super::motion_rows::MotionRows;

/// Largest difference of duplicates as a share of their size: the rounding of filters.
const MAX_DIFFERENCE: f64 = 1.0e-6;
/// The same for a position and a torque, which have different filters.
const MAX_DIFFERENCE_OF_FILTERS: f64 = 1.0e-2;
/// Unexplained share of a joint's torque from which its columns are compared: two joints may move alike.
const MIN_UNEXPLAINED: f64 = 0.1;
/// Undershoot of a filter as a share of a joint's largest torque.
const RINGING: f64 = 0.05;

/// Two joints with the same column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DuplicateChannel {
    /// Positions or torques; both where the position of the first joint is the torque of the second.
    pub channels: Channels,
    /// Numbers of the two joints.
    pub joints: [usize; 2],
}

/// Joints with the same column, up to a factor, where much of the torque of one of them is unexplained; `left` is the
/// unexplained share of each joint's torque. A position and a torque may also be one column.
pub(super) fn duplicate_channels(rows: &MotionRows, left: &[f64]) -> Vec<DuplicateChannel> {
    let mut found = Vec::new();
    for (channels, columns) in [(Channels::Position, &rows.q), (Channels::Torque, &rows.tau)] {
        for a in 0..columns.len() {
            for b in a + 1..columns.len() {
                if left[a].max(left[b]) > MIN_UNEXPLAINED && is_multiple(&columns[a], &columns[b], MAX_DIFFERENCE) {
                    found.push(DuplicateChannel { channels, joints: [a, b] });
                }
            }
        }
    }
    for (a, q) in rows.q.iter().enumerate() {
        for (b, tau) in rows.tau.iter().enumerate() {
            if left[a].max(left[b]) > MIN_UNEXPLAINED && is_multiple(q, tau, MAX_DIFFERENCE_OF_FILTERS) {
                found.push(DuplicateChannel { channels: Channels::Both, joints: [a, b] });
            }
        }
    }
    found
}

/// Whether two columns that change are multiples of one another, offsets aside.
fn is_multiple(a: &[f64], b: &[f64], same: f64) -> bool {
    let [a, b] = [a, b].map(|values| {
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        values.iter().map(|value| value - mean).collect::<Vec<f64>>()
    });
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let [aa, ab, bb] = [dot(&a, &a), dot(&a, &b), dot(&b, &b)];
    // The square of the sine between them.
    aa > 0.0 && bb > 0.0 && aa * bb - ab * ab < same * same * aa * bb
}

/// Whether no torque is ever negative though the joints move back and forth and no robot explains the torque: these are
/// magnitudes. `left_of_all` is the unexplained share of all torque.
pub(super) fn has_lost_signs(rows: &MotionRows, left_of_all: f64) -> bool {
    let is_back_and_forth = |dq: &[f64]| dq.iter().any(|&dq| dq > 0.0) && dq.iter().any(|&dq| dq < 0.0);
    let is_positive = |tau: &[f64]| {
        let largest = tau.iter().fold(0.0_f64, |largest, tau| largest.max(*tau));
        tau.iter().all(|&tau| tau >= -RINGING * largest)
    };
    rows.tau.len() > 1
        && left_of_all > MIN_UNEXPLAINED
        && rows.dq.iter().all(|dq| is_back_and_forth(dq))
        && rows.tau.iter().all(|tau| is_positive(tau))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(tau: Vec<Vec<f64>>) -> MotionRows {
        let motion = |phase: f64| (0..50).map(|k| (0.3 * f64::from(k) + phase).sin()).collect::<Vec<f64>>();
        let dq = vec![motion(0.0), motion(1.0)];
        let independent = dq[0].len() as f64;
        MotionRows { q: dq.clone(), dq: dq.clone(), ddq: dq, tau, rate_hz: 100.0, independent }
    }

    #[test]
    fn one_column_for_two_joints_is_found_where_no_robot_explains_it() {
        let torque: Vec<f64> = (0..50).map(|k| (0.2 * f64::from(k)).cos()).collect();
        let twice: Vec<f64> = torque.iter().map(|tau| 3.0 - 2.0 * tau).collect();
        let found = duplicate_channels(&rows(vec![torque.clone(), twice.clone()]), &[0.0, 0.5]);
        assert_eq!(found, [DuplicateChannel { channels: Channels::Torque, joints: [0, 1] }]);
        assert_eq!(duplicate_channels(&rows(vec![torque.clone(), twice]), &[0.01, 0.02]), []);
        let other: Vec<f64> = torque.iter().enumerate().map(|(k, tau)| tau + 1e-4 * (k % 2) as f64).collect();
        assert_eq!(duplicate_channels(&rows(vec![torque.clone(), other]), &[0.5, 0.5]), []);
        let mut spoilt = rows(vec![torque.clone(), torque.iter().map(|tau| tau * tau).collect()]);
        spoilt.q[1] = torque.iter().map(|tau| 0.1 * tau - 2.0).collect();
        let found = duplicate_channels(&spoilt, &[0.5, 0.5]);
        assert_eq!(found, [DuplicateChannel { channels: Channels::Both, joints: [1, 0] }]);
    }

    #[test]
    fn magnitudes_have_lost_their_signs() {
        let torque = |shift: f64| (0..50).map(|k| (0.2 * f64::from(k)).cos() + shift).collect::<Vec<f64>>();
        let magnitude = |values: Vec<f64>| values.into_iter().map(f64::abs).collect::<Vec<f64>>();
        assert!(has_lost_signs(&rows(vec![magnitude(torque(0.0)), magnitude(torque(0.1))]), 0.4));
        assert!(!has_lost_signs(&rows(vec![torque(0.0), magnitude(torque(0.1))]), 0.4));
        // Gravity may hold a joint on one side all along.
        assert!(!has_lost_signs(&rows(vec![torque(2.0), torque(1.5)]), 0.01));
    }
}
