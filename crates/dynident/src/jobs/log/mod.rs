//! What a recording holds.

mod channel;
mod study_format;

use crate::error::Error;
use crate::jobs::columns::{time_unit_s, unit};
use crate::result::{LOG_SCHEMA, LogChannel, LogContents, LogGroupContents};
use channel::Tally;
use dynident_recording::log::{FileLog, LogGroup, LogTable};
use dynident_recording::{LogSource, RecordingError};
use std::path::Path;

/// Reads a recording of any format, every group of columns once, and says what it holds. Memory does not grow with its
/// length.
///
/// # Errors
/// If it cannot be read.
pub fn log_contents(path: &Path) -> Result<LogContents, Error> {
    contents(path).map_err(|source| Error::Recording {
        log: path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned(),
        source: Box::new(source),
    })
}

fn contents(path: &Path) -> Result<LogContents, RecordingError> {
    let log = FileLog::described_by_itself(path);
    let (format, first) = log.open_with_format()?;
    let names = column_names(first.as_ref());
    let (groups, notes) = (first.groups(), first.notes());
    drop(first);
    let mut found = LogContents {
        schema: LOG_SCHEMA.to_owned(),
        file: path.display().to_string(),
        format: format.name().to_owned(),
        bytes: bytes(path)?,
        groups: Vec::new(),
        channels: Vec::new(),
        truncated: None,
        notes,
        study_format: String::new(),
    };
    for (index, group) in groups.iter().enumerate() {
        let names = &names[group.columns.clone()];
        let time = time_column(group, names);
        let mut table = log.open()?;
        let (tallies, rows) = tallies(table.as_mut(), group)?;
        if let Some(place) = table.truncated() {
            found.truncated = Some(place.to_string());
        }
        let seconds = time.and_then(|(column, unit_s)| Some((tallies[column].steps()?, unit_s)));
        let span_s = seconds.map(|(span, unit_s)| span * unit_s);
        let rate_hz = span_s.map(|span_s| (rows.saturating_sub(1)) as f64 / span_s);
        found.channels.extend(tallies.iter().zip(names).map(|(tally, name)| LogChannel {
            name: name.clone(),
            group: index,
            unit: unit(name).map(str::to_owned),
            rate_hz,
            samples: tally.samples,
            missing: rows - tally.samples,
            range: tally.range,
            course: tally.course(),
        }));
        found.groups.push(LogGroupContents {
            name: group.name.clone(),
            rows,
            time: time.map(|(column, _)| names[column].clone()),
            span_s,
            rate_hz,
        });
    }
    found.study_format = study_format::study_format(&found);
    Ok(found)
}

/// What columns are called in a study: their names, or their 0-based indices.
fn column_names(table: &dyn LogTable) -> Vec<String> {
    match table.names() {
        Some(names) => names.to_vec(),
        None => (0..table.width()).map(|column| column.to_string()).collect(),
    }
}

fn bytes(path: &Path) -> Result<u64, RecordingError> {
    let mut bytes = 0;
    for file in dynident_recording::log::files(path)? {
        let size = std::fs::metadata(&file).map_err(|source| RecordingError::Io { file, source })?;
        bytes += size.len();
    }
    Ok(bytes)
}

/// The time column within a group, and its unit in seconds.
fn time_column(group: &LogGroup, names: &[String]) -> Option<(usize, f64)> {
    match group.time {
        Some(column) => Some((column - group.columns.start, 1.0)),
        None => names.iter().enumerate().find_map(|(column, name)| Some((column, time_unit_s(name)?))),
    }
}

/// One pass over a group.
fn tallies(table: &mut dyn LogTable, group: &LogGroup) -> Result<(Vec<Tally>, u64), RecordingError> {
    table.select(&group.columns.clone().collect::<Vec<_>>());
    let mut tallies = vec![Tally::default(); group.columns.len()];
    let (mut row, mut rows) = (vec![0.0; group.columns.len()], 0);
    while table.next_row(&mut row)? {
        rows += 1;
        tallies.iter_mut().zip(&row).for_each(|(tally, value)| tally.add(*value));
    }
    Ok((tallies, rows))
}
