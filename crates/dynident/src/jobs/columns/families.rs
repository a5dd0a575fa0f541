//! Columns of one quantity, one per joint.

use super::meaning::{JointKey, Meaning, Source, meaning, of_file};
use super::quantity::Quantity;
use super::units::with_unit;
use crate::result::LogContents;
use std::path::Path;

/// Columns of one quantity, one per joint of `joints`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::jobs) struct Family {
    pub(in crate::jobs) file: usize,
    /// Index of the group (topic) within it.
    pub(in crate::jobs) group: usize,
    pub(in crate::jobs) quantity: Quantity,
    pub(in crate::jobs) source: Source,
    pub(in crate::jobs) unit: Option<&'static str>,
    /// Whether the file name, not the column names, gives the quantity.
    pub(in crate::jobs) by_file_name: bool,
    /// Joint and name of each column: in the order of the robot's joints, of the numbers, or of the file.
    pub(in crate::jobs) columns: Vec<(JointKey, String)>,
}

pub(in crate::jobs) fn families<'a>(
    logs: impl IntoIterator<Item = (&'a Path, &'a LogContents)>,
    joints: &[String],
) -> Vec<Family> {
    let mut found: Vec<(String, Family)> = Vec::new();
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
            let same = |(of, family): &&mut (String, Family)| {
                (family.file, family.group, family.quantity) == (file, channel.group, quantity)
                    && *of == stem
                    && core::mem::discriminant(&family.columns[0].0) == core::mem::discriminant(&joint)
            };
            let column = (joint.clone(), channel.name.clone());
            match found.iter_mut().find(same) {
                // Of several columns for one joint, the first is used.
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
        // In the order of the robot's joints, or by number; other names keep the order of the file.
        family.columns.sort_by_key(|(key, _)| match key {
            JointKey::Joint(place) => *place as u64,
            JointKey::Number(number) => *number,
            JointKey::Name(_) | JointKey::Alone => 0,
        });
    }
    found
}

/// The best family with this quantity: measured before commanded, then the largest number of joints; the first of
/// equals.
pub(in crate::jobs) fn best(
    families: &[Family],
    quantity: Quantity,
    fits: impl Fn(&Family) -> bool,
) -> Option<&Family> {
    let of_quantity = families.iter().filter(|family| family.quantity == quantity && fits(family));
    of_quantity.rev().max_by_key(|family| (family.source > Source::Commanded, family.columns.len(), family.source))
}
