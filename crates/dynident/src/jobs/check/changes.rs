//! Changes of study keys that correct a mistake.

use crate::result::StudyChange;
use crate::study::{Study, StudyRobot};
use dynident_identification::Role;
use dynident_identification::diagnosis::{Mistake, StudyKeys};
use dynident_recording::LogFormat;

/// Keys for the first training log; `None` for a study without training logs.
pub(super) fn keys_of_study(study: &Study, robot: &StudyRobot) -> Option<StudyKeys> {
    let index = *study.logs_of_role(Role::Identify).first()?;
    let keys = keys_of_log(study, robot, index);
    let is_common = study.log[index].format.is_none();
    Some(if is_common { StudyKeys { table: "format".to_owned(), ..keys } } else { keys })
}

/// Keys for log number `index` only; the other logs keep theirs.
pub(super) fn keys_of_log(study: &Study, robot: &StudyRobot, index: usize) -> StudyKeys {
    let place = |joint: usize| {
        let name = &robot.model().joints()[joint].name;
        robot.log_joints.iter().position(|log_joint| log_joint == name).unwrap_or(joint)
    };
    StudyKeys {
        format: study.format_of(index),
        table: format!("[[log]] {}: format", index + 1),
        places: (0..robot.model().dof()).map(place).collect(),
        columns: robot.log_joints.len(),
        torque_lag_s: study.motion.torque_lag_s.clone(),
        has_base_rotation: study.robot.base_rpy_rad.is_some() || study.robot.base_rpy_deg.is_some(),
    }
}

/// Key changes that correct a mistake; empty without keys.
pub(super) fn changes(mistake: &Mistake, keys: Option<&StudyKeys>) -> Vec<StudyChange> {
    let changes = keys.map_or_else(Vec::new, |keys| mistake.changes(keys));
    changes.into_iter().map(StudyChange::from).collect()
}

/// Key changes that correct a mistake of log number `index` only. A log that uses the common format gets its own
/// complete format.
pub(super) fn changes_of_log(mistake: &Mistake, study: &Study, keys: &StudyKeys, index: usize) -> Vec<StudyChange> {
    let found = changes(mistake, Some(keys));
    let corrected = found.iter().fold(keys.clone(), with_change).format;
    let is_of_format = found.iter().all(|change| change.table.starts_with(&keys.table)) && corrected != keys.format;
    match stated_keys(&corrected) {
        Some(format) if is_of_format && study.log[index].format.is_none() => {
            vec![StudyChange { table: format!("[[log]] {}", index + 1), line: format!("format = {format}") }]
        }
        _ => found,
    }
}

/// The format as TOML without the keys that have their default values.
fn stated_keys(format: &LogFormat) -> Option<toml::Value> {
    let usual: LogFormat = toml::from_str("position = { columns = \"q\" }").ok()?;
    let usual = toml::Table::try_from(&usual).ok()?;
    let mut stated = toml::Table::try_from(format).ok()?;
    stated.retain(|key, value| usual.get(key) != Some(value));
    Some(toml::Value::Table(stated))
}

/// Key changes that correct mistakes one after the other, and the keys before the last mistake. A later line for the
/// same key contains the earlier correction, and a comment says so.
pub(super) fn successive_changes(
    mistakes: &[Mistake],
    keys: Option<&StudyKeys>,
) -> (Vec<Vec<StudyChange>>, Option<StudyKeys>) {
    let mut all: Vec<Vec<StudyChange>> = Vec::new();
    let (mut now, mut before) = (keys.cloned(), keys.cloned());
    for mistake in mistakes {
        let mut found = changes(mistake, now.as_ref());
        before.clone_from(&now);
        now = now.map(|keys| found.iter().fold(keys, with_change));
        for change in &mut found {
            if all.iter().flatten().any(|earlier| key_of(earlier) == key_of(change)) {
                change.line += "   # in place of the line above, which it contains";
            }
        }
        all.push(found);
    }
    (all, before)
}

fn key_of(change: &StudyChange) -> (&str, &str) {
    (&change.table, change.line.split('=').next().unwrap_or_default().trim())
}

/// The keys after a change of the log format; unchanged for other keys, and for a change that only a person can make.
fn with_change(keys: StudyKeys, change: &StudyChange) -> StudyKeys {
    let format = || -> Option<LogFormat> {
        let path = change.table.strip_prefix(&keys.table)?;
        let mut format = toml::Table::try_from(&keys.format).ok()?;
        let table = match path.strip_prefix('.') {
            Some(group) => format.get_mut(group)?.as_table_mut()?,
            None => &mut format,
        };
        table.extend(change.line.parse::<toml::Table>().ok()?);
        format.try_into().ok()
    };
    match format() {
        Some(format) => StudyKeys { format, ..keys },
        None => keys,
    }
}
