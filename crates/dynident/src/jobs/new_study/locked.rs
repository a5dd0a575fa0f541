//! Joints in a log that are locked: joints that stand still, and joints of another publisher.

use crate::jobs::columns::{Family, JointKey};
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
