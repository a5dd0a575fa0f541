//! Places in a log, for messages.

use core::fmt;

/// A place in a log, for messages: `log.csv:17`, or `my samples, row 16`.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum LogPlace {
    /// The whole log.
    Whole {
        /// Label of the log.
        log: String,
    },
    /// A line of a text file.
    Line {
        /// Label of the log.
        log: String,
        /// 1-based line number.
        line: u64,
    },
    /// A row of numbers without a line number.
    Row {
        /// Label of the log.
        log: String,
        /// 0-based row number.
        row: u64,
    },
}

impl fmt::Display for LogPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole { log } => f.write_str(log),
            Self::Line { log, line } => write!(f, "{log}:{line}"),
            Self::Row { log, row } => write!(f, "{log}, row {row}"),
        }
    }
}
