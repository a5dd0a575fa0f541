//! Errors between a log file and a motion. Each message names the file, the place and the fix.

use crate::place::LogPlace;
use std::path::PathBuf;

/// A [`LogFormat`](crate::LogFormat) that is inconsistent or does not match the joints.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("log format, key `{key}`: {problem}; {fix}")]
pub struct FormatError {
    /// The key, dotted as in the study file: `torque.scale`.
    pub key: String,
    /// The problem.
    pub problem: String,
    /// The fix.
    pub fix: String,
}

impl FormatError {
    pub(crate) fn new(key: impl Into<String>, problem: impl Into<String>, fix: impl Into<String>) -> Self {
        Self { key: key.into(), problem: problem.into(), fix: fix.into() }
    }
}

/// A log that cannot be read or turned into a motion.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// The log format is invalid.
    #[error("{0}")]
    Format(#[from] FormatError),
    /// The operating system could not read the file.
    #[error("{}: cannot be read ({source}); check the path and its permissions", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The file changed between two passes.
    #[error("{}: the file changed while it was read; wait until nothing writes to it, then run the command again", file.display())]
    Changed {
        /// The file.
        file: PathBuf,
    },
    /// The file contains no row of numbers.
    #[error("{}; the log needs at least one row of numbers", no_rows(place))]
    NoRows {
        /// Place where reading stopped.
        place: LogPlace,
    },
    /// The file is not text.
    #[error("{}:{line}: a NUL byte: this is not a text table; export the log as CSV", file.display())]
    Binary {
        /// The file.
        file: PathBuf,
        /// 1-based line.
        line: u64,
    },
    /// Lines end with a carriage return only.
    #[error("{}:{line}: carriage returns without newlines; convert the line ends, e.g. with tr '\\r' '\\n'", file.display())]
    CarriageReturns {
        /// The file.
        file: PathBuf,
        /// 1-based line.
        line: u64,
    },
    /// The file cannot be read in its format.
    #[error("{0}")]
    File(#[source] dynident_formats::FileError),
    /// A line is longer than the limit.
    #[error("{}:{line}: the line is longer than {limit} bytes; is this a CSV file with one sample per line?", file.display())]
    LineTooLong {
        /// The file.
        file: PathBuf,
        /// 1-based line.
        line: u64,
        /// The limit in bytes.
        limit: usize,
    },
    /// Two columns have the requested name.
    #[error(
        "{place}: duplicate column name `{name}` (columns {first} and {second}); give its 0-based index instead of the name"
    )]
    DuplicateColumn {
        /// Place of the column names.
        place: LogPlace,
        /// The name.
        name: String,
        /// 0-based index of the first column.
        first: usize,
        /// 0-based index of the second column.
        second: usize,
    },
    /// A requested column does not exist.
    #[error("{place}: no column `{wanted}` (key `{key}`); {hint}")]
    UnknownColumn {
        /// Place of the column names, or the first row.
        place: LogPlace,
        /// The key of the format that requests it.
        key: String,
        /// The requested column.
        wanted: String,
        /// Existing columns, and the closest name.
        hint: String,
    },
    /// A row has too few or too many fields.
    #[error("{place}: {found} fields where {expected} are expected; fix or delete the line{hint}")]
    RaggedRow {
        /// The place.
        place: LogPlace,
        /// Number of fields in the header or the first row.
        expected: usize,
        /// Number of fields in this row.
        found: usize,
        /// A further hint; may be empty.
        hint: &'static str,
    },
    /// A field is not a number.
    #[error("{place}, column {column}: `{text}` is not a number; {fix}")]
    NotANumber {
        /// The place.
        place: LogPlace,
        /// Name or 0-based index of the column.
        column: String,
        /// The field, shortened and escaped.
        text: String,
        /// The fix.
        fix: &'static str,
    },
    /// A field is empty, NaN or infinite under `missing = "error"`.
    #[error(
        "{place}, column {column}: `{text}` is not a finite number; set missing = \"drop\" in [format] to leave such rows out"
    )]
    Missing {
        /// The place.
        place: LogPlace,
        /// Name or 0-based index of the column.
        column: String,
        /// The field.
        text: String,
    },
    /// A channel exceeds 1e60 or is not finite after unit, scale, matrix and offset.
    #[error(
        "{log}, row {row}: {group} of joint `{joint}` is beyond 1e60 or not finite after scaling; \
         check unit, scale and offset of `{group}` in [format], and the raw value"
    )]
    Overflow {
        /// Label of the log.
        log: String,
        /// 0-based data row.
        row: u64,
        /// Key of the channel group.
        group: &'static str,
        /// The joint.
        joint: String,
    },
    /// Files of one log have different numbers of rows.
    #[error("{log} ends after {rows} rows, before {other}; files of one log must contain the same samples")]
    UnequalFiles {
        /// The shorter file.
        log: String,
        /// Its data rows.
        rows: u64,
        /// A longer file.
        other: String,
    },
    /// Files of one log have different times in the same row.
    #[error(
        "{other}: in data row {row}, `{column}` is {difference_s:.3} s from that of {log}: the files are of different \
         recordings, or rows are missing in one of them; use files of one recording, or raise time.max_difference_s if \
         their clocks differ"
    )]
    ForeignFile {
        /// File with the time column.
        log: String,
        /// The other file.
        other: String,
        /// The time column.
        column: String,
        /// 0-based data row.
        row: u64,
        /// Difference, s.
        difference_s: f64,
    },
    /// A channel group names a file although the log is not a file.
    #[error("{log}: `{key}.file` is not available for a log in memory; remove the key")]
    NoFolder {
        /// Label of the log.
        log: String,
        /// Key of the channel group.
        key: &'static str,
    },
    /// Samples in memory have inconsistent lengths.
    #[error("{log}: {problem}; give one value per joint and sample")]
    Samples {
        /// Label of the log.
        log: String,
        /// The inconsistency.
        problem: String,
    },
    /// The row or time range contains no row.
    #[error(
        "{log}: the selection ({selection}) leaves no row after {rows} rows were read; select a larger part of the log"
    )]
    EmptySelection {
        /// Label of the log.
        log: String,
        /// The active keys.
        selection: String,
        /// Number of data rows that were read.
        rows: u64,
    },
    /// The time stamps do not determine a rate.
    #[error(
        "{log}: column {column} does not determine a sampling rate ({reason}); \
         check time.column and time.unit, or give rate_hz"
    )]
    NoRate {
        /// Label of the log.
        log: String,
        /// The time column.
        column: String,
        /// The reason.
        reason: String,
    },
    /// A filter setting is invalid.
    #[error("{0}")]
    Filter(#[from] FilterError),
    /// A table of the commanded motion is invalid.
    #[error("{}: not a reference motion: {problem}; give a table as written by design: t_s, q1.., dq1.., ddq1..", file.display())]
    Reference {
        /// The file.
        file: PathBuf,
        /// The problem.
        problem: String,
    },
    /// A differentiator that needs the commanded motion applies to no sample.
    #[error(
        "{log}: {method} applies to none of the {samples} samples: the joints do not follow this reference; \
         check its file, start_s and max_lag_s"
    )]
    NotFollowed {
        /// Label of the log.
        log: String,
        /// The differentiator.
        method: &'static str,
        /// Number of samples.
        samples: u64,
    },
    /// The rows are not ordered by time.
    #[error(
        "{log}: {backward} of {rows} stamps are earlier than the previous one: the rows are in no order of time; \
         sort them by the time column (`sort` or pandas' `sort_values`), or name another column as time"
    )]
    Unordered {
        /// Label of the log.
        log: String,
        /// Number of stamps that are earlier than the previous one.
        backward: u64,
        /// Number of rows of the log.
        rows: u64,
    },
    /// No segment of the log is long enough for the filter.
    #[error(
        "{log}: the longest uninterrupted piece has {found} samples, the {method} filter needs {needed}; \
         widen the range or choose a shorter filter"
    )]
    TooShort {
        /// Label of the log.
        log: String,
        /// Samples in the longest segment.
        found: usize,
        /// Minimum number of samples.
        needed: usize,
        /// The differentiator.
        method: &'static str,
    },
}

impl RecordingError {
    /// The file and the 1-based line of the error, as far as they are known. Samples in memory have no file.
    pub fn place(&self) -> (Option<PathBuf>, Option<u64>) {
        let of_place = |place: &LogPlace| match place {
            LogPlace::Line { log, line } => (Some(PathBuf::from(log)), Some(*line)),
            LogPlace::Row { log, .. } | LogPlace::Whole { log } => (of_label(log), None),
        };
        match self {
            Self::Io { file, .. } | Self::Changed { file } | Self::Reference { file, .. } => (Some(file.clone()), None),
            Self::Binary { file, line }
            | Self::CarriageReturns { file, line }
            | Self::LineTooLong { file, line, .. } => (Some(file.clone()), Some(*line)),
            Self::File(error) => (Some(error.file().to_owned()), None),
            Self::NoRows { place }
            | Self::DuplicateColumn { place, .. }
            | Self::UnknownColumn { place, .. }
            | Self::RaggedRow { place, .. }
            | Self::NotANumber { place, .. }
            | Self::Missing { place, .. } => of_place(place),
            Self::Overflow { log, .. }
            | Self::UnequalFiles { log, .. }
            | Self::ForeignFile { log, .. }
            | Self::NoFolder { log, .. }
            | Self::Samples { log, .. }
            | Self::EmptySelection { log, .. }
            | Self::NoRate { log, .. }
            | Self::NotFollowed { log, .. }
            | Self::Unordered { log, .. }
            | Self::TooShort { log, .. } => (of_label(log), None),
            Self::Format(_) | Self::Filter(_) => (None, None),
        }
    }
}

/// The file of a log; `None` if its label is a name of samples in memory.
fn of_label(label: &str) -> Option<PathBuf> {
    Some(PathBuf::from(label)).filter(|path| path.exists())
}

fn no_rows(place: &LogPlace) -> String {
    match place {
        LogPlace::Line { log, line } => format!("{log}: no data rows after line {line}"),
        LogPlace::Whole { log } | LogPlace::Row { log, .. } => format!("{log}: no data rows"),
    }
}

/// A filter that cannot be built or applied.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FilterError {
    /// A setting is outside its range.
    #[error("filter setting `{name}` = {value}: {fix}")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The allowed range.
        fix: &'static str,
    },
    /// The cut-off is not below half the sampling rate.
    #[error("cut-off {cutoff_hz} Hz is not below half the sampling rate of {rate_hz} Hz; lower the cut-off")]
    AboveNyquist {
        /// The cut-off.
        cutoff_hz: f64,
        /// The sampling rate.
        rate_hz: f64,
    },
    /// The signal is shorter than the filter's padding or window.
    #[error("{found} samples are too few: the {method} filter needs {needed}")]
    TooShort {
        /// The filter.
        method: &'static str,
        /// Number of samples given.
        found: usize,
        /// Minimum number of samples.
        needed: usize,
    },
    /// The samples do not determine the unknowns of a fit.
    #[error("{method}: {samples} samples do not determine the fit: {fix}")]
    Undetermined {
        /// The differentiator.
        method: &'static str,
        /// Number of samples given.
        samples: usize,
        /// The fix.
        fix: &'static str,
    },
    /// The commanded motion is invalid.
    #[error("the reference motion is wrong: {problem}")]
    Reference {
        /// The problem and the fix.
        problem: String,
    },
    /// The code of a caller's differentiator is not available.
    #[error(
        "the code of the differentiator function `{name}` is not available: pass it from a program (from Python as motion = {{\"differentiator\": {{\"function\": ..}}}})"
    )]
    NoFunction {
        /// Its name.
        name: String,
    },
    /// A differentiator needs the commanded motion.
    #[error(
        "{method} needs the commanded motion: name its table, reference = \"trajectory.csv\", in the differentiator or in the log"
    )]
    NoReference {
        /// The differentiator.
        method: &'static str,
    },
}

/// Returns [`FilterError::Setting`] unless `holds`.
pub(crate) fn require(holds: bool, name: &'static str, value: f64, fix: &'static str) -> Result<(), FilterError> {
    if holds { Ok(()) } else { Err(FilterError::Setting { name, value, fix }) }
}
