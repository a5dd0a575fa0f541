//! Proposed `[format]` of a study for a recording.

use crate::jobs::columns::{JointKey, Quantity, best, column_list, families, time_as_toml};
use crate::result::LogContents;
use core::fmt::Write;
use std::path::Path;

/// A draft of a study's `[format]` from column names only, without knowledge of the robot.
pub(super) fn study_format(found: &LogContents) -> String {
    let all = families([(Path::new(&found.file), found)], &[]);
    let position = best(&all, Quantity::Position, |_| true);
    let torque = best(&all, Quantity::Torque, |_| true).or_else(|| best(&all, Quantity::Current, |_| true));
    let group = position.or(torque).map_or(0, |family| family.group);
    let mut text = "[format]\n".to_owned();
    match found.groups.get(group).and_then(|group| group.time.as_ref()) {
        Some(time) => {
            let _ = writeln!(text, "time = {}", time_as_toml(time, found.unit(group, time)));
        }
        None => text += "rate_hz = 0.0  # no time column recognised: give the sample rate, or time = { column = .. }\n",
    }
    for (key, usual, family) in [("position", "rad", position), ("torque", "N m", torque)] {
        let Some(family) = family else {
            let _ = writeln!(text, "{key} = {{ columns = [] }}  # not recognised by name: list the columns");
            continue;
        };
        let names: Vec<String> = family.columns.iter().map(|(_, name)| name.clone()).collect();
        let unit = family.unit.filter(|unit| *unit != usual);
        let unit = unit.map_or(String::new(), |unit| format!(", unit = \"{unit}\""));
        // Names of joints, but no robot that gives their order.
        let is_named = family.columns.iter().any(|(key, _)| matches!(key, JointKey::Name(_)));
        let order =
            if is_named { "  # in the order of the log; `dynident new` finds the order of the robot" } else { "" };
        let _ = writeln!(text, "{key} = {{ columns = {}{unit} }}{order}", column_list(&names));
    }
    text
}
