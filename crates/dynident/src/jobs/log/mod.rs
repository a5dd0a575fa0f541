//! `log`: contents of a recording.

mod channel;
mod clock;
mod study_format;

use crate::error::Error;
use crate::jobs::columns::{time_unit_s, unit, with_unit};
use crate::result::{LOG_SCHEMA, LogChannel, LogContents, LogGroupContents};
use channel::ChannelStatistics;
use clock::Clock;
use dynident_recording::RecordingError;
use dynident_recording::log::{FileLog, LogGroup, LogTable};
use std::path::Path;

/// Units of time stamps, s. If the name contains no unit, the first plausible one is used. Excel and MATLAB count
/// days.
const TIME_UNITS: [(&str, f64); 5] = [("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9), ("d", 86_400.0)];
/// Plausible sampling rates of robot logs, Hz: slower logs contain no acceleration, and faster logs do not exist.
const MIN_RATE_HZ: f64 = 2.0;
const MAX_RATE_HZ: f64 = 2e4;
/// Minimum number of rows from which a unit (by the rate) or the clock (by the values) is recognised: a list of
/// events has no rate.
const MIN_ROWS_OF_CLOCK: u64 = 50;

/// Reads a recording of any format once and summarises its contents, with constant memory.
///
/// # Errors
/// If it cannot be read.
pub fn log_contents(path: &Path) -> Result<LogContents, Error> {
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    contents(path).map_err(|source| Error::recording(&name, source))
}

fn contents(path: &Path) -> Result<LogContents, RecordingError> {
    let log = FileLog::described_by_itself(path);
    let (format, mut table) = log.open_with_format()?;
    let names = column_names(table.as_ref());
    // Names with the units that the file contains separately.
    let described: Vec<_> =
        names.iter().enumerate().map(|(column, name)| with_unit(name, table.unit(column)).into_owned()).collect();
    let groups = table.groups();
    let named_times: Vec<_> =
        groups.iter().map(|group| time_column(group, &described[group.columns.clone()])).collect();
    let mut read: Vec<GroupStatistics> = groups.iter().map(|group| GroupStatistics::new(group.columns.len())).collect();
    table.all_rows(&mut |group, row| read[group].add(row, named_times[group].map(|(column, _)| column)))?;
    let mut found = LogContents {
        schema: LOG_SCHEMA.to_owned(),
        file: path.display().to_string(),
        format: format.name().to_owned(),
        bytes: bytes(path)?,
        groups: Vec::new(),
        channels: Vec::new(),
        truncated: table.truncated().map(|place| place.to_string()),
        notes: table.notes(),
        study_format: String::new(),
    };
    for (index, (group, statistics)) in groups.iter().zip(read).enumerate() {
        let columns = group.columns.clone();
        let names = &names[columns.clone()];
        let time = named_times[index].or_else(|| Some((statistics.time_by_values()?, 1.0)));
        let clock = time.map_or_else(Clock::default, |(column, _)| statistics.clocks[column]);
        let GroupStatistics { rows, channels, .. } = statistics;
        let is_stated =
            |column: usize| group.time.is_some() || unit(&described[group.columns.start + column]).is_some();
        let seconds = time.and_then(|(column, unit_s)| {
            let span = channels[column].increase()?;
            let of_rate = || clock.rate(rows, span).filter(|_| rows >= MIN_ROWS_OF_CLOCK).and_then(unit_of_rate);
            Some((span, if is_stated(column) { unit_s } else { of_rate().unwrap_or(unit_s) }))
        });
        let span_s = seconds.map(|(span, unit_s)| span * unit_s);
        let rate_hz = seconds.and_then(|(span, unit_s)| Some(clock.rate(rows, span)? / unit_s));
        let time_unit = |column: usize| {
            let (time, (_, unit_s)) = (time?.0 + group.columns.start, seconds?);
            (column == time).then(|| TIME_UNITS.iter().find(|(_, s)| *s == unit_s).map(|(name, _)| *name))?
        };
        let numbers = channels.iter().zip(names).zip(columns).filter(|(_, column)| !table.is_text(*column));
        found.channels.extend(numbers.map(|((tally, name), column)| LogChannel {
            name: name.clone(),
            group: index,
            unit: unit(&described[column]).or_else(|| time_unit(column)).map(str::to_owned),
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

/// The time unit, s, in which a clock with `rate` rows per unit gives a plausible rate for a robot.
fn unit_of_rate(rate: f64) -> Option<f64> {
    let is_of_robot = |unit_s: f64| (MIN_RATE_HZ..=MAX_RATE_HZ).contains(&(rate / unit_s));
    TIME_UNITS.iter().map(|(_, unit_s)| *unit_s).find(|unit_s| is_of_robot(*unit_s))
}

/// Names of the columns for a study: their names, or their 0-based indices.
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

/// The time column of a group, and its unit in seconds.
fn time_column(group: &LogGroup, names: &[String]) -> Option<(usize, f64)> {
    match group.time {
        Some(column) => Some((column - group.columns.start, 1.0)),
        None => names.iter().enumerate().find_map(|(column, name)| Some((column, time_unit_s(name)?))),
    }
}

struct GroupStatistics {
    rows: u64,
    channels: Vec<ChannelStatistics>,
    /// One clock for each column. If the name of the time column is known, only its clock is used.
    clocks: Vec<Clock>,
}

impl GroupStatistics {
    fn new(columns: usize) -> Self {
        Self { rows: 0, channels: vec![ChannelStatistics::default(); columns], clocks: vec![Clock::default(); columns] }
    }

    /// The column that increases most evenly, like a clock.
    fn time_by_values(&self) -> Option<usize> {
        if self.rows < MIN_ROWS_OF_CLOCK {
            return None;
        }
        let deviations = self.clocks.iter().enumerate().filter_map(|(column, clock)| {
            let rate = clock.rate(self.rows, self.channels[column].increase()?)?;
            unit_of_rate(rate)?;
            Some((column, clock.step_deviation()?))
        });
        deviations.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(column, _)| column)
    }

    /// Adds a row; column `time` contains the time. If `time` is `None`, every column can be the time.
    fn add(&mut self, row: &[f64], time: Option<usize>) {
        self.rows += 1;
        self.channels.iter_mut().zip(row).for_each(|(tally, value)| tally.add(*value));
        match time {
            Some(column) => self.clocks[column].add(row[column]),
            None => self.clocks.iter_mut().zip(row).for_each(|(clock, value)| clock.add(*value)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_of_a_clock_follows_from_its_rate() {
        for (step, expected) in [
            (0.004, Some(1.0)),
            (4.0, Some(1e-3)),
            (20_080.0, Some(1e-6)),
            (1e6, Some(1e-9)),
            (1e-7, Some(86_400.0)),
            (1e-10, None),
        ] {
            assert_eq!(unit_of_rate(1.0 / step), expected, "{step}");
        }
    }
}
