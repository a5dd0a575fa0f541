//! The trajectory as a table.

use super::{ExportError, Sampled};
use core::fmt::Write;

/// Columns `t_s, q1.., dq1.., ddq1..`, one row per time, SI units, full precision.
///
/// # Errors
/// Different lengths of names, times and motion; values that are not finite.
pub fn trajectory_csv(sampled: &Sampled<'_>) -> Result<String, ExportError> {
    sampled.check()?;
    let joints = sampled.joints.len();
    let mut text = String::from("t_s");
    for prefix in ["q", "dq", "ddq"] {
        for joint in 1..=joints {
            let _ = write!(text, ",{prefix}{joint}");
        }
    }
    text.push('\n');
    for (sample, time) in sampled.times_s.iter().enumerate() {
        let _ = write!(text, "{time}");
        for order in 0..3 {
            for joint in 0..joints {
                let _ = write!(text, ",{}", sampled.at(joint, sample)[order]);
            }
        }
        text.push('\n');
    }
    Ok(text)
}
