//! Errors in reading a log and converting it to a motion. Each message contains the file, the place and the fix.

use crate::place::LogPlace;
use std::path::PathBuf;

/// A key under `[format]` contradicts another key or does not match the joints or columns of the log. The message names
/// the key and the correction.
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

/// Reason why a log cannot be read or converted to a motion.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// The log format is invalid.
    #[error("{0}")]
    Format(#[from] FormatError),
    /// The log file does not exist, or you have no permission to read it. Correct `file` of the `[[log]]` or the
    /// permissions.
    #[error("{}: cannot be read ({source}); check the path and its permissions", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// Dynident reads a log several times, and the file changed in between. Usually the recorder still writes. Wait
    /// until the recording is complete.
    #[error("{}: the file changed while it was read; wait until nothing writes to it, then run the command again", file.display())]
    Changed {
        /// The file.
        file: PathBuf,
    },
    /// The file has only a header or comments, or it ends before the first row of numbers. Give a complete recording,
    /// and check the key `header` under `[format]`.
    #[error("{}; the log needs at least one row of numbers", no_rows(place))]
    NoRows {
        /// Place where reading stopped.
        place: LogPlace,
    },
    /// The file is binary, for example an HDF5 or MATLAB file with the ending `.csv`, or it was damaged. Export the log
    /// as CSV text.
    #[error("{}:{line}: a NUL byte: this is not a text table; export the log as CSV", file.display())]
    Binary {
        /// The file.
        file: PathBuf,
        /// 1-based line.
        line: u64,
    },
    /// The program that wrote the file ends lines with a carriage return only, as old Macintosh programs do. Convert
    /// the line ends.
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
    /// The file has no line ends where Dynident expects them, so it is probably not a table with one sample per line.
    /// Export one row for each sample.
    #[error("{}:{line}: the line is longer than {limit} bytes; is this a CSV file with one sample per line?", file.display())]
    LineTooLong {
        /// The file.
        file: PathBuf,
        /// 1-based line.
        line: u64,
        /// The limit in bytes.
        limit: usize,
    },
    /// Two columns of the header have the same name, so that the name in `[format]` is ambiguous. Write the number of
    /// the column, counted from 0.
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
    /// The key under `[format]` names a column that the log does not have. Use a name of the header, or a number
    /// counted from 0; `dynident log FILE` lists the columns.
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
    /// The line has fewer or more fields than the header, because the file was damaged, or because another separator
    /// appears in a field. Correct or delete the line.
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
    /// A column that the study uses contains text, or numbers with a decimal comma. Correct the field, or select
    /// another column.
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
    /// The field is empty, NaN or infinite, and `missing = "error"`. Write `missing = "drop"` under `[format]` to leave
    /// out these rows.
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
    /// The value of this channel is beyond 1e60 or not finite after unit, scale, matrix and offset. The `scale` or
    /// `unit` is wrong, or the raw value is. Correct it.
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
    /// The channel groups of the log come from several files, and one file has fewer rows. Export all files from the
    /// same recording.
    #[error("{log} ends after {rows} rows, before {other}; files of one log must contain the same samples")]
    UnequalFiles {
        /// The shorter file.
        log: String,
        /// Its data rows.
        rows: u64,
        /// A longer file.
        other: String,
    },
    /// Two files of one log have different times in the same row. They are of different recordings, or rows are missing
    /// in one. Export them again, or raise `time.max_difference_s` if only the clocks differ.
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
    /// `file` under `[format.position]` or another group names a second file, but the samples were passed from memory.
    /// Remove the key and pass the channel with the other samples.
    #[error("{log}: `{key}.file` is not available for a log in memory; remove the key")]
    NoFolder {
        /// Label of the log.
        log: String,
        /// Key of the channel group.
        key: &'static str,
    },
    /// The arrays that a program passed to Dynident have different lengths. Pass one value for each joint and each
    /// sample.
    #[error("{log}: {problem}; give one value per joint and sample")]
    Samples {
        /// Label of the log.
        log: String,
        /// The inconsistency.
        problem: String,
    },
    /// The keys `rows`, `fraction` or `time_range_s` of the `[[log]]`, or the rules that drop rows, exclude all rows.
    /// Select a larger part of the log.
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
    /// The time stamps are too irregular, too few or equal, or their unit is wrong. Correct `time.column` or
    /// `time.unit` under `[format]`, or write the sampling rate as `rate_hz`.
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
    /// The file that `reference` names is not a table of the commanded motion, for example a column is missing. Use the
    /// table that `dynident design` wrote.
    #[error("{}: not a reference motion: {problem}; give a table as written by design: t_s, q1.., dq1.., ddq1..", file.display())]
    Reference {
        /// The file.
        file: PathBuf,
        /// The problem.
        problem: String,
    },
    /// The differentiator uses the commanded motion, but the measured motion differs from it everywhere. The file is of
    /// another motion, or `start_s` or `max_lag_s` is wrong.
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
    /// The rows are sorted by another column, or several recordings were joined. Sort the rows by time, or name another
    /// column as `time.column`.
    #[error(
        "{log}: {backward} of {rows} stamps are earlier than the previous one: the rows are not in order of time; \
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
    /// The filter or differentiator needs more consecutive samples than the longest part without gaps has. Select more
    /// rows, record without gaps, or choose a shorter filter.
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
    /// File and line number (from 1) of the error, if they are known. Samples in memory have no file.
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

/// File of a log; `None` if its label is a name for samples in memory.
fn of_label(label: &str) -> Option<PathBuf> {
    Some(PathBuf::from(label)).filter(|path| path.exists())
}

fn no_rows(place: &LogPlace) -> String {
    match place {
        LogPlace::Line { log, line } => format!("{log}: no data rows after line {line}"),
        LogPlace::Whole { log } | LogPlace::Row { log, .. } => format!("{log}: no data rows"),
    }
}

/// Reason why a filter or differentiator cannot be created or applied.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FilterError {
    /// A setting of the filter or differentiator is outside its range. Write a value within the range that the message
    /// names.
    #[error("filter setting `{name}` = {value}: {fix}")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The allowed range.
        fix: &'static str,
    },
    /// A cut-off must be below half the sampling rate of the log. Lower `cutoff_hz`, or record at a higher rate.
    #[error("cut-off {cutoff_hz} Hz is not below half the sampling rate of {rate_hz} Hz; lower the cut-off")]
    AboveNyquist {
        /// The cut-off.
        cutoff_hz: f64,
        /// The sampling rate.
        rate_hz: f64,
    },
    /// The piece of the log is shorter than the window of this filter. Select more rows, or choose a filter with a
    /// shorter window.
    #[error("{found} samples are too few: the {method} filter needs {needed}")]
    TooShort {
        /// The filter.
        method: &'static str,
        /// Number of samples given.
        found: usize,
        /// Minimum number of samples.
        needed: usize,
    },
    /// The piece of the log has too few samples for the unknowns of this fit of the motion. Use fewer unknowns, such as
    /// `harmonics`, or a longer piece.
    #[error("{method}: {samples} samples do not determine the fit: {fix}")]
    Undetermined {
        /// The differentiator.
        method: &'static str,
        /// Number of samples given.
        samples: usize,
        /// The fix.
        fix: &'static str,
    },
    /// The commanded motion has too few samples, times that do not increase, values that are not finite, or lacks a
    /// joint. Correct the table that `reference` names.
    #[error("the reference motion is wrong: {problem}")]
    Reference {
        /// The problem and the fix.
        problem: String,
    },
    /// The study was written by a program that passed its own function as differentiator; a file cannot contain this
    /// function. Run the job from that program, or choose another differentiator.
    #[error(
        "the code of the differentiator function `{name}` is not available: pass it from a program (from Python as motion = {{\"differentiator\": {{\"function\": ..}}}})"
    )]
    NoFunction {
        /// Its name.
        name: String,
    },
    /// This differentiator fits the deviation from the commanded motion, so it needs the table of this motion. Write
    /// its path as `reference`.
    #[error(
        "{method} needs the commanded motion: name its table, reference = \"trajectory.csv\", in the differentiator or in the log"
    )]
    NoReference {
        /// The differentiator.
        method: &'static str,
    },
}

/// Returns [`FilterError::Setting`] unless the condition `holds` is true.
pub(crate) fn require(holds: bool, name: &'static str, value: f64, fix: &'static str) -> Result<(), FilterError> {
    if holds { Ok(()) } else { Err(FilterError::Setting { name, value, fix }) }
}
