//! ROS 2: a `trajectory_msgs/msg/JointTrajectory` as YAML.

use super::{ExportError, Sampled};
use core::fmt::Write;
use dynident_text::quoted;

/// A `JointTrajectory` message with positions, velocities and accelerations, for `ros2 topic pub` and parameter files.
/// Before sending the message, move the arm to the first point.
///
/// # Source
/// ROS 2 interfaces `trajectory_msgs/msg/JointTrajectory`, `trajectory_msgs/msg/JointTrajectoryPoint`,
/// `builtin_interfaces/msg/Duration`.
///
/// # Errors
/// Different lengths of names, times and motion; values that are not finite.
pub fn ros2_joint_trajectory(sampled: &Sampled<'_>) -> Result<String, ExportError> {
    sampled.check()?;
    let point = |sample: usize| {
        let order = |order: usize| (0..sampled.joints.len()).map(|joint| sampled.at(joint, sample)[order]).collect();
        vec![("positions", order(0)), ("velocities", order(1)), ("accelerations", order(2))]
    };
    Ok(message(sampled.joints, sampled.times_s, point))
}

/// The same message with positions only, for commands that are held from point to point; `commands` contains the
/// values of each joint. Controllers interpolate linearly between such points.
///
/// # Errors
/// Different lengths of names, times and commands; values that are not finite.
pub fn ros2_commands(joints: &[String], times_s: &[f64], commands: &[Vec<f64>]) -> Result<String, ExportError> {
    let shape = |what, expected, found| ExportError::Shape { what, expected, found };
    if joints.len() != commands.len() {
        return Err(shape("joint names", commands.len(), joints.len()));
    }
    for (name, values) in joints.iter().zip(commands) {
        if values.len() != times_s.len() {
            return Err(shape("commands", times_s.len(), values.len()));
        }
        if let Some((_, &at_s)) =
            values.iter().zip(times_s).find(|(value, at_s)| !(value.is_finite() && at_s.is_finite()))
        {
            return Err(ExportError::NotFinite { joint: name.clone(), at_s });
        }
    }
    let point = |sample: usize| vec![("positions", commands.iter().map(|values| values[sample]).collect())];
    Ok(message(joints, times_s, point))
}

/// Text of the message; `point` gives the lists of a sample with their keys.
fn message(joints: &[String], times_s: &[f64], point: impl Fn(usize) -> Vec<(&'static str, Vec<f64>)>) -> String {
    let mut text = String::from("header:\n  stamp: {sec: 0, nanosec: 0}\n  frame_id: \"\"\njoint_names:\n");
    for name in joints {
        let _ = writeln!(text, "  - {}", quoted(name));
    }
    text.push_str("points:\n");
    for (sample, time) in times_s.iter().enumerate() {
        for (place, (key, values)) in point(sample).into_iter().enumerate() {
            // YAML reads `1` as an integer, but ROS needs a float: `{:?}` writes the decimal point.
            let row: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
            let _ = writeln!(text, "  {} {key}: [{}]", if place == 0 { '-' } else { ' ' }, row.join(", "));
        }
        let nanoseconds = (time * 1e9).round() as u64;
        let (sec, nanosec) = (nanoseconds / 1_000_000_000, nanoseconds % 1_000_000_000);
        let _ = writeln!(text, "    time_from_start: {{sec: {sec}, nanosec: {nanosec}}}");
    }
    text
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

    #[test]
    fn commands_have_positions_only() {
        let joints = ["a".to_owned(), "b".to_owned()];
        let commands = [vec![0.5, 1.0], vec![-2.0, 0.25]];
        let text = ros2_commands(&joints, &[0.0, 0.02], &commands).unwrap();
        let expected = "points:\n  - positions: [0.5, -2.0]\n    time_from_start: {sec: 0, nanosec: 0}\n  \
                        - positions: [1.0, 0.25]\n    time_from_start: {sec: 0, nanosec: 20000000}\n";
        assert!(text.ends_with(expected), "{text}");
        let refused = ros2_commands(&joints, &[0.0], &commands).unwrap_err();
        assert_eq!(refused, ExportError::Shape { what: "commands", expected: 1, found: 2 });
        let infinite = [vec![0.5, f64::INFINITY], vec![0.0, 0.0]];
        let refused = ros2_commands(&joints, &[0.0, 0.02], &infinite).unwrap_err();
        assert_eq!(refused, ExportError::NotFinite { joint: "a".to_owned(), at_s: 0.02 });
    }
}
