//! Interface between log formats and the reader.

use crate::error::RecordingError;
use crate::place::LogPlace;
use core::fmt;
use core::ops::Range;
use std::path::Path;

/// Source of raw rows: a file of some format, or samples in memory.
///
/// To add a format, implement this trait and [`LogTable`]. Both provide columns of numbers as recorded. A
/// [`LogFormat`](crate::LogFormat) maps the columns to quantities (unit, sign, gear ratio, range, missing values), and
/// [`LogReader`](crate::LogReader) applies this mapping.
///
/// ```
/// use dynident_recording::{Log, LogFormat, LogPlace, LogSource, LogTable, MotionBlock, MotionSettings, MotionStream};
/// use dynident_recording::RecordingError;
///
/// /// A source of the caller: an encoder at 500 Hz with a constant velocity under a constant torque.
/// #[derive(Debug)]
/// struct Turntable {
///     rows: u64,
/// }
///
/// #[derive(Debug)]
/// struct Rows {
///     fields: Vec<usize>,
///     next: u64,
///     end: u64,
/// }
///
/// impl LogSource for Turntable {
///     fn label(&self) -> String {
///         "turntable".to_owned()
///     }
///     fn open(&self) -> Result<Box<dyn LogTable>, RecordingError> {
///         Ok(Box::new(Rows { fields: Vec::new(), next: 0, end: self.rows }))
///     }
/// }
///
/// impl LogTable for Rows {
///     fn width(&self) -> usize {
///         2
///     }
///     fn select(&mut self, fields: &[usize]) {
///         self.fields = fields.to_vec();
///     }
///     fn next_row(&mut self, values: &mut [f64]) -> Result<bool, RecordingError> {
///         let row = [self.next as f64 * 0.1, 3.0];
///         for (value, field) in values.iter_mut().zip(&self.fields) {
///             *value = row[*field];
///         }
///         self.skip_row()
///     }
///     fn skip_row(&mut self) -> Result<bool, RecordingError> {
///         self.next += 1;
///         Ok(self.next <= self.end)
///     }
///     fn place(&self) -> LogPlace {
///         LogPlace::Row { log: "turntable".to_owned(), row: self.next.saturating_sub(1) }
///     }
/// }
///
/// let format: LogFormat = toml::from_str(
///     "rate_hz = 500.0\nposition = { columns = [0], unit = \"deg\" }\ntorque = { columns = [1] }",
/// )?;
/// let log = Log::new(Turntable { rows: 1000 }, format, &["table".to_owned()]);
/// let mut stream = MotionStream::new(&log, &MotionSettings::default())?;
/// let mut block = MotionBlock::default();
/// while stream.next_block(&mut block)? {
///     assert!(block.tau.iter().all(|tau| *tau == 3.0));
/// }
/// assert_eq!(stream.report().rows, 1000);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait LogSource: fmt::Debug + Send + Sync {
    /// Name in messages and reports: the path of a file, or a name from the caller.
    fn label(&self) -> String;

    /// Starts a pass at the first row. Passes are independent; several can run at once.
    ///
    /// # Errors
    /// If the source cannot be read, or is not a table.
    fn open(&self) -> Result<Box<dyn LogTable>, RecordingError>;

    /// Path of the file; the `file` keys of a format are relative to its folder. `None` for a source without a file.
    fn path(&self) -> Option<&Path> {
        None
    }

    /// Approximate number of rows, for progress bars.
    fn estimated_rows(&self) -> Option<u64> {
        None
    }
}

/// Columns of a [`LogTable`] that were recorded together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogGroup {
    /// Name in messages, for example a topic; `None` if there is only one group.
    pub name: Option<String>,
    /// Range of the group's columns.
    pub columns: Range<usize>,
    /// Index of the group's column of time stamps in seconds, if the format has one.
    pub time: Option<usize>,
}

/// One pass over the rows of a [`LogSource`], from the first to the last.
pub trait LogTable: fmt::Debug + Send {
    /// Number of columns.
    fn width(&self) -> usize;

    /// Names of the columns, one for each; `None` if columns have 0-based indices only.
    fn names(&self) -> Option<&[String]> {
        None
    }

    /// Groups of columns that were recorded together, each with its own clock. Every column belongs to one group. The
    /// rows of a pass are those of the group that contains the first selected column.
    fn groups(&self) -> Vec<LogGroup> {
        vec![LogGroup { name: None, columns: 0..self.width(), time: None }]
    }

    /// Unit of a column, if the file states it separately from the name.
    fn unit(&self, column: usize) -> Option<&str> {
        let _ = column;
        None
    }

    /// Whether [`all_rows`](Self::all_rows) found text and no numbers in all rows of a column.
    fn is_text(&self, column: usize) -> bool {
        let _ = column;
        false
    }

    /// Contents of the source that are not available as columns or numbers, with the reason for each; complete after
    /// all rows were read.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }

    /// Selects the columns (without duplicates) that [`next_row`](Self::next_row) returns, in this order. Called before
    /// the first row.
    fn select(&mut self, fields: &[usize]);

    /// Reads one row: one number for each selected column, NaN or infinite if it is missing. Returns false at the end.
    ///
    /// # Errors
    /// If the row does not consist of numbers.
    fn next_row(&mut self, values: &mut [f64]) -> Result<bool, RecordingError>;

    /// Whether a number also selects the column of a named entry, `q[2]` for `q[elbow]`.
    fn has_numbered_entries(&self) -> bool {
        false
    }

    /// Skips one row; returns false at the end.
    ///
    /// # Errors
    /// If it cannot be read.
    fn skip_row(&mut self) -> Result<bool, RecordingError>;

    /// Reads all remaining rows in their order in the source, and calls `each` with the index of the group and the
    /// values of the group's columns. Text is NaN; see [`is_text`](Self::is_text). Must not be called after
    /// [`select`](Self::select). Override this method only for sources with several groups or with text.
    ///
    /// # Errors
    /// If a row does not consist of numbers; `each` was called for the rows before it.
    fn all_rows(&mut self, each: &mut dyn FnMut(usize, &[f64])) -> Result<(), RecordingError> {
        let columns = self.width();
        self.select(&(0..columns).collect::<Vec<_>>());
        let mut row = vec![0.0; columns];
        while self.next_row(&mut row)? {
            each(0, &row);
        }
        Ok(())
    }

    /// Place of the current row, for messages; before the first row, the place of the column names.
    fn place(&self) -> LogPlace;

    /// Text of a column in the current row; `None` if only the number is available.
    fn field_text(&self, field: usize) -> Option<String> {
        let _ = field;
        None
    }

    /// Place of a truncated last row, which is omitted.
    fn truncated(&self) -> Option<LogPlace> {
        None
    }
}
