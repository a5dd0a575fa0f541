//! Parts of a log without torque.

use crate::rows::{LogRows, rms};

/// Whether all torques of a bin are small.
pub(crate) fn quiet(rows: &LogRows) -> Vec<bool> {
    let largest = rows.tau.iter().map(|tau| rms(tau)).fold(0.0, f64::max);
    let own = rows.settings.drives_off;
    let scale = |tau: &Vec<f64>| own.max_torque_ratio * rms(tau).max(own.min_reference_ratio * largest);
    let scales: Vec<f64> = rows.tau.iter().map(scale).collect();
    let is_quiet = |bin: usize| (0..rows.joints()).all(|joint| rows.tau[joint][bin].abs() <= scales[joint]);
    (0..rows.len()).map(is_quiet).collect()
}
