//! What can go wrong between a log file and a motion: each message names the file, the place and the fix.

use crate::place::LogPlace;
use std::path::PathBuf;

/// A [`LogFormat`](crate::LogFormat) that contradicts itself or the list of joints.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("log format, key `{key}`: {problem}; {fix}")]
pub struct FormatError {
    /// The key, dotted as in the study file: `torque.scale`.
    pub key: String,
    /// What is wrong with it.
    pub problem: String,
    /// What to write instead.
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
    /// The description of the log is wrong.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// The operating system refused the file.
    #[error("{}: cannot be read ({source}); check the path and its permissions", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A file that is not the one that was first read.
    #[error("{}: the file changed while it was read; wait until nothing writes to it, then run the command again", file.display())]
    Changed {
        /// The file.
        file: PathBuf,
    },
    /// No row of numbers in the file.
    #[error("{}; the log needs at least one row of numbers", no_rows(place))]
    NoRows {
        /// Where reading stopped.
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
    /// Lines that end with a carriage return alone.
    #[error("{}:{line}: carriage returns without newlines; convert the line ends, e.g. with tr '\\r' '\\n'", file.display())]
    CarriageReturns {
        /// The file.
        file: PathBuf,
        /// 1-based line.
        line: u64,
    },
    /// A file that cannot be read as what it is.
    #[error(transparent)]
    File(dynident_formats::FileError),
    /// A line beyond the limit.
    #[error("{}:{line}: the line is longer than {limit} bytes; is this a CSV file with one sample per line?", file.display())]
    LineTooLong {
        /// The file.
        file: PathBuf,
        /// 1-based line.
        line: u64,
        /// The limit in bytes.
        limit: usize,
    },
    /// Two columns of one name, one of which is asked for.
    #[error("{place}: column name `{name}` stands at columns {first} and {second}; address it by its 0-based index")]
    DuplicateColumn {
        /// Where the columns are named.
        place: LogPlace,
        /// The name.
        name: String,
        /// 0-based index of its first place.
        first: usize,
        /// 0-based index of its second place.
        second: usize,
    },
    /// A column that the file does not have.
    #[error("{place}: no column `{wanted}` (key `{key}`); {hint}")]
    UnknownColumn {
        /// Where the columns are named, or the first row.
        place: LogPlace,
        /// The key of the format that asks for it.
        key: String,
        /// What was asked for.
        wanted: String,
        /// What exists, and the nearest name.
        hint: String,
    },
    /// A row with too few or too many fields.
    #[error("{place}: {found} fields where {expected} are expected; fix or delete the line{hint}")]
    RaggedRow {
        /// Where.
        place: LogPlace,
        /// Number of fields in the header or the first row.
        expected: usize,
        /// Number of fields in this row.
        found: usize,
        /// A further hint, or nothing.
        hint: &'static str,
    },
    /// A field that is no number.
    #[error("{place}, column {column}: `{text}` is not a number; {fix}")]
    NotANumber {
        /// Where.
        place: LogPlace,
        /// Name or 0-based index of the column.
        column: String,
        /// The field, shortened and escaped.
        text: String,
        /// What to do.
        fix: &'static str,
    },
    /// A field that is empty, NaN or infinite under `missing = "error"`.
    #[error("{place}, column {column}: `{text}` is not a finite number; set missing = \"drop\" to leave such rows out")]
    Missing {
        /// Where.
        place: LogPlace,
        /// Name or 0-based index of the column.
        column: String,
        /// The field.
        text: String,
    },
    /// A channel that is absurdly large once its unit, scale, matrix or offset is applied.
    #[error(
        "{log}, row {row}: {group} of joint `{joint}` is beyond 1e60 or not finite after scaling; \
         check the factors of `{group}` and the raw value"
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
    /// Files of one log that have different numbers of rows.
    #[error("{log} ends after {rows} rows but {other} goes on; files of one log must hold the same samples")]
    UnequalFiles {
        /// The shorter file.
        log: String,
        /// Its data rows.
        rows: u64,
        /// A longer file.
        other: String,
    },
    /// A channel group in another file, of a log that is no file.
    #[error("{log}: `{key}.file` names another file, but the log is none; leave the key out")]
    NoFolder {
        /// Label of the log.
        log: String,
        /// Key of the channel group.
        key: &'static str,
    },
    /// Samples in memory that do not go together.
    #[error("{log}: {problem}; give as many values of every joint as there are samples")]
    Samples {
        /// Label of the log.
        log: String,
        /// What does not go with what.
        problem: String,
    },
    /// The row or time range leaves nothing.
    #[error("{log}: the selection ({selection}) leaves no row after {rows} rows were read; widen it")]
    EmptySelection {
        /// Label of the log.
        log: String,
        /// The keys in force.
        selection: String,
        /// Data rows that were read.
        rows: u64,
    },
    /// Time stamps from which no rate follows.
    #[error(
        "{log}: no sampling rate follows from column {column} ({reason}); \
         check time.column and time.unit, or give rate_hz"
    )]
    NoRate {
        /// Label of the log.
        log: String,
        /// The time column.
        column: String,
        /// Why.
        reason: String,
    },
    /// A setting of a filter that cannot be met.
    #[error(transparent)]
    Filter(#[from] FilterError),
    /// A table of the commanded motion that is none.
    #[error("{}: not a reference motion: {problem}; give a table as design writes it: t_s, q1.., dq1.., ddq1..", file.display())]
    Reference {
        /// The file.
        file: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// No sample at which a differentiator that needs the commanded motion applies.
    #[error(
        "{log}: at none of {samples} samples does {method} apply: the joints do not follow this reference; \
         check its file, start_s and max_lag_s"
    )]
    NotFollowed {
        /// Label of the log.
        log: String,
        /// The differentiator.
        method: &'static str,
        /// Samples looked at.
        samples: u64,
    },
    /// Rows that stand in no order of time.
    #[error(
        "{log}: {backward} of {rows} stamps are earlier than the one before: the rows stand in no order of time; \
         sort them by the time column (`sort` or pandas' `sort_values`), or name another column as time"
    )]
    Unordered {
        /// Label of the log.
        log: String,
        /// Stamps that are earlier than the one before.
        backward: u64,
        /// Rows of the log.
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
        /// Samples needed.
        needed: usize,
        /// The differentiator.
        method: &'static str,
    },
}

fn no_rows(place: &LogPlace) -> String {
    match place {
        LogPlace::Line { log, line } => format!("{log}: no data rows after line {line}"),
        LogPlace::Whole { log } | LogPlace::Row { log, .. } => format!("{log}: no data rows"),
    }
}

/// A filter that cannot be built, or a signal that it cannot be applied to.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FilterError {
    /// A setting outside its range.
    #[error("filter setting `{name}` = {value}: {fix}")]
    Setting {
        /// The setting.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The range.
        fix: &'static str,
    },
    /// A cut-off at or above half the sampling rate.
    #[error("cut-off {cutoff_hz} Hz is not below half the sampling rate of {rate_hz} Hz; lower it")]
    AboveNyquist {
        /// The cut-off.
        cutoff_hz: f64,
        /// The sampling rate.
        rate_hz: f64,
    },
    /// A signal shorter than the filter's padding or window.
    #[error("{found} samples are too few: the {method} filter needs {needed}")]
    TooShort {
        /// The filter.
        method: &'static str,
        /// Samples given.
        found: usize,
        /// Samples needed.
        needed: usize,
    },
    /// A fit whose unknowns the samples do not distinguish.
    #[error("{method}: {samples} samples do not determine the fit: {fix}")]
    Undetermined {
        /// The differentiator.
        method: &'static str,
        /// Samples given.
        samples: usize,
        /// What to do.
        fix: &'static str,
    },
    /// A commanded motion that makes no sense.
    #[error("the reference motion is wrong: {problem}")]
    Reference {
        /// What is wrong, and the fix.
        problem: String,
    },
    /// A caller's own differentiator whose code is not at hand.
    #[error(
        "the differentiator is the function `{name}`, and no file holds code: give it from the program that has it (from Python as motion = {{\"differentiator\": {{\"function\": ..}}}})"
    )]
    NoFunction {
        /// Its name.
        name: String,
    },
    /// A differentiator that needs the commanded motion, without one.
    #[error(
        "{method} needs the motion that was commanded: name its table, reference = \"trajectory.csv\", in the differentiator or in the log"
    )]
    NoReference {
        /// The differentiator.
        method: &'static str,
    },
}

/// That a setting means something.
pub(crate) fn require(holds: bool, name: &'static str, value: f64, fix: &'static str) -> Result<(), FilterError> {
    if holds { Ok(()) } else { Err(FilterError::Setting { name, value, fix }) }
}
