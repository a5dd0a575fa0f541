//! Groups (families) of columns with one quantity, one column per joint.

use super::meaning::{JointKey, Meaning, Source, is_quantity, meaning, of_file};
use super::quantity::Quantity;
use super::units::with_unit;
use crate::result::LogContents;
use core::cmp::Reverse;
use std::path::Path;

/// How the quantity of a family of columns was determined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::jobs) enum Basis {
    ColumnNames,
    FileName,
    /// By the order of columns without names.
    Order,
    /// The columns have the names of joints and nothing else.
    JointNames,
    /// Nothing but the number of columns.
    Assumption,
}

/// Columns of one quantity, one per joint of `joints`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::jobs) struct Family {
    pub(in crate::jobs) file: usize,
    /// Index of the group (topic) within the file.
    pub(in crate::jobs) group: usize,
    pub(in crate::jobs) quantity: Quantity,
    pub(in crate::jobs) source: Source,
    /// Unit of the first column.
    pub(in crate::jobs) unit: Option<&'static str>,
    /// Columns with another unit.
    pub(in crate::jobs) other_units: Vec<(String, Option<&'static str>)>,
    pub(in crate::jobs) basis: Basis,
    /// The names of the columns without their joints.
    pub(in crate::jobs) stem: String,
    /// Whether the columns are the entries of an array without names in a message, so that the message defines their
    /// order.
    pub(in crate::jobs) in_message_order: bool,
    /// Joint and name of each column: in the order of the robot's joints, of the numbers in the names, or of the
    /// file.
    pub(in crate::jobs) columns: Vec<(JointKey, String)>,
}

impl Family {
    /// The unit in the name of the column `column` of the family.
    pub(in crate::jobs) fn unit_of(&self, column: &str) -> Option<&'static str> {
        self.other_units.iter().find(|(name, _)| name == column).map_or(self.unit, |(_, unit)| *unit)
    }

    /// Rank among families of one quantity: by source, known joints, and number of joints.
    fn rank(&self) -> (Source, bool, usize, bool, Source) {
        let key = &self.columns[0].0;
        // Names of array entries are names of joints; other words can be axes of a tool.
        let is_known = !matches!(key, JointKey::Name(_) | JointKey::Alone) || self.columns[0].1.ends_with(']');
        let is_named = matches!(key, JointKey::Joint(_));
        (self.source.min(Source::Unstated), is_known, self.columns.len(), is_named, self.source)
    }

    /// A guess among equals: a joint's own `q` before the motor's `theta`, and `q` before `q_ik`.
    fn plainness(&self) -> (bool, Reverse<usize>) {
        let is_of_motor = self.stem.split('_').any(|word| ["motor", "theta"].contains(&word));
        (!is_of_motor, Reverse(self.stem.split('_').count()))
    }

    /// Number of words, apart from quantities, that only one of both names has: `arm1_pos` belongs to `arm1_torque`.
    fn distance(&self, other: Option<&Self>) -> usize {
        let words =
            |family: &Self| family.stem.split('_').map(str::to_owned).filter(|word| !is_quantity(word)).collect();
        let Some(other) = other else { return 0 };
        let (own, other): (Vec<String>, Vec<String>) = (words(self), words(other));
        let only = |one: &[String], all: &[String]| one.iter().filter(|word| !all.contains(word)).count();
        only(&own, &other) + only(&other, &own)
    }
}

pub(in crate::jobs) fn families<'a>(
    logs: impl IntoIterator<Item = (&'a Path, &'a LogContents)>,
    joints: &[String],
) -> Vec<Family> {
    let mut found: Vec<Family> = Vec::new();
    for (file, (path, contents)) in logs.into_iter().enumerate() {
        let stem = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        let (of_file, source_of_file) = of_file(&stem);
        // The file has no column names, and a column for each joint.
        let is_nameless = is_nameless(contents) && contents.channels.len() <= joints.len();
        for channel in contents.channels.iter().filter(|channel| channel.samples > 0) {
            let Meaning { quantity, joint, source, unit, stem, .. } =
                meaning(&with_unit(&channel.name, channel.unit.as_deref()), joints);
            // If column names consist of joint names only, the file name gives the quantity.
            let is_joint = matches!(joint, JointKey::Joint(_)) || is_nameless;
            let bare = quantity.is_none() && is_joint && stem.is_empty();
            let (quantity, source) = if bare { (of_file, source_of_file) } else { (quantity, source) };
            let Some(quantity) = quantity else { continue };
            let basis = if bare { Basis::FileName } else { Basis::ColumnNames };
            let in_message_order = is_message(contents, channel.group) && is_array_entry(&channel.name);
            let column = (joint, channel.name.clone());
            let (group, other_units, columns) = (channel.group, Vec::new(), vec![column]);
            let family =
                Family { file, group, quantity, source, unit, other_units, basis, stem, in_message_order, columns };
            add(&mut found, family);
        }
    }
    in_order_of_joints(&mut found);
    found
}

/// Adds `column`, a family with a single column, to the matching family in `found`.
fn add(found: &mut Vec<Family>, column: Family) {
    let same = |family: &&mut Family| {
        (family.file, family.group, family.quantity, &family.stem)
            == (column.file, column.group, column.quantity, &column.stem)
            && core::mem::discriminant(&family.columns[0].0) == core::mem::discriminant(&column.columns[0].0)
    };
    match found.iter_mut().find(same) {
        // If there are several columns for one joint, the first is used.
        Some(family) if family.columns.iter().any(|(key, _)| *key == column.columns[0].0) => {}
        Some(family) => {
            if family.unit != column.unit {
                family.other_units.push((column.columns[0].1.clone(), column.unit));
            }
            family.columns.extend(column.columns);
        }
        None => found.push(column),
    }
}

/// Sorts columns in the order of the robot's joints, or by number; columns with other names keep the order of the
/// file.
fn in_order_of_joints(found: &mut [Family]) {
    for family in found {
        family.columns.sort_by_key(|(key, _)| match key {
            JointKey::Joint(place) => *place as u64,
            JointKey::Number(number) => *number,
            JointKey::Name(_) | JointKey::Alone => 0,
        });
    }
}

/// Groups of columns, one column for each of several joints, whose names contain no quantity: `A1` to `A7`. They
/// become families of `quantity` by assumption.
pub(in crate::jobs) fn families_without_quantity<'a>(
    logs: impl IntoIterator<Item = (&'a Path, &'a LogContents)>,
    joints: &[String],
    quantity: Quantity,
) -> Vec<Family> {
    let mut found: Vec<Family> = Vec::new();
    for (file, (_, contents)) in logs.into_iter().enumerate() {
        let is_time = |name: &str| contents.groups.iter().any(|group| group.time.as_deref() == Some(name));
        let channels = contents.channels.iter().filter(|channel| channel.samples > 0 && !is_time(&channel.name));
        for channel in channels {
            let found_meaning = meaning(&with_unit(&channel.name, channel.unit.as_deref()), joints);
            let Meaning { quantity: None, is_part: false, joint, source, unit, stem } = found_meaning else { continue };
            if matches!(joint, JointKey::Joint(_) | JointKey::Number(_)) {
                let is_name = |joint: &String| joint.eq_ignore_ascii_case(&channel.name);
                let basis = if joints.iter().any(is_name) { Basis::JointNames } else { Basis::Assumption };
                add(
                    &mut found,
                    Family {
                        file,
                        group: channel.group,
                        quantity,
                        source,
                        unit,
                        other_units: Vec::new(),
                        basis,
                        in_message_order: false,
                        stem,
                        columns: vec![(joint, channel.name.clone())],
                    },
                );
            }
        }
    }
    in_order_of_joints(&mut found);
    found
}

/// Whether the columns have no names, or are the entries of one array without a meaning: `M[0]`, `M[1]`.
fn is_nameless(contents: &LogContents) -> bool {
    let array = contents.channels.first().and_then(|channel| channel.name.strip_suffix("[0]"));
    let array = array.filter(|array| of_file(array).0.is_none());
    let is_entry = |at: usize, name: &str| array.is_some_and(|array| name == format!("{array}[{at}]"));
    let mut channels = contents.channels.iter().enumerate();
    channels.all(|(at, channel)| channel.name == at.to_string() || is_entry(at, &channel.name))
}

fn is_message(contents: &LogContents, group: usize) -> bool {
    !contents.has_episodes() && contents.groups.get(group).is_some_and(|group| group.name.is_some())
}

fn is_array_entry(name: &str) -> bool {
    let inside = name.strip_suffix(']').and_then(|name| name.rsplit_once('['));
    inside.is_some_and(|(_, inside)| inside.bytes().all(|byte| byte.is_ascii_digit()))
}

/// The families of columns without names in `contents`: one for each of `quantities`, each with `count` columns, in
/// the order of the file. The time column is not included. Empty if the file has a different number of columns.
pub(in crate::jobs) fn families_by_order(file: usize, contents: &LogContents, counts: &[usize]) -> Vec<Family> {
    use Quantity::{Acceleration, Position, Torque, Velocity};
    let time = contents.groups.first().and_then(|group| group.time.as_ref());
    let columns: Vec<&String> =
        contents.channels.iter().map(|channel| &channel.name).filter(|name| Some(*name) != time).collect();
    let orders = [&[Position, Torque][..], &[Position, Velocity, Torque], &[Position, Velocity, Acceleration, Torque]];
    let fits = |count: &usize| orders.iter().find(|order| *count > 0 && order.len() * count == columns.len());
    let Some((count, order)) = counts.iter().find_map(|count| Some((*count, *fits(count)?))) else { return Vec::new() };
    if !is_nameless(contents) {
        return Vec::new();
    }
    let family = |(quantity, columns): (&Quantity, &[&String])| Family {
        file,
        group: 0,
        quantity: *quantity,
        source: Source::Unstated,
        unit: None,
        other_units: Vec::new(),
        basis: Basis::Order,
        stem: String::new(),
        in_message_order: false,
        columns: (0..).map(JointKey::Number).zip(columns.iter().map(|name| (*name).clone())).collect(),
    };
    order.iter().zip(columns.chunks(count)).map(family).collect()
}

/// The best family with this quantity. Measured families are preferred to filtered, commanded and computed ones; then
/// families with names of joints or with numbers, then the largest number of joints. Among equal families the first
/// is used.
pub(in crate::jobs) fn best(
    families: &[Family],
    quantity: Quantity,
    fits: impl Fn(&Family) -> bool,
) -> Option<&Family> {
    best_next_to(families, quantity, None, fits)
}

/// As [`best`]; of equals, the one whose name is most similar to that of `other`, then the plainest one.
pub(in crate::jobs) fn best_next_to<'a>(
    families: &'a [Family],
    quantity: Quantity,
    other: Option<&Family>,
    fits: impl Fn(&Family) -> bool,
) -> Option<&'a Family> {
    let of_quantity = families.iter().filter(|family| family.quantity == quantity && fits(family));
    of_quantity.rev().max_by_key(|family| (family.rank(), Reverse(family.distance(other)), family.plainness()))
}

/// Another family in the file of `chosen` that differs from it only in its position in the file.
pub(in crate::jobs) fn equal_choice<'a>(
    families: &'a [Family],
    chosen: &Family,
    other: Option<&Family>,
    fits: impl Fn(&Family) -> bool,
) -> Option<&'a Family> {
    families.iter().find(|family| {
        (family.file, family.quantity, family.rank(), family.distance(other))
            == (chosen.file, chosen.quantity, chosen.rank(), chosen.distance(other))
            && *family != chosen
            && fits(family)
    })
}

/// The best family of commanded positions, for a robot whose log has no torque.
pub(in crate::jobs) fn best_command(families: &[Family], fits: impl Fn(&Family) -> bool) -> Option<&Family> {
    best(families, Quantity::Position, |family| family.source == Source::Commanded && fits(family))
}

/// Whether the columns of several joints contain no negative value. They are then the magnitude of a current or
/// torque without its sign, which is not usable as torque.
pub(in crate::jobs) fn is_unsigned(family: &Family, contents: &LogContents) -> bool {
    let range = |name: &String| contents.channels.iter().find(|channel| channel.name == *name)?.range;
    family.columns.len() > 1
        && family.columns.iter().all(|(_, name)| range(name).is_none_or(|[low, _]| low >= 0.0))
        && family.columns.iter().any(|(_, name)| range(name).is_some_and(|[_, high]| high > 0.0))
}

/// The best torques for these positions, in this order of preference: measured torques, measured currents, commanded
/// torques, commanded currents, computed torques.
pub(in crate::jobs) fn best_torque<'a>(
    families: &'a [Family],
    position: Option<&Family>,
    fits: impl Fn(&Family) -> bool,
) -> Option<&'a Family> {
    let torque = best_next_to(families, Quantity::Torque, position, &fits);
    let current = best_next_to(families, Quantity::Current, position, &fits);
    let tier = |family: &Family| family.source.min(Source::Unstated);
    match (torque, current) {
        (Some(torque), Some(current)) if tier(current) > tier(torque) => Some(current),
        (Some(torque), _) => Some(torque),
        (None, current) => current,
    }
}
