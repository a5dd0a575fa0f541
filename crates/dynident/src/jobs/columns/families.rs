//! Columns of one quantity, one per joint.

use super::meaning::{JointKey, Meaning, Source, meaning, of_file};
use super::quantity::Quantity;
use super::units::with_unit;
use crate::result::LogContents;
use std::path::Path;

/// Source of the quantity of columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::jobs) enum Basis {
    ColumnNames,
    FileName,
    /// The order of columns without names.
    Order,
}

/// Columns of one quantity, one per joint of `joints`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::jobs) struct Family {
    pub(in crate::jobs) file: usize,
    /// Index of the group (topic) within it.
    pub(in crate::jobs) group: usize,
    pub(in crate::jobs) quantity: Quantity,
    pub(in crate::jobs) source: Source,
    pub(in crate::jobs) unit: Option<&'static str>,
    pub(in crate::jobs) basis: Basis,
    /// The names without their joints.
    pub(in crate::jobs) stem: String,
    /// Whether the columns are the entries of a message's array without names: the message gives their order.
    pub(in crate::jobs) in_message_order: bool,
    /// Joint and name of each column: in the order of the robot's joints, of the numbers, or of the file.
    pub(in crate::jobs) columns: Vec<(JointKey, String)>,
}

pub(in crate::jobs) fn families<'a>(
    logs: impl IntoIterator<Item = (&'a Path, &'a LogContents)>,
    joints: &[String],
) -> Vec<Family> {
    let mut found: Vec<Family> = Vec::new();
    for (file, (path, contents)) in logs.into_iter().enumerate() {
        let stem = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        let (of_file, source_of_file) = of_file(&stem);
        for channel in contents.channels.iter().filter(|channel| channel.samples > 0) {
            let Meaning { quantity, joint, source, unit, stem } =
                meaning(&with_unit(&channel.name, channel.unit.as_deref()), joints);
            // The file name gives the quantity of columns that are named by joints alone.
            let bare = quantity.is_none() && matches!(joint, JointKey::Joint(_)) && stem.is_empty();
            let (quantity, source) = if bare { (of_file, source_of_file) } else { (quantity, source) };
            let Some(quantity) = quantity else { continue };
            let same = |family: &&mut Family| {
                (family.file, family.group, family.quantity) == (file, channel.group, quantity)
                    && family.stem == stem
                    && core::mem::discriminant(&family.columns[0].0) == core::mem::discriminant(&joint)
            };
            let column = (joint.clone(), channel.name.clone());
            match found.iter_mut().find(same) {
                // Of several columns for one joint, the first is used.
                Some(family) if family.columns.iter().any(|(key, _)| *key == joint) => {}
                Some(family) => family.columns.push(column),
                None => found.push(Family {
                    file,
                    group: channel.group,
                    quantity,
                    source,
                    unit,
                    basis: if bare { Basis::FileName } else { Basis::ColumnNames },
                    in_message_order: is_message(contents, channel.group) && is_array_entry(&channel.name),
                    stem,
                    columns: vec![column],
                }),
            }
        }
    }
    for family in &mut found {
        // In the order of the robot's joints, or by number; other names keep the order of the file.
        family.columns.sort_by_key(|(key, _)| match key {
            JointKey::Joint(place) => *place as u64,
            JointKey::Number(number) => *number,
            JointKey::Name(_) | JointKey::Alone => 0,
        });
    }
    found
}

fn is_message(contents: &LogContents, group: usize) -> bool {
    !contents.has_episodes() && contents.groups.get(group).is_some_and(|group| group.name.is_some())
}

fn is_array_entry(name: &str) -> bool {
    let inside = name.strip_suffix(']').and_then(|name| name.rsplit_once('['));
    inside.is_some_and(|(_, inside)| inside.bytes().all(|byte| byte.is_ascii_digit()))
}

/// The families of columns without names in `contents`: one for each of `quantities`, each with `count` columns, in the
/// order of the file. The time column is left out. Empty if the number of columns is another.
pub(in crate::jobs) fn families_by_order(file: usize, contents: &LogContents, counts: &[usize]) -> Vec<Family> {
    use Quantity::{Acceleration, Position, Torque, Velocity};
    let time = contents.groups.first().and_then(|group| group.time.as_ref());
    let is_nameless = contents.channels.iter().enumerate().all(|(at, channel)| channel.name == at.to_string());
    let columns: Vec<&String> =
        contents.channels.iter().map(|channel| &channel.name).filter(|name| Some(*name) != time).collect();
    let orders = [&[Position, Torque][..], &[Position, Velocity, Torque], &[Position, Velocity, Acceleration, Torque]];
    let fits = |count: &usize| orders.iter().find(|order| *count > 0 && order.len() * count == columns.len());
    let Some((count, order)) = counts.iter().find_map(|count| Some((*count, *fits(count)?))) else { return Vec::new() };
    if !is_nameless {
        return Vec::new();
    }
    let family = |(quantity, columns): (&Quantity, &[&String])| Family {
        file,
        group: 0,
        quantity: *quantity,
        source: Source::Unstated,
        unit: None,
        basis: Basis::Order,
        stem: String::new(),
        in_message_order: false,
        columns: (0..).map(JointKey::Number).zip(columns.iter().map(|name| (*name).clone())).collect(),
    };
    order.iter().zip(columns.chunks(count)).map(family).collect()
}

/// The best family with this quantity: measured before commanded before computed, then columns with the names of joints
/// or with numbers, then the largest number of joints; the first of equals.
pub(in crate::jobs) fn best(
    families: &[Family],
    quantity: Quantity,
    fits: impl Fn(&Family) -> bool,
) -> Option<&Family> {
    let of_quantity = families.iter().filter(|family| family.quantity == quantity && fits(family));
    of_quantity.rev().max_by_key(|family| {
        let key = &family.columns[0].0;
        // Names of entries of an array are names of joints; other words may be axes of a tool.
        let is_known = !matches!(key, JointKey::Name(_) | JointKey::Alone) || family.columns[0].1.ends_with(']');
        let is_named = matches!(key, JointKey::Joint(_));
        let source = family.source.min(Source::Unstated);
        (source, is_known, family.columns.len(), is_named, family.source)
    })
}

/// The best commanded positions, for a robot whose torque is not in the log.
pub(in crate::jobs) fn best_command(families: &[Family], fits: impl Fn(&Family) -> bool) -> Option<&Family> {
    best(families, Quantity::Position, |family| family.source == Source::Commanded && fits(family))
}

/// Whether the columns of several joints contain no negative value: the size of a current or load without its sign,
/// which is no torque.
pub(in crate::jobs) fn is_unsigned(family: &Family, contents: &LogContents) -> bool {
    let range = |name: &String| contents.channels.iter().find(|channel| channel.name == *name)?.range;
    family.columns.len() > 1
        && family.columns.iter().all(|(_, name)| range(name).is_none_or(|[low, _]| low >= 0.0))
        && family.columns.iter().any(|(_, name)| range(name).is_some_and(|[_, high]| high > 0.0))
}

/// The best torques: measured torques, measured currents, commanded torques, commanded currents, then computed ones.
pub(in crate::jobs) fn best_torque(families: &[Family], fits: impl Fn(&Family) -> bool) -> Option<&Family> {
    let torque = best(families, Quantity::Torque, &fits);
    let current = best(families, Quantity::Current, &fits);
    let tier = |family: &Family| family.source.min(Source::Unstated);
    match (torque, current) {
        (Some(torque), Some(current)) if tier(current) > tier(torque) => Some(current),
        (Some(torque), _) => Some(torque),
        (None, current) => current,
    }
}
