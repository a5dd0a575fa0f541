//! Proposed `[format]` of a study for a recording.

use crate::jobs::columns::{
    JointKey, Quantity, Source, best, best_command, best_torque, column_list, families, is_unsigned, joint_pattern,
    time_as_toml,
};
use crate::result::LogContents;
use core::fmt::Write;
use dynident_text::quoted;
use std::path::Path;

/// A draft of a study's `[format]` from the names of columns alone, without information about the robot.
pub(super) fn study_format(found: &LogContents) -> String {
    if !found.has_episodes() {
        return of_recording(found, "");
    }
    let episodes = found.clone().episodes();
    let part = |(part, contents): &(Option<String>, LogContents)| {
        let name = quoted(part.as_deref().unwrap_or_default());
        let count = found.groups.len();
        of_recording(contents, &format!("part = {name}  # one of {count} episodes; write `part` into each [[log]]\n"))
    };
    episodes.first().map_or_else(String::new, part)
}

/// The draft for one recording, with `first` as its first lines.
fn of_recording(found: &LogContents, first: &str) -> String {
    let all = families([(Path::new(&found.file), found)], &[]);
    let position = best(&all, Quantity::Position, |_| true);
    let command = best_command(&all, |family| position != Some(family));
    let torque = best_torque(&all, position, |family| command.is_none() || !is_unsigned(family, found));
    let drive = match (torque, command) {
        (None, Some(command)) => ("command", "rad", Some(command)),
        (torque, _) => ("torque", "N m", torque),
    };
    let group = position.or(drive.2).map_or(0, |family| family.group);
    let mut text = format!("[format]\n{first}");
    match found.groups.get(group).and_then(|group| group.time.as_ref()) {
        Some(time) => {
            let _ = writeln!(text, "time = {}", time_as_toml(time, found.unit(group, time)));
        }
        None => text += "rate_hz = 0.0  # no time column recognised: give the sample rate, or time = { column = .. }\n",
    }
    for (key, usual, family) in [("position", "rad", position), drive] {
        let Some(family) = family else {
            let _ = writeln!(text, "{key} = {{ columns = [] }}  # not recognised by name: list the columns");
            continue;
        };
        let names: Vec<String> = family.columns.iter().map(|(_, name)| name.clone()).collect();
        let unit = family.unit.filter(|unit| *unit != usual);
        let unit = unit.map_or(String::new(), |unit| format!(", unit = \"{unit}\""));
        // The robot gives the order of joints with names.
        let pattern = joint_pattern(&family.columns);
        let is_named = matches!(family.columns[0].0, JointKey::Name(_));
        let note = if pattern.is_some() {
            "  # {joint}: every joint of the robot by its name in the log"
        } else if is_named {
            "  # in the order of the log, not of the robot: sort the columns by its joints"
        } else if family.in_message_order {
            "  # in the order of the message, which has no joint names: compare it with the robot"
        } else if family.source == Source::Commanded && key != "command" {
            "  # commanded, not measured"
        } else if family.source == Source::Computed {
            "  # computed, not measured"
        } else {
            ""
        };
        let columns = pattern.map_or_else(|| column_list(&names), |pattern| quoted(&pattern));
        let _ = writeln!(text, "{key} = {{ columns = {columns}{unit} }}{note}");
    }
    text
}
