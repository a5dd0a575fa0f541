//! Assigns the columns of a family to the robot's joints.

use crate::jobs::columns::{Family, JointKey};

/// Joint of each column, and whether the assignment is certain.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct LoggedJoints {
    /// Joint indices in the order of the columns.
    pub(super) joints: Vec<usize>,
    pub(super) reason: String,
    pub(super) is_sure: bool,
}

/// Assigns the columns of `family` to the joints; `free` are the indices of joints that do not follow others,
/// `is_rotary` whether a joint is revolute. `None` if there are more columns than joints.
pub(super) fn logged_joints(
    family: &Family,
    free: &[usize],
    is_rotary: impl Fn(usize) -> bool,
) -> Option<LoggedJoints> {
    let of_name = |(key, _): &(JointKey, String)| match key {
        JointKey::Joint(place) => Some(*place),
        JointKey::Name(_) | JointKey::Number(_) | JointKey::Alone => None,
    };
    let named: Option<Vec<usize>> = family.columns.iter().map(of_name).collect();
    if let Some(joints) = named {
        return Some(LoggedJoints { joints, reason: "joints from the column names".to_owned(), is_sure: true });
    }
    let count = family.columns.len();
    let turning: Vec<usize> = free.iter().copied().filter(|&joint| is_rotary(joint)).collect();
    let of_all = format!("{count} columns for the {count} joints, in the order of the robot description");
    let of_turning = format!("{count} columns for the {count} revolute joints, in the order of the robot description");
    let of_first =
        format!("{count} columns for {} joints: assigned to the first joints of the robot description", free.len());
    // Names that are not in the robot description do not determine the order.
    let foreign = family.columns.iter().find_map(|(key, _)| match key {
        JointKey::Name(name) => Some(name),
        JointKey::Joint(_) | JointKey::Number(_) | JointKey::Alone => None,
    });
    if let Some(name) = foreign {
        let reason = format!("the robot description has no joint `{name}`: {count} columns, assigned in order");
        return (count <= free.len()).then(|| LoggedJoints { joints: free[..count].to_vec(), reason, is_sure: false });
    }
    match count {
        _ if count == free.len() => Some(LoggedJoints { joints: free.to_vec(), reason: of_all, is_sure: true }),
        _ if count == turning.len() => Some(LoggedJoints { joints: turning, reason: of_turning, is_sure: true }),
        _ if count < free.len() => {
            Some(LoggedJoints { joints: free[..count].to_vec(), reason: of_first, is_sure: false })
        }
        _ => None,
    }
}

/// The columns of `family` in the order of `joints`; `None` if one is missing.
pub(super) fn in_order(family: &Family, logged: &Family, joints: &[usize]) -> Option<Vec<String>> {
    let name_at = |place: usize, joint: usize| {
        let by_name = family.columns.iter().find(|(key, _)| *key == JointKey::Joint(joint));
        let by_number = || family.columns.iter().find(|(key, _)| *key == logged.columns[place].0);
        by_name.or_else(by_number).map(|(_, name)| name.clone())
    };
    joints.iter().enumerate().map(|(place, joint)| name_at(place, *joint)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::columns::{Quantity, Source, best, families};
    use crate::result::{LOG_SCHEMA, LogChannel, LogContents};
    use std::path::Path;

    fn contents(names: &[&str]) -> LogContents {
        let channel = |name: &&str| LogChannel {
            name: (*name).to_owned(),
            group: 0,
            unit: None,
            rate_hz: None,
            samples: 10,
            missing: 0,
            range: Some([-1.0, 1.0]),
            course: Vec::new(),
        };
        LogContents {
            schema: LOG_SCHEMA.to_owned(),
            file: String::new(),
            format: "text".to_owned(),
            bytes: 0,
            groups: Vec::new(),
            channels: names.iter().map(channel).collect(),
            truncated: None,
            notes: Vec::new(),
            study_format: String::new(),
        }
    }

    #[test]
    fn measured_columns_are_taken_and_paired_joint_by_joint() {
        let joints = ["a", "b"].map(|name| format!("joint_{name}"));
        let names =
            ["target_q_0", "target_q_1", "actual_q_0", "actual_q_1", "tau_1", "tau_0", "tau_ext_0", "tau_ext_1"];
        let logs = [(Path::new("run.csv"), contents(&names))];
        let found = families(logs.iter().map(|(path, log)| (*path, log)), &joints);
        let position = best(&found, Quantity::Position, |_| true).unwrap();
        assert_eq!(position.source, Source::Measured);
        let logged = logged_joints(position, &[0, 1], |_| true).unwrap();
        assert!(logged.is_sure && logged.joints == [0, 1]);
        let torque = best(&found, Quantity::Torque, |_| true).unwrap();
        // In the order of the positions, not of the file.
        assert_eq!(in_order(torque, position, &logged.joints).unwrap(), ["tau_0", "tau_1"]);
        assert_eq!(found.iter().filter(|family| family.quantity == Quantity::Torque).count(), 1);
    }

    #[test]
    fn file_names_give_the_quantity_of_joint_columns() {
        let joints = ["Joint_1", "Joint_2"].map(str::to_owned);
        let logs = [
            (Path::new("pos_read_data.csv"), contents(&["Joint_1", "Joint_2"])),
            (Path::new("curr_data.csv"), contents(&["Joint_1", "Joint_2"])),
        ];
        let found = families(logs.iter().map(|(path, log)| (*path, log)), &joints);
        assert_eq!(best(&found, Quantity::Position, |_| true).unwrap().file, 0);
        assert!(best(&found, Quantity::Current, |_| true).unwrap().by_file_name);
    }

    #[test]
    fn fingers_that_are_not_in_the_log_are_left_out() {
        let names: Vec<String> = (1..=7).map(|k| format!("q{k}_rad")).collect();
        let logs = [(Path::new("run.csv"), contents(&names.iter().map(String::as_str).collect::<Vec<_>>()))];
        let found = families(logs.iter().map(|(path, log)| (*path, log)), &[]);
        let free: Vec<usize> = (0..9).collect();
        let logged = logged_joints(&found[0], &free, |joint| joint < 7).unwrap();
        assert!(logged.is_sure && logged.joints == (0..7).collect::<Vec<_>>(), "{logged:?}");
        assert!(!logged_joints(&found[0], &free, |_| true).unwrap().is_sure);
        assert_eq!(logged_joints(&found[0], &free[..5], |_| true), None);
    }
}
