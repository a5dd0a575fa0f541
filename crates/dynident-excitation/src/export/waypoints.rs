//! Waypoints: times and positions with the names of the joints.

use super::{ExportError, Sampled};
use core::fmt::Write;
use dynident_text::csv_field;

/// Columns `t_s, <joint names>`, one row per time, rad (m); names are fields of RFC 4180 ([`csv_field`]).
///
/// # Errors
/// Different lengths of names, times and motion; values that are not finite.
pub fn waypoints_csv(sampled: &Sampled<'_>) -> Result<String, ExportError> {
    sampled.check()?;
    let mut text = String::from("t_s");
    for name in sampled.joints {
        text.push(',');
        text.push_str(&csv_field(name));
    }
    text.push('\n');
    for (sample, time) in sampled.times_s.iter().enumerate() {
        let _ = write!(text, "{time}");
        for joint in 0..sampled.joints.len() {
            let _ = write!(text, ",{}", sampled.at(joint, sample)[0]);
        }
        text.push('\n');
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::tests::sampled;

    #[test]
    fn names_are_quoted_and_rows_contain_positions() {
        let (mut joints, times, motion) = sampled(2, 3);
        joints[1] = "elbow".to_owned();
        let text = waypoints_csv(&Sampled { joints: &joints, times_s: &times, motion: &motion }).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "t_s,\"joint \"\"0\"\", a\",elbow");
        assert_eq!(lines[2], format!("{},{},{}", times[1], motion.q[1], motion.q[4]));
        assert_eq!(lines.len(), 4);
    }
}
