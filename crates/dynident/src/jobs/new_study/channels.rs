//! Which columns of which file are the positions and the torques of which joints.

use super::meaning::{JointKey, Meaning, Quantity, Source, meaning, of_file};
use crate::result::LogContents;
use std::path::Path;

/// Columns of one quantity, one for each joint of `joints`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Family {
    /// Number of the recording among those that were given.
    pub(super) file: usize,
    /// Number of the group (topic) within it.
    pub(super) group: usize,
    pub(super) quantity: Quantity,
    pub(super) source: Source,
    pub(super) unit: Option<&'static str>,
    /// What says the quantity: the columns' names or the file's.
    pub(super) by_file_name: bool,
    /// Joint and name of each column, in the order of the file.
    pub(super) columns: Vec<(JointKey, String)>,
}

/// Every family of columns in the recordings.
pub(super) fn families(logs: &[(&Path, LogContents)], joints: &[String]) -> Vec<Family> {
    let mut found: Vec<(String, Family)> = Vec::new();
    for (file, (path, contents)) in logs.iter().enumerate() {
        let stem = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        let (of_file, source_of_file) = of_file(&stem);
        for channel in contents.channels.iter().filter(|channel| channel.samples > 0) {
            let Meaning { quantity, joint, source, unit, stem } = meaning(&channel.name, joints);
            // Columns that are named by joints alone: the file says what they are.
            let bare = quantity.is_none() && matches!(joint, JointKey::Joint(_)) && stem.is_empty();
            let (quantity, source) = if bare { (of_file, source_of_file) } else { (quantity, source) };
            let Some(quantity) = quantity else { continue };
            let same = |(of, family): &&mut (String, Family)| {
                (family.file, family.group, family.quantity) == (file, channel.group, quantity)
                    && *of == stem
                    && core::mem::discriminant(&family.columns[0].0) == core::mem::discriminant(&joint)
            };
            let column = (joint.clone(), channel.name.clone());
            match found.iter_mut().find(same) {
                // One column for each joint: of several the first.
                Some((_, family)) if family.columns.iter().any(|(key, _)| *key == joint) => {}
                Some((_, family)) => family.columns.push(column),
                None => found.push((
                    stem,
                    Family {
                        file,
                        group: channel.group,
                        quantity,
                        source,
                        unit,
                        by_file_name: bare,
                        columns: vec![column],
                    },
                )),
            }
        }
    }
    let mut found: Vec<Family> = found.into_iter().map(|(_, family)| family).collect();
    for family in &mut found {
        // By number where numbers say the joint; names keep the order of the file.
        family.columns.sort_by_key(|(key, _)| match key {
            JointKey::Number(number) => *number,
            JointKey::Joint(_) | JointKey::Alone => 0,
        });
    }
    found
}

/// The family with this quantity that says most: of the most joints, nearest to the joint; of equals the first.
pub(super) fn best<'a>(
    families: &'a [Family],
    quantity: Quantity,
    fits: impl Fn(&Family) -> bool,
) -> Option<&'a Family> {
    let of_quantity = families.iter().filter(|family| family.quantity == quantity && fits(family));
    of_quantity.rev().max_by_key(|family| (family.source > Source::Commanded, family.columns.len(), family.source))
}

/// Which joints of the robot a family's columns are, in the order of the columns, and whether that is sure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct LoggedJoints {
    /// Places of the robot's joints.
    pub(super) joints: Vec<usize>,
    /// Why these.
    pub(super) reason: String,
    pub(super) is_sure: bool,
}

/// The joints behind the columns of `family`, for a robot whose joints that move by themselves stand at the places
/// `free` and turn where `turns` says so; none where the columns are more than the joints.
pub(super) fn logged_joints(family: &Family, free: &[usize], turns: impl Fn(usize) -> bool) -> Option<LoggedJoints> {
    let of_name = |(key, _): &(JointKey, String)| match key {
        JointKey::Joint(place) => Some(*place),
        JointKey::Number(_) | JointKey::Alone => None,
    };
    let named: Option<Vec<usize>> = family.columns.iter().map(of_name).collect();
    if let Some(joints) = named {
        return Some(LoggedJoints { joints, reason: "the columns' names say the joints".to_owned(), is_sure: true });
    }
    let count = family.columns.len();
    let turning: Vec<usize> = free.iter().copied().filter(|&joint| turns(joint)).collect();
    let of_all = format!("{count} columns, as many as the robot has joints, in the order of the description");
    let of_turning = format!("{count} columns, as many as the robot has joints that turn, in that order");
    let of_first = format!("{count} columns for {} joints: taken for the first ones of the description", free.len());
    match count {
        _ if count == free.len() => Some(LoggedJoints { joints: free.to_vec(), reason: of_all, is_sure: true }),
        _ if count == turning.len() => Some(LoggedJoints { joints: turning, reason: of_turning, is_sure: true }),
        _ if count < free.len() => {
            Some(LoggedJoints { joints: free[..count].to_vec(), reason: of_first, is_sure: false })
        }
        _ => None,
    }
}

/// The columns of `family` in the order of `joints`; none where one is missing.
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
    use crate::result::{LOG_SCHEMA, LogChannel};

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
        let found = families(&logs, &joints);
        let position = best(&found, Quantity::Position, |_| true).unwrap();
        assert_eq!(position.source, Source::Measured);
        let logged = logged_joints(position, &[0, 1], |_| true).unwrap();
        assert!(logged.is_sure && logged.joints == [0, 1]);
        let torque = best(&found, Quantity::Torque, |_| true).unwrap();
        // In the order of the positions, not in that of the file.
        assert_eq!(in_order(torque, position, &logged.joints).unwrap(), ["tau_0", "tau_1"]);
        assert_eq!(found.iter().filter(|family| family.quantity == Quantity::Torque).count(), 1);
    }

    #[test]
    fn files_say_what_columns_of_joints_are() {
        let joints = ["Joint_1", "Joint_2"].map(str::to_owned);
        let logs = [
            (Path::new("pos_read_data.csv"), contents(&["Joint_1", "Joint_2"])),
            (Path::new("curr_data.csv"), contents(&["Joint_1", "Joint_2"])),
        ];
        let found = families(&logs, &joints);
        assert_eq!(best(&found, Quantity::Position, |_| true).unwrap().file, 0);
        assert!(best(&found, Quantity::Current, |_| true).unwrap().by_file_name);
    }

    #[test]
    fn fingers_that_are_not_in_the_log_are_left_out() {
        let names: Vec<String> = (1..=7).map(|k| format!("q{k}_rad")).collect();
        let logs = [(Path::new("run.csv"), contents(&names.iter().map(String::as_str).collect::<Vec<_>>()))];
        let found = families(&logs, &[]);
        let free: Vec<usize> = (0..9).collect();
        let logged = logged_joints(&found[0], &free, |joint| joint < 7).unwrap();
        assert!(logged.is_sure && logged.joints == (0..7).collect::<Vec<_>>(), "{logged:?}");
        assert!(!logged_joints(&found[0], &free, |_| true).unwrap().is_sure);
        assert_eq!(logged_joints(&found[0], &free[..5], |_| true), None);
    }
}
