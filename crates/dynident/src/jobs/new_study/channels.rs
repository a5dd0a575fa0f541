//! Assigns the columns of a family to the robot's joints.

use super::grippers::is_gripper;
use crate::jobs::columns::{Basis, Family, JointKey, is_quantity, words};
use crate::result::LogContents;
use dynident_model::{JointKind, Model};
use std::path::Path;

/// The joint of each column, and whether the assignment is certain.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct LoggedJoints {
    /// Joint indices in the order of the columns.
    pub(super) joints: Vec<usize>,
    pub(super) reason: String,
    pub(super) is_sure: bool,
}

/// The joints of a robot to which columns can belong.
#[derive(Clone, Debug)]
pub(super) struct RobotJoints<'a> {
    /// Names of all joints.
    pub(super) names: &'a [String],
    /// Indices of the joints that do not follow others.
    pub(super) free: Vec<usize>,
    /// Indices of the revolute joints among them.
    pub(super) turning: Vec<usize>,
    /// For each joint, the joints that carry it.
    pub(super) carriers: Vec<Vec<usize>>,
}

impl<'a> RobotJoints<'a> {
    /// The joints of a robot; `free` do not follow others.
    pub(super) fn new(model: &Model, names: &'a [String], free: Vec<usize>) -> Self {
        let is_rotary = |joint: &usize| model.joints()[*joint].kind != JointKind::Prismatic;
        let turning = free.iter().copied().filter(is_rotary).collect();
        let moves = |other: usize, joint: usize| other != joint && model.moves(other, model.body_of(joint));
        let carriers_of = |joint| (0..model.dof()).filter(|&other| moves(other, joint)).collect();
        Self { names, free, turning, carriers: (0..model.dof()).map(carriers_of).collect() }
    }

    /// Whether `joint` carries one of the `logged` joints that is not among the places in `still`.
    pub(super) fn carries_moving(&self, joint: usize, logged: &[usize], still: &[usize]) -> bool {
        self.carriers.iter().enumerate().any(|(other, carriers)| {
            let at = logged.iter().position(|logged| *logged == other);
            carriers.contains(&joint) && at.is_some_and(|at| !still.contains(&at))
        })
    }

    /// Name of a joint that carries one of `joints` and is missing in the list although it moves independently.
    fn missing_below(&self, joints: &[usize]) -> Option<&str> {
        let mut below = joints.iter().filter_map(|joint| self.carriers.get(*joint)).flatten();
        below.find(|joint| self.free.contains(joint) && !joints.contains(joint)).map(|joint| &self.names[*joint][..])
    }
}

/// Assigns the columns of `family` to the joints: by the names of joints, then by numbers, then in order. `left_out`
/// contains the joint names of further columns of the same kind. `None` if there are more columns than joints.
pub(super) fn logged_joints(family: &Family, robot: &RobotJoints<'_>, left_out: &[String]) -> Option<LoggedJoints> {
    let found = assigned(family, robot, left_out)?;
    let Some(missing) = robot.missing_below(&found.joints).filter(|_| found.is_sure) else { return Some(found) };
    let reason = format!(
        "{}; joint `{missing}` carries some of them and has no column, so it is locked at 0: if it moved or was elsewhere, this is wrong",
        found.reason
    );
    Some(LoggedJoints { reason, is_sure: false, ..found })
}

fn assigned(family: &Family, robot: &RobotJoints<'_>, left_out: &[String]) -> Option<LoggedJoints> {
    let RobotJoints { free, turning, .. } = robot;
    let of_name = |(key, _): &(JointKey, String)| match key {
        JointKey::Joint(place) => Some(*place),
        JointKey::Name(_) | JointKey::Number(_) | JointKey::Alone => None,
    };
    let named: Option<Vec<usize>> = family.columns.iter().map(of_name).collect();
    if let Some(joints) = named {
        let is_complete = free.iter().all(|joint| joints.contains(joint));
        let reason = match left_out.first().filter(|_| !is_complete) {
            Some(name) => format!(
                "joints from the column names; the robot description has no joint `{name}`, its column is not used"
            ),
            None => "joints from the column names".to_owned(),
        };
        return Some(LoggedJoints { joints, reason, is_sure: left_out.is_empty() || is_complete });
    }
    let count = family.columns.len();
    let in_order = |reason: String, is_sure| {
        (count <= free.len()).then(|| LoggedJoints { joints: free[..count].to_vec(), reason, is_sure })
    };
    let foreign: Option<Vec<&str>> = family
        .columns
        .iter()
        .map(|(key, _)| match key {
            JointKey::Name(name) => Some(name.as_str()),
            JointKey::Joint(_) | JointKey::Number(_) | JointKey::Alone => None,
        })
        .collect();
    if let Some(names) = foreign {
        let others: Vec<&str> = left_out.iter().map(String::as_str).filter(|name| !names.contains(name)).collect();
        let unused = match &others[..] {
            [] => String::new(),
            others => format!("; not used, because the robot description has no such joint: {}", others.join(", ")),
        };
        if let Some(joints) = by_words(&names, robot) {
            let reason = format!("joints from the column names, which are parts of the joint names{unused}");
            return Some(LoggedJoints { joints, reason, is_sure: true });
        }
        let unknown = format!("the robot description has no joint `{}`: {count} columns{unused}", names[0]);
        return match by_numbers(&names) {
            Some(places) if count <= free.len() => {
                let joints = places.into_iter().map(|place| free[place]).collect();
                Some(LoggedJoints { joints, reason: format!("{unknown}, assigned by their numbers"), is_sure: false })
            }
            _ => in_order(format!("{unknown}, assigned in their order in the log"), false),
        };
    }
    let of_first =
        format!("{count} columns for {} joints: assigned to the first joints of the robot description", free.len());
    let (joints, of_joints) = match count {
        _ if count == free.len() => (free.clone(), "joints"),
        _ if count == turning.len() => (turning.clone(), "revolute joints"),
        _ => return in_order(of_first, false),
    };
    let reason = format!("{count} columns for the {count} {of_joints}, in the order of the robot description");
    let unnamed = match family.basis {
        Basis::Order => "; the columns have no names",
        _ if family.in_message_order => "; the message has no joint names",
        Basis::Assumption => "; their names state no quantity",
        Basis::ColumnNames | Basis::FileName | Basis::JointNames => "",
    };
    Some(LoggedJoints { joints, reason: format!("{reason}{unnamed}"), is_sure: unnamed.is_empty() })
}

/// The joint of each name whose words are part of the joint's name, or the reverse: `elbow` and `elbow_joint`.
/// Otherwise the joint whose words begin with those of the name: `w1` and `wrist_1_joint`. `joint_1` is `arm_joint1`
/// rather than `arm_finger_joint1`, and `left_gripper` is the only gripper joint whose name contains `left`. `None` if
/// a name matches no joint or several, or if two names match the same joint.
fn by_words(names: &[&str], robot: &RobotJoints<'_>) -> Option<Vec<usize>> {
    let of_joints: Vec<Vec<String>> = robot.names.iter().map(|name| words(&name.to_lowercase())).collect();
    let contains = |all: &[String], part: &[String], is_like: fn(&String, &String) -> bool| {
        let is_part = |window: &[String]| window.iter().zip(part).all(|(word, part)| is_like(word, part));
        part.len() <= all.len() && all.windows(part.len().max(1)).any(is_part)
    };
    let is_equal: fn(&String, &String) -> bool = |word, part| word == part;
    let begins: fn(&String, &String) -> bool = |word, part| {
        let is_number = part.bytes().all(|byte| byte.is_ascii_digit());
        word == part || !is_number && word.starts_with(part.as_str())
    };
    [is_equal, begins].into_iter().find_map(|is_like| {
        let mut joints = Vec::new();
        for name in names {
            let own = words(name);
            let is_of = |joint: usize| {
                contains(&of_joints[joint], &own, is_like) || contains(&own, &of_joints[joint], is_equal)
            };
            let is_of_kind = |joint: &usize| is_gripper(&robot.names[*joint]) == is_gripper(name);
            let mut found: Vec<usize> = robot.free.iter().copied().filter(|&joint| is_of(joint)).collect();
            if found.len() > 1 {
                found.retain(is_of_kind);
            } else if found.is_empty() && is_gripper(name) {
                let side: Vec<&String> = own.iter().filter(|word| !is_gripper(word)).collect();
                let has_side = |joint: &usize| side.iter().all(|word| of_joints[*joint].contains(word));
                found.extend(robot.free.iter().filter(|joint| is_of_kind(joint) && has_side(joint)));
            }
            match found[..] {
                [joint] if !joints.contains(&joint) => joints.push(joint),
                _ => return None,
            }
        }
        Some(joints)
    })
}

/// The rank of each name by its last number, for names that differ only in this number: `j_1, j_2, j_0` gives 1, 2,
/// 0.
fn by_numbers(names: &[&str]) -> Option<Vec<usize>> {
    let split = |name: &&str| {
        let words = words(name);
        let at = words.iter().rposition(|word| word.bytes().all(|byte| byte.is_ascii_digit()))?;
        let number: u64 = words[at].parse().ok()?;
        Some(([&words[..at], &words[at + 1..]].concat(), number))
    };
    let parts: Option<Vec<(Vec<String>, u64)>> = names.iter().map(split).collect();
    let parts = parts.filter(|parts| parts.windows(2).all(|pair| pair[0].0 == pair[1].0))?;
    let mut numbers: Vec<u64> = parts.iter().map(|(_, number)| *number).collect();
    numbers.sort_unstable();
    numbers.dedup();
    let ranks = parts.iter().map(|(_, number)| numbers.binary_search(number).ok());
    if numbers.len() == names.len() { ranks.collect() } else { None }
}

/// Joins families if the log has a column for each of the free joints, but fewer than half of the names are joint
/// names: `Wrist_Roll` next to `Jaw`. Their columns are then treated as unknown names in the order of the file.
pub(super) fn with_partly_foreign_names(
    all: &[Family],
    logs: &[(&Path, LogContents)],
    robot: &RobotJoints<'_>,
) -> Vec<Family> {
    let is_named = |family: &Family| matches!(family.columns[0].0, JointKey::Joint(_));
    let is_foreign = |family: &Family| matches!(family.columns[0].0, JointKey::Name(_));
    let kind = |family: &Family| (family.file, family.group, family.quantity, family.stem.clone());
    let is_few_next_to = |named: &Family, foreign: &Family| {
        is_named(named) && is_foreign(foreign) && named.columns.len() < foreign.columns.len()
    };
    let mut joined: Vec<Family> = Vec::new();
    for family in all {
        let other = all.iter().find(|other| {
            kind(other) == kind(family)
                && (is_few_next_to(family, other) || is_few_next_to(other, family))
                && family.columns.len() + other.columns.len() == robot.free.len()
        });
        let Some(other) = other else {
            joined.push(family.clone());
            continue;
        };
        // Both families are joined when the one with unknown names is processed.
        if is_named(family) {
            continue;
        }
        let name_of = |(key, column): &(JointKey, String)| match key {
            JointKey::Joint(joint) => (JointKey::Name(robot.names[*joint].to_lowercase()), column.clone()),
            _ => (key.clone(), column.clone()),
        };
        let mut columns: Vec<_> = family.columns.iter().chain(&other.columns).map(name_of).collect();
        let place = |column: &String| logs[family.file].1.channels.iter().position(|channel| channel.name == *column);
        columns.sort_by_key(|(_, column)| place(column));
        joined.push(Family { columns, ..family.clone() });
    }
    joined
}

/// Joins columns with names and with numbered names, `q_elbow` next to `q_w1`, if together they have a column for
/// each of the free joints.
pub(super) fn with_numbered_names(
    all: &[Family],
    logs: &[(&Path, LogContents)],
    robot: &RobotJoints<'_>,
) -> Vec<Family> {
    let kind = |family: &Family| (family.file, family.group, family.quantity);
    // The words that a numbered name has in addition to the other name, if it contains all words of the other.
    let further = |numbered: &Family, named: &Family| {
        let of = |family: &Family| family.stem.split('_').map(str::to_owned).collect::<Vec<String>>();
        let (all, part) = (of(numbered), of(named));
        let rest: Vec<String> = all.iter().filter(|word| !part.contains(word)).cloned().collect();
        (part.iter().all(|word| all.contains(word)) && !rest.is_empty()).then(|| rest.join("_"))
    };
    let is = |family: &Family, number: bool| match family.columns[0].0 {
        JointKey::Name(_) => !number,
        JointKey::Number(_) => number,
        JointKey::Joint(_) | JointKey::Alone => false,
    };
    let (mut joined, mut names) = (all.to_vec(), Vec::new());
    for named in all.iter().filter(|family| is(family, false)) {
        let own =
            |family: &&Family| kind(family) == kind(named) && is(family, true) && further(family, named).is_some();
        let numbered: Vec<&Family> = all.iter().filter(own).collect();
        let count = named.columns.len() + numbered.iter().map(|family| family.columns.len()).sum::<usize>();
        if numbered.is_empty() || count != robot.free.len() {
            continue;
        }
        let mut columns = named.columns.clone();
        for family in &numbered {
            let name = further(family, named).unwrap_or_default();
            columns.extend(family.columns.iter().filter_map(|(key, column)| match key {
                JointKey::Number(number) => Some((JointKey::Name(format!("{name}{number}")), column.clone())),
                _ => None,
            }));
        }
        let place = |column: &String| logs[named.file].1.channels.iter().position(|channel| channel.name == *column);
        columns.sort_by_key(|(_, column)| place(column));
        joined.retain(|family| !numbered.contains(&family));
        joined.iter_mut().filter(|family| *family == named).for_each(|family| family.columns.clone_from(&columns));
        names.extend(numbered.iter().filter_map(|family| Some((named.file, named.group, further(family, named)?))));
    }
    // The other quantities of the same joints get the same names: `joint1_effort` next to `joint1_pos`.
    for (file, group, name) in names {
        let is_like = |family: &&mut Family| {
            let words: Vec<&str> = family.stem.split('_').filter(|word| !is_quantity(word)).collect();
            (family.file, family.group) == (file, group) && is(family, true) && words.join("_") == name
        };
        for (key, _) in joined.iter_mut().filter(is_like).flat_map(|family| &mut family.columns) {
            if let JointKey::Number(number) = key {
                *key = JointKey::Name(format!("{name}{number}"));
            }
        }
    }
    joined
}

/// Omits the columns of joints that the robot description does not have, if the log has more columns than the robot
/// joints, and each of the other columns has the name of a joint: the right arm next to the left arm.
pub(super) fn without_other_arms(all: &[Family], robot: &RobotJoints<'_>) -> Vec<Family> {
    let mut all = all.to_vec();
    for family in all.iter_mut().filter(|family| family.columns.len() > robot.free.len()) {
        let name = |key: &JointKey| match key {
            JointKey::Name(name) => Some(name.clone()),
            JointKey::Joint(_) | JointKey::Number(_) | JointKey::Alone => None,
        };
        let is_own = |(key, _): &&(JointKey, String)| name(key).is_some_and(|name| by_words(&[&name], robot).is_some());
        let own: Vec<_> = family.columns.iter().filter(is_own).cloned().collect();
        let names: Vec<String> = own.iter().filter_map(|(key, _)| name(key)).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        if !own.is_empty() && by_words(&names, robot).is_some() {
            family.columns = own;
        }
    }
    all
}

/// Omits the columns of grippers if the robot description has fewer joints than the log, and no gripper joint.
pub(super) fn without_foreign_grippers(all: &[Family], robot: &RobotJoints<'_>) -> Vec<Family> {
    let is_gripper = |(key, _): &(JointKey, String)| matches!(key, JointKey::Name(name) if is_gripper(name));
    let mut all = all.to_vec();
    for family in &mut all {
        if family.columns.len() > robot.free.len() && !family.columns.iter().all(is_gripper) {
            family.columns.retain(|column| !is_gripper(column));
        }
    }
    all
}

/// The columns of `family` in the order of `joints`: by joint, by number, or by the rank of their numbers (`tau1`
/// belongs to `q0`). `None` if a column is missing.
pub(super) fn in_order(family: &Family, logged: &Family, joints: &[usize]) -> Option<Vec<String>> {
    let name_at = |place: usize, joint: usize| {
        let by_name = family.columns.iter().find(|(key, _)| *key == JointKey::Joint(joint));
        let by_number = || family.columns.iter().find(|(key, _)| *key == logged.columns[place].0);
        by_name.or_else(by_number).map(|(_, name)| name.clone())
    };
    let by_key: Option<Vec<String>> = joints.iter().enumerate().map(|(place, joint)| name_at(place, *joint)).collect();
    by_key.or_else(|| {
        let has_numbers = family.columns.iter().all(|(key, _)| matches!(key, JointKey::Number(_)));
        let has_names = logged.columns.iter().any(|(key, _)| matches!(key, JointKey::Name(_)));
        let mut sorted = joints.to_vec();
        sorted.sort_unstable();
        if !has_numbers || has_names || family.columns.len() != joints.len() {
            return None;
        }
        let column = |joint: &usize| Some(family.columns.get(sorted.binary_search(joint).ok()?)?.1.clone());
        joints.iter().map(column).collect()
    })
}

/// The places of the joints with a column of `family`, if the family has columns for some of the joints only. Numbers
/// must be those of the first joints, because others may count from another number. `None` if a column belongs to none
/// of the joints.
pub(super) fn partial_places(family: &Family, logged: &Family, joints: &[usize]) -> Option<Vec<usize>> {
    let has = |place: &usize| {
        let keys = [&JointKey::Joint(joints[*place]), &logged.columns[*place].0];
        family.columns.iter().any(|(key, _)| keys.contains(&key))
    };
    let places: Vec<usize> = (0..joints.len()).filter(has).collect();
    let are_numbers = matches!(family.columns[0].0, JointKey::Number(_));
    let are_first = !are_numbers || places.last() == Some(&(places.len() - 1));
    (places.len() == family.columns.len() && places.len() < joints.len() && are_first).then_some(places)
}

/// The columns that a study of this robot could use, if the log has columns of more joints: those whose names begin
/// like the name of the first one, or the first columns.
pub(super) fn probable_columns(family: &Family, robot: &RobotJoints<'_>) -> Vec<String> {
    let first_word = |key: &JointKey| match key {
        JointKey::Name(name) => words(name).into_iter().next(),
        JointKey::Joint(_) | JointKey::Number(_) | JointKey::Alone => None,
    };
    let arm = first_word(&family.columns[0].0);
    let alike: Vec<&(JointKey, String)> =
        family.columns.iter().filter(|(key, _)| arm.is_some() && first_word(key) == arm).collect();
    let own = if (1..=robot.free.len()).contains(&alike.len()) { alike } else { family.columns.iter().collect() };
    own.into_iter().take(robot.free.len()).map(|(_, name)| name.clone()).collect()
}

/// Whether the columns of `family` have numbers and those of `logged` have joint names, so that the order of the
/// numbers is an assumption.
pub(super) fn is_numbered_next_to_names(family: &Family, logged: &Family) -> bool {
    let is_number = |family: &Family| matches!(family.columns[0].0, JointKey::Number(_));
    is_number(family) && !is_number(logged)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::columns::{Quantity, Source, best, best_torque, equal_choice, families};
    use crate::result::{LOG_SCHEMA, LogChannel};

    fn robot(names: &[String], free: usize, turning: usize) -> RobotJoints<'_> {
        RobotJoints { names, free: (0..free).collect(), turning: (0..turning).collect(), carriers: Vec::new() }
    }

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
        let logged = logged_joints(position, &robot(&joints, 2, 2), &[]).unwrap();
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
        assert!(best(&found, Quantity::Current, |_| true).unwrap().basis == Basis::FileName);
    }

    #[test]
    fn fingers_that_are_not_in_the_log_are_left_out() {
        let names: Vec<String> = (1..=7).map(|k| format!("q{k}_rad")).collect();
        let logs = [(Path::new("run.csv"), contents(&names.iter().map(String::as_str).collect::<Vec<_>>()))];
        let found = families(logs.iter().map(|(path, log)| (*path, log)), &[]);
        let logged = logged_joints(&found[0], &robot(&[], 9, 7), &[]).unwrap();
        assert!(logged.is_sure && logged.joints == (0..7).collect::<Vec<_>>(), "{logged:?}");
        assert!(!logged_joints(&found[0], &robot(&[], 9, 9), &[]).unwrap().is_sure);
        assert_eq!(logged_joints(&found[0], &robot(&[], 5, 5), &[]), None);
    }

    #[test]
    fn a_joint_between_logged_ones_is_a_doubt() {
        let names = ["a", "b", "c", "gripper"].map(|name| format!("joint_{name}"));
        let robot = RobotJoints { carriers: vec![vec![], vec![0], vec![0, 1], vec![0, 1, 2]], ..robot(&names, 4, 4) };
        let logged = |joints: &[&str]| {
            let columns: Vec<String> = joints.iter().map(|joint| format!("joint_{joint}.pos")).collect();
            let logs = [(Path::new("run"), contents(&columns.iter().map(String::as_str).collect::<Vec<_>>()))];
            let found = families(logs.iter().map(|(path, log)| (*path, log)), &names);
            logged_joints(&found[0], &robot, &[]).unwrap()
        };
        assert!(logged(&["a", "b", "c"]).is_sure);
        let doubt = logged(&["a", "c"]);
        assert!(!doubt.is_sure && doubt.reason.contains("`joint_b`") && doubt.joints == [0, 2], "{doubt:?}");
    }

    #[test]
    fn short_names_are_joined_and_assigned() {
        let joints = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint"]
            .map(str::to_owned);
        let columns = ["elbow", "lift", "pan", "w1", "w2"].map(|joint| format!("q_{joint}"));
        let logs = [(Path::new("run"), contents(&columns.each_ref().map(String::as_str)))];
        let all = families(logs.iter().map(|(path, log)| (*path, log)), &joints);
        let robot = robot(&joints, 5, 5);
        let joined = with_numbered_names(&all, &logs, &robot);
        assert_eq!((all.len(), joined.len()), (2, 1), "{joined:?}");
        let logged = logged_joints(&joined[0], &robot, &[]).unwrap();
        assert!(logged.is_sure && logged.joints == [2, 1, 0, 3, 4], "{logged:?}");
    }

    #[test]
    fn torques_of_another_numbering_belong_to_the_joints_in_order() {
        let logs = [(Path::new("run"), contents(&["q0", "q1", "q2", "tau1", "tau2", "tau3"]))];
        let found = families(logs.iter().map(|(path, log)| (*path, log)), &[]);
        let torques = in_order(&found[1], &found[0], &[2, 0, 1]).unwrap();
        assert_eq!(torques, ["tau3", "tau1", "tau2"]);
        assert!(!is_numbered_next_to_names(&found[1], &found[0]));
    }

    #[test]
    fn names_of_one_arm_belong_together() {
        let names = ["l_pos_1", "l_pos_2", "r_pos_1", "r_pos_2", "r_tau_1", "r_tau_2", "l_tau_1", "l_tau_2"];
        let logs = [(Path::new("run"), contents(&names))];
        let all = families(logs.iter().map(|(path, log)| (*path, log)), &[]);
        let position = best(&all, Quantity::Position, |_| true).unwrap();
        let torque = best_torque(&all, Some(position), |_| true).unwrap();
        assert_eq!([position, torque].map(|family| &family.stem[..]), ["l_pos", "l_tau"]);
        assert_eq!(equal_choice(&all, position, None, |_| true).unwrap().stem, "r_pos");
        assert_eq!(equal_choice(&all, torque, Some(position), |_| true), None);
    }

    #[test]
    fn grippers_without_a_joint_are_left_out() {
        let joints = ["panda_joint1", "panda_joint2"].map(str::to_owned);
        let entries = ["joint_2", "joint_1", "gripper"];
        let names: Vec<String> = ["pos", "vel", "torque"]
            .iter()
            .flat_map(|quantity| entries.map(|entry| format!("observation.state[{entry}.{quantity}]")))
            .collect();
        let logs = [(Path::new("set"), contents(&names.iter().map(String::as_str).collect::<Vec<_>>()))];
        let all = families(logs.iter().map(|(path, log)| (*path, log)), &joints);
        let robot = robot(&joints, 2, 2);
        let found = without_foreign_grippers(&all, &robot);
        let position = best(&found, Quantity::Position, |_| true).unwrap();
        let logged = logged_joints(position, &robot, &["gripper".to_owned()]).unwrap();
        assert!(logged.is_sure && logged.joints == [1, 0] && logged.reason.contains("gripper"), "{logged:?}");
        let torque = best(&found, Quantity::Torque, |_| true).unwrap();
        let columns = in_order(torque, position, &logged.joints).unwrap();
        assert_eq!(columns, ["joint_2", "joint_1"].map(|joint| format!("observation.state[{joint}.torque]")));
    }

    #[test]
    fn names_of_joints_come_before_the_order_of_the_message() {
        let joints = ["A1", "A2", "A3"].map(str::to_owned);
        let assigned = |columns: [&str; 3], joints: &[String]| {
            let logs = [(Path::new("run.mcap"), contents(&columns))];
            let found = families(logs.iter().map(|(path, log)| (*path, log)), joints);
            let logged = logged_joints(&found[0], &robot(joints, 3, 3), &[]).unwrap();
            let columns = in_order(&found[0], &found[0], &logged.joints).unwrap();
            let pairs = logged.joints.iter().zip(columns).map(|(joint, column)| format!("{} {column}", joints[*joint]));
            (pairs.collect::<Vec<_>>(), logged.is_sure)
        };
        let (pairs, is_sure) = assigned(["p.effort[A3]", "p.effort[A1]", "p.effort[A2]"], &joints);
        assert_eq!(
            (&pairs[..], is_sure),
            (&["A1 p.effort[A1]", "A2 p.effort[A2]", "A3 p.effort[A3]"].map(str::to_owned)[..], true)
        );
        let shuffled = ["p.effort[lbr_joint_1]", "p.effort[lbr_joint_2]", "p.effort[lbr_joint_0]"];
        let (pairs, is_sure) = assigned(shuffled, &joints);
        assert_eq!(pairs, ["A2 p.effort[lbr_joint_1]", "A3 p.effort[lbr_joint_2]", "A1 p.effort[lbr_joint_0]"]);
        assert!(!is_sure);
        assert!(!assigned(["p.effort[x]", "p.effort[y]", "p.effort[z]"], &joints).1);
        let long = ["pan_joint", "lift_joint", "elbow_joint"].map(str::to_owned);
        let (pairs, is_sure) = assigned(["p.effort[lift]", "p.effort[elbow]", "p.effort[pan]"], &long);
        assert_eq!(pairs, ["lift_joint p.effort[lift]", "elbow_joint p.effort[elbow]", "pan_joint p.effort[pan]"]);
        assert!(is_sure);
    }
}
