//! Parts of a log without torque.

use crate::rows::{LogRows, rms};

/// Maximum torque of each joint if the drives are off, relative to its root mean square torque in the log.
const OFF_TORQUE_SHARE: f64 = 0.1;

/// Smallest torque of a joint relative to the largest of all joints (root mean square) that is used as its reference.
/// For joints with less torque, this share of the largest torque is used.
pub(crate) const MIN_TORQUE_SHARE: f64 = 0.1;

/// Whether all torques of a bin are small.
pub(crate) fn quiet(rows: &LogRows) -> Vec<bool> {
    let largest = rows.tau.iter().map(|tau| rms(tau)).fold(0.0, f64::max);
    let scale = |tau: &Vec<f64>| OFF_TORQUE_SHARE * rms(tau).max(MIN_TORQUE_SHARE * largest);
    let scales: Vec<f64> = rows.tau.iter().map(scale).collect();
    let is_quiet = |bin: usize| (0..rows.joints()).all(|joint| rows.tau[joint][bin].abs() <= scales[joint]);
    (0..rows.len()).map(is_quiet).collect()
}
