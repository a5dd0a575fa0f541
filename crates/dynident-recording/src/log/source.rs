//! Where rows of numbers come from: the seam behind which every log format stands.

use crate::error::RecordingError;
use crate::place::LogPlace;
use core::fmt;
use core::ops::Range;
use std::path::Path;

/// Where raw rows come from: a file of some format, or samples in memory.
///
/// A format is one type with this trait and one with [`LogTable`]. They deal in columns of numbers as they were
/// recorded; what the columns mean (unit, sign, gear, range, missing values) is a [`LogFormat`](crate::LogFormat) and
/// the business of [`LogReader`](crate::LogReader), which stands behind all of them.
///
/// ```
/// use dynident_recording::{Log, LogFormat, LogPlace, LogSource, LogTable, MotionBlock, MotionSettings, MotionStream};
/// use dynident_recording::RecordingError;
///
/// /// A source of one's own: an encoder at 500 Hz that turns with a constant velocity under a constant torque.
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
    /// What messages and reports call it: the path of a file, or a name that the caller gave.
    fn label(&self) -> String;

    /// Begins a pass at the first row. Passes know nothing of each other: several may be under way at once.
    ///
    /// # Errors
    /// If it cannot be read, or is no table.
    fn open(&self) -> Result<Box<dyn LogTable>, RecordingError>;

    /// Its file, beside which the `file` keys of a format are looked for; `None` for what is no file.
    fn path(&self) -> Option<&Path> {
        None
    }

    /// Number of rows, about: for progress bars only.
    fn estimated_rows(&self) -> Option<u64> {
        None
    }
}

/// Columns of a [`LogTable`] that were recorded together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogGroup {
    /// What messages call it: a topic; `None` where there is only one.
    pub name: Option<String>,
    /// Its columns.
    pub columns: Range<usize>,
    /// Its column of time stamps in seconds, where the format has such a thing.
    pub time: Option<usize>,
}

/// One pass over the rows of a [`LogSource`], from the first to the last.
pub trait LogTable: fmt::Debug + Send {
    /// Number of columns.
    fn width(&self) -> usize;

    /// Names of the columns, one for each; `None` if they can be addressed by 0-based index only.
    fn names(&self) -> Option<&[String]> {
        None
    }

    /// Which columns were recorded together, each on its own clock; rows are those of the group of the first column
    /// that is selected. Every column stands in one group.
    fn groups(&self) -> Vec<LogGroup> {
        vec![LogGroup { name: None, columns: 0..self.width(), time: None }]
    }

    /// What the source holds beside its columns and why it is none, a sentence each.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }

    /// The columns, each once, that [`next_row`](Self::next_row) is to give, in this order. Called before the first
    /// row.
    fn select(&mut self, fields: &[usize]);

    /// Reads one row: one number for each selected column, NaN or infinite where it is missing; false at the end.
    ///
    /// # Errors
    /// If the row is no row of numbers.
    fn next_row(&mut self, values: &mut [f64]) -> Result<bool, RecordingError>;

    /// Passes over one row; false at the end.
    ///
    /// # Errors
    /// If it cannot be read.
    fn skip_row(&mut self) -> Result<bool, RecordingError>;

    /// Reads all that is left: `each` row with the number of its group, whose columns it has, in the order in which
    /// rows lie in the source. Not after [`select`](Self::select). Written anew only where there are several groups.
    ///
    /// # Errors
    /// If a row is no row of numbers, behind those that were given.
    fn all_rows(&mut self, each: &mut dyn FnMut(usize, &[f64])) -> Result<(), RecordingError> {
        let columns = self.width();
        self.select(&(0..columns).collect::<Vec<_>>());
        let mut row = vec![0.0; columns];
        while self.next_row(&mut row)? {
            each(0, &row);
        }
        Ok(())
    }

    /// Where the row last read stands; before the first one, where the columns are named.
    fn place(&self) -> LogPlace;

    /// The field of a column in the row last read, as it stands there; `None` where there is only the number.
    fn field_text(&self, field: usize) -> Option<String> {
        let _ = field;
        None
    }

    /// Where a last row was cut off and therefore left out.
    fn truncated(&self) -> Option<LogPlace> {
        None
    }
}
