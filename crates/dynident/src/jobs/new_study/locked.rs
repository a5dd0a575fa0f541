//! Joints in a log that are locked: joints that stand still, joints of another publisher, joints without torque, and
//! grippers whose positions have no unit.

use super::channels::{RobotJoints, in_order, partial_places};
use crate::jobs::columns::{Family, JointKey, Quantity, is_unsigned};
use crate::result::LogContents;
use std::path::Path;

/// A joint that is locked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct LockedJoint {
    pub(super) joint: usize,
    /// The column of its position.
    pub(super) column: String,
    pub(super) reason: &'static str,
    pub(super) is_sure: bool,
}

impl LockedJoint {
    /// A joint with a constant position and torque. `carries` states whether it carries a joint that moves, so that a
    /// dead channel is possible too.
    pub(super) fn still(joint: usize, column: &str, carries: bool) -> Self {
        let reason = if carries {
            "its position and torque are constant in all recordings: it stands still, or its channels are dead"
        } else {
            "its position and torque are constant in all recordings, so it is locked there"
        };
        Self { joint, column: column.to_owned(), reason, is_sure: !carries }
    }

    /// A joint with a position and without a torque, next to joints with torques.
    pub(super) fn without_torque(joint: usize, column: &str, is_still: bool, is_gripper: bool) -> Self {
        let reason = if is_still || is_gripper {
            "the recordings have no torque of it, so it is locked in the middle of its recorded positions"
        } else {
            "the recordings have no torque of it, so it is locked in the middle of its recorded positions, although it moves"
        };
        Self { joint, column: column.to_owned(), reason, is_sure: is_still || is_gripper }
    }

    /// A gripper that is logged as a share of its range.
    pub(super) fn share(joint: usize, column: &str) -> Self {
        let reason = "its positions exceed its limits in m (mm) and rad (deg): probably a share of its range, so it is locked in the middle of its recorded positions";
        Self { joint, column: column.to_owned(), reason, is_sure: false }
    }
}

/// The recorded torques and currents with signs in the file of the positions, or in a file with the same number of
/// rows.
pub(super) fn recorded_torques(all: &[Family], position: &Family, logs: &[(&Path, LogContents)]) -> Vec<Family> {
    let rows = |family: &Family| logs[family.file].1.groups.get(family.group).map(|group| group.rows);
    let is_recorded = |family: &&Family| {
        matches!(family.quantity, Quantity::Torque | Quantity::Current)
            && family.source.is_recorded()
            && (family.file == position.file || rows(family) == rows(position))
            && !is_unsigned(family, &logs[family.file].1)
    };
    all.iter().filter(is_recorded).cloned().collect()
}

/// The places of the joints with torque, if none of `torques` has columns for all `joints`. The other joints, such as a
/// gripper, must not carry them and be fewer. `None` otherwise.
pub(super) fn places_with_torque(
    torques: &[Family],
    position: &Family,
    joints: &[usize],
    robot: &RobotJoints<'_>,
) -> Option<Vec<usize>> {
    if torques.iter().any(|family| in_order(family, position, joints).is_some()) {
        return None;
    }
    let is_beyond = |places: &Vec<usize>| {
        let mut carriers = places.iter().filter_map(|place| robot.carriers.get(joints[*place])).flatten();
        let is_other =
            |joint: &usize| joints.iter().position(|own| own == joint).is_some_and(|at| !places.contains(&at));
        2 * places.len() > joints.len() && !carriers.any(is_other)
    };
    let of_torques = torques.iter().filter_map(|family| partial_places(family, position, joints));
    of_torques.filter(is_beyond).max_by_key(Vec::len)
}

/// The range of a column in all recordings.
pub(super) fn range(logs: &[(&Path, LogContents)], column: &str) -> Option<[f64; 2]> {
    let own = |(_, log): &(&Path, LogContents)| log.channels.iter().find(|channel| channel.name == column)?.range;
    logs.iter().filter_map(own).reduce(|[low, high], [from, to]| [low.min(from), high.max(to)])
}

/// Columns of all joints, and the recordings that contain them.
pub(super) type LoggedColumns<'a> = (&'a [(&'a Path, LogContents)], &'a [String]);

/// Places of the joints whose positions and torques have ranges of at most `max_share` of the largest ones.
pub(super) fn still_places(quantities: [LoggedColumns<'_>; 2], max_share: f64) -> Vec<usize> {
    let widths = quantities.map(|(logs, columns)| -> Vec<f64> {
        let width = |name: &String| range(logs, name).map_or(0.0, |[low, high]| high - low);
        columns.iter().map(width).collect()
    });
    let is_still = |place: &usize| {
        widths.iter().all(|widths| {
            let largest = widths.iter().copied().fold(0.0, f64::max);
            largest > 0.0 && widths[*place] <= max_share * largest
        })
    };
    (0..widths[0].len()).filter(is_still).collect()
}

/// Separates the joints that are never in the same row as the others: a gripper whose driver publishes on the topic of
/// the arm.
pub(super) fn without_other_publisher(position: Family, contents: &LogContents) -> (Family, Vec<LockedJoint>) {
    let locked = |(key, name): &(JointKey, String)| {
        let JointKey::Joint(joint) = key else { return None };
        is_of_other_publisher(&position, name, contents).then(|| LockedJoint {
            joint: *joint,
            column: name.clone(),
            reason: "another publisher sends it: it is in no row of the other joints",
            is_sure: true,
        })
    };
    let apart: Vec<LockedJoint> = position.columns.iter().filter_map(locked).collect();
    let is_kept = |(_, name): &(JointKey, String)| apart.iter().all(|locked| locked.column != *name);
    let columns = position.columns.iter().filter(|column| is_kept(column)).cloned().collect();
    (Family { columns, ..position }, apart)
}

/// Whether the column `name` is in none of the rows of most columns of `position`: the numbers of their samples add up
/// to that of the rows.
pub(super) fn is_of_other_publisher(position: &Family, name: &str, contents: &LogContents) -> bool {
    let samples = |name: &str| {
        let channel = contents.channels.iter().find(|channel| channel.name == name)?;
        Some([channel.samples, channel.samples + channel.missing])
    };
    let most = position.columns.iter().filter_map(|(_, name)| Some(samples(name)?[0])).max().unwrap_or(0);
    samples(name).is_some_and(|[own, rows]| own < most && own + most == rows)
}
