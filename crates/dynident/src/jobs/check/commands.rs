//! Findings about logs with commanded positions, and the keys that correct them.

use crate::result::{CheckFinding, StudyChange};
use crate::study::{Study, StudyFileError, StudyLogSource, StudyRobot};
use dynident_recording::command_check::UnitOf;
use dynident_recording::log::{ChannelGroup, ColumnRef, Columns, OneOrMany};
use dynident_recording::{CommandCheckSettings, CommandFinding, LogFormat, RecordingError, check_commands};
use dynident_text::quoted;

/// Maximum number of decimals of an offset in a study, rad or m.
const OFFSET_DECIMALS: usize = 4;

/// Whether a training log has commands and no torque, so that nothing can be identified from torques.
pub(super) fn is_without_torque(study: &Study) -> bool {
    let training = study.logs_of_role(dynident_identification::Role::Identify);
    training.into_iter().any(|index| study.format_of(index).torque.is_none())
}

/// Findings about the commands of all logs that have commands. A finding of several logs appears once.
///
/// # Errors
/// If a log cannot be read.
pub(super) fn command_findings(
    study: &Study,
    robot: &StudyRobot,
    sources: &[StudyLogSource],
    settings: &CommandCheckSettings,
) -> Result<Vec<CheckFinding>, StudyFileError> {
    let names = &robot.log_joints;
    let limits: Vec<Option<[f64; 2]>> = names
        .iter()
        .map(|name| {
            let joint = robot.model().joints().iter().find(|joint| joint.name == *name)?;
            Some([joint.limits.lower?, joint.limits.upper?])
        })
        .collect();
    let mut found: Vec<(CheckFinding, Vec<String>)> = Vec::new();
    for (index, source) in sources.iter().enumerate() {
        let format = study.format_of(index);
        if format.command.is_none() {
            continue;
        }
        let log_name = study.log_name(index);
        let failed = |source: RecordingError| StudyFileError::recording(&log_name, source);
        let motion = source.log(format.clone(), names).commanded_motion().map_err(failed)?;
        let is_common = study.log[index].format.is_none();
        let table = if is_common { "format".to_owned() } else { format!("[[log]] {}: format", index + 1) };
        for finding in check_commands(&motion, &limits, settings) {
            let kind = kind(&finding);
            let own = CheckFinding {
                level: finding.level(),
                kind: kind.to_owned(),
                what: finding.what(names),
                evidence: finding.evidence(names),
                write: changes(&finding, &format, &table, names.len()),
                or: alternative(&finding, &format, &table, names.len()).into_iter().collect(),
                code: format!("check-{kind}"),
            };
            match found.iter_mut().find(|(known, _)| known.what == own.what) {
                Some((_, logs)) => logs.push(log_name.clone()),
                None => found.push((own, vec![log_name.clone()])),
            }
        }
    }
    let with_logs = |(finding, logs): (CheckFinding, Vec<String>)| {
        let place = match &logs[..] {
            [only] => format!("log `{only}`"),
            _ => format!("{} logs, first in `{}`", logs.len(), logs[0]),
        };
        CheckFinding { what: format!("{} in {place}", finding.what), ..finding }
    };
    Ok(found.into_iter().map(with_logs).collect())
}

/// Code of a finding; the same code as for logs with torque where there is one.
fn kind(finding: &CommandFinding) -> &'static str {
    match finding {
        CommandFinding::Sign { .. } => "sign",
        CommandFinding::Offset { .. } => "offset",
        CommandFinding::Degrees { .. } => "unit",
        _ => "command",
    }
}

/// Another correction: commands and positions only show that one of both is wrong.
fn alternative(finding: &CommandFinding, format: &LogFormat, table: &str, joints: usize) -> Option<String> {
    let position = &format.position;
    let line = match finding {
        CommandFinding::Sign { joint, .. } => {
            let own = |place: usize| at(position.sign.as_ref(), place, 1.0);
            let value = |place: usize| own(place) * if place == *joint { -1.0 } else { 1.0 };
            format!("sign = {}", list((0..joints).map(|place| value(place).to_string())))
        }
        CommandFinding::Offset { joint, offset } => {
            let own = |place: usize| at(position.offset.as_ref(), place, 0.0);
            let value = |place: usize| own(place) - if place == *joint { *offset } else { 0.0 };
            format!("offset = {}", list((0..joints).map(|place| format!("{:.4}", value(place)))))
        }
        CommandFinding::Exchanged { lag_s, .. } => {
            return Some(format!(
                "the columns are right and the recorder stamps the commands late ([{table}] {})",
                late(format, *lag_s)
            ));
        }
        _ => return None,
    };
    Some(format!(
        "the position is wrong, not the command ([{table}.position] {line}): compare both with the limits of the joint in the robot description"
    ))
}

/// The keys that correct a mistake in a log format of `joints` joints; empty if no key does.
fn changes(finding: &CommandFinding, format: &LogFormat, table: &str, joints: usize) -> Vec<StudyChange> {
    let Some(command) = &format.command else { return Vec::new() };
    let change = |group: &str, line: String| StudyChange { table: format!("{table}.{group}"), line };
    // A matrix couples the columns, so no value of a single column corrects a joint.
    let has_matrix = command.matrix.is_some() || command.inverse_matrix.is_some();
    match finding {
        CommandFinding::Sign { joint, .. } if !has_matrix => {
            let value = |place: usize| at(command.sign.as_ref(), place, 1.0) * if place == *joint { -1.0 } else { 1.0 };
            vec![change("command", format!("sign = {}", list((0..joints).map(|place| value(place).to_string()))))]
        }
        CommandFinding::Offset { joint, offset } => {
            let value = |place: usize| {
                let own = at(command.offset.as_ref(), place, 0.0);
                let factor = 10.0_f64.powi(OFFSET_DECIMALS as i32);
                if place == *joint { ((own + offset) * factor).round() / factor } else { own }
            };
            let values = (0..joints).map(|place| format!("{:?}", value(place)));
            vec![change("command", format!("offset = {}", list(values)))]
        }
        CommandFinding::Degrees { of, joints: those, .. } if !has_matrix => {
            let groups: &[(&str, &ChannelGroup)] = match of {
                UnitOf::Commands => &[("command", command)],
                UnitOf::Positions => &[("position", &format.position)],
                _ => &[("position", &format.position), ("command", command)],
            };
            let unit = |group: &ChannelGroup| {
                if those.len() == joints {
                    return "unit = \"deg\"".to_owned();
                }
                let own = |place: usize| group.unit.as_ref().and_then(|unit| unit.at(place));
                let value = |place: usize| {
                    let own = own(place).unwrap_or_else(|| "rad".to_owned());
                    quoted(if those.contains(&place) { "deg" } else { &own })
                };
                format!("unit = {}", list((0..joints).map(value)))
            };
            groups.iter().map(|(name, group)| change(name, unit(group))).collect()
        }
        CommandFinding::Late { lag_s, .. } => {
            vec![StudyChange { table: table.to_owned(), line: late(format, *lag_s) }]
        }
        // Columns in two files are exchanged by hand.
        CommandFinding::Exchanged { .. } if format.position.file.is_none() && command.file.is_none() => {
            vec![change("position", columns(command)), change("command", columns(&format.position))]
        }
        _ => Vec::new(),
    }
}

/// The key for commands that are stamped later by `more_s` than the format states.
fn late(format: &LogFormat, more_s: f64) -> String {
    format!("command_late_s = {:.3}", format.command_late_s.unwrap_or(0.0) + more_s)
}

fn columns(group: &ChannelGroup) -> String {
    let text = match &group.columns {
        Columns::Pattern(pattern) => quoted(pattern),
        Columns::List(columns) => list(columns.iter().map(|column| match column {
            ColumnRef::Index(index) => index.to_string(),
            ColumnRef::Name(name) => quoted(name),
        })),
    };
    format!("columns = {text}")
}

fn at(values: Option<&OneOrMany<f64>>, place: usize, default: f64) -> f64 {
    values.and_then(|values| values.at(place)).unwrap_or(default)
}

fn list(values: impl Iterator<Item = String>) -> String {
    format!("[{}]", values.collect::<Vec<_>>().join(", "))
}
