//! ROS 2: a `trajectory_msgs/msg/JointTrajectory` as YAML.

use super::{ExportError, Sampled};
use core::fmt::Write;
use dynident_text::quoted;

/// A `JointTrajectory` message with positions, velocities and accelerations, for `ros2 topic pub` and parameter files.
/// Move the arm to the first point before.
///
/// # Source
/// ROS 2 interfaces `trajectory_msgs/msg/JointTrajectory`, `trajectory_msgs/msg/JointTrajectoryPoint`,
/// `builtin_interfaces/msg/Duration`.
///
/// # Errors
/// Different lengths of names, times and motion; values that are not finite.
pub fn ros2_joint_trajectory(sampled: &Sampled<'_>) -> Result<String, ExportError> {
    sampled.check()?;
    let mut text = String::from("header:\n  stamp: {sec: 0, nanosec: 0}\n  frame_id: \"\"\njoint_names:\n");
    for name in sampled.joints {
        let _ = writeln!(text, "  - {}", quoted(name));
    }
    text.push_str("points:\n");
    for (sample, time) in sampled.times_s.iter().enumerate() {
        for (order, key) in ["  - positions", "    velocities", "    accelerations"].into_iter().enumerate() {
            // YAML reads `1` as an integer, but ROS needs a float: `{:?}` writes the decimal point.
            let row: Vec<String> =
                (0..sampled.joints.len()).map(|joint| format!("{:?}", sampled.at(joint, sample)[order])).collect();
            let _ = writeln!(text, "{key}: [{}]", row.join(", "));
        }
        let nanoseconds = (time * 1e9).round() as u64;
        let (sec, nanosec) = (nanoseconds / 1_000_000_000, nanoseconds % 1_000_000_000);
        let _ = writeln!(text, "    time_from_start: {{sec: {sec}, nanosec: {nanosec}}}");
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::tests::sampled;

    #[test]
    fn every_point_has_its_time_and_all_three_orders() {
        let (joints, times, motion) = sampled(2, 5);
        let text = ros2_joint_trajectory(&Sampled { joints: &joints, times_s: &times, motion: &motion }).unwrap();
        assert!(text.contains("joint_names:\n  - \"joint \\\"0\\\", a\"\n"), "{text}");
        for (key, count) in
            [("- positions: [", 5), ("velocities: [", 5), ("accelerations: [", 5), ("sec: 1, nanosec: 500000000}", 1)]
        {
            assert_eq!(text.matches(key).count(), count, "{key}\n{text}");
        }
        let line = format!("  - positions: [{:?}, {:?}]", motion.q[3], motion.q[5 + 3]);
        assert!(text.contains(&line), "{line}\n{text}");
    }
}
