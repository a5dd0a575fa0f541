//! Reasons for a study's lines, and what was recognised in its recordings.

use crate::error::RecognisedFile;
use crate::jobs::columns::{Basis, Family, Quantity, Source, shown};
use crate::result::LogContents;
use std::path::Path;

/// Maximum number of alternatives in a reason.
const MAX_ALTERNATIVES: usize = 4;
/// Maximum number of kinds of columns of one file in a message.
const MAX_KINDS: usize = 12;

pub(super) fn basis(family: &Family, what: &str, alternatives: &str) -> String {
    let by = match family.basis {
        Basis::FileName => "by file name",
        Basis::ColumnNames => "by column names",
        Basis::Order => "by their order in the file",
        Basis::JointNames => "by the names of joints alone",
        Basis::Assumption => "assumed, because there is one for each joint",
    };
    let unit = family.unit.map_or_else(String::new, |unit| format!(", in {unit}"));
    format!("{}{what} {by}{unit}{alternatives}", source_name(family.source))
}

fn source_name(source: Source) -> &'static str {
    match source {
        Source::Measured => "measured ",
        Source::Commanded => "commanded ",
        Source::Filtered => "filtered ",
        Source::Computed => "computed ",
        Source::Unstated => "",
    }
}

/// The columns that could be used instead of `chosen`, as the end of a reason. The same columns of another recording
/// are no alternative.
pub(super) fn alternatives<'a>(chosen: &Family, all: impl Iterator<Item = &'a Family>) -> String {
    let is_effort = |quantity| matches!(quantity, Quantity::Torque | Quantity::Current);
    let is_like = |family: &&Family| {
        let (own, other) = (chosen.quantity, family.quantity);
        let is_same = own == other && chosen.source == family.source && chosen.columns == family.columns;
        !is_same && (own == other || is_effort(own) && is_effort(other))
    };
    let named = |family: &Family| {
        let names: Vec<String> = family.columns.iter().map(|(_, name)| name.clone()).collect();
        let what = if family.quantity == Quantity::Current { " (motor currents)" } else { "" };
        format!("{}{}{what}", source_name(family.source), shown(&names, 1))
    };
    let others: Vec<String> = all.filter(is_like).take(MAX_ALTERNATIVES).map(named).collect();
    if others.is_empty() { String::new() } else { format!("; not used: {}", others.join(", ")) }
}

/// What was recognised in each recording, for a message; unknown columns come first.
pub(super) fn recognised(all: &[Family], logs: &[(&Path, LogContents)]) -> Vec<RecognisedFile> {
    let of_file = |(file, (path, log)): (usize, &(&Path, LogContents))| {
        let own = || all.iter().filter(move |family| family.file == file).flat_map(|family| &family.columns);
        let (mut known, mut unknown) = (Vec::new(), Vec::new());
        let is_time = |name: &String| log.groups.iter().any(|group| group.time.as_ref() == Some(name));
        for channel in log.channels.iter().filter(|channel| !is_time(&channel.name)) {
            let list = if own().any(|(_, name)| *name == channel.name) { &mut known } else { &mut unknown };
            list.push(channel.name.clone());
        }
        let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        RecognisedFile {
            file,
            columns: log.channels.len(),
            known: shown(&known, MAX_KINDS),
            unknown: shown(&unknown, MAX_KINDS),
        }
    };
    logs.iter().enumerate().map(of_file).collect()
}
