//! Columns of numbers, read row by row.

use crate::error::FileError;
use core::fmt;
use core::ops::Range;

/// Columns that were recorded together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColumnGroup {
    /// Name of the group in messages, such as a topic; `None` for a single group.
    pub name: Option<String>,
    /// Range of its columns.
    pub columns: Range<usize>,
    /// Index of its column of time stamps in seconds, if the format has one.
    pub time: Option<usize>,
}

/// Index of each of `width` columns among the selected columns.
#[cfg(any(feature = "json", feature = "parquet"))]
pub(crate) fn slots(width: usize, columns: &[usize]) -> Vec<Option<usize>> {
    let mut slot_of = vec![None; width];
    for (slot, column) in columns.iter().enumerate() {
        slot_of[*column] = Some(slot);
    }
    slot_of
}

/// A table of columns that is read once, from its first row to its last.
pub trait Table: fmt::Debug + Send {
    /// Number of columns.
    fn width(&self) -> usize;

    /// Names of the columns, one for each; `None` if columns have 0-based indices only.
    fn names(&self) -> Option<&[String]>;

    /// Whether a number also selects the column of a named entry, `q[2]` for `q[elbow]`: only in files of arrays, which
    /// have one order of the columns.
    fn has_numbered_entries(&self) -> bool {
        false
    }

    /// Groups of columns that were recorded together, in ascending order; every column belongs to one group.
    fn groups(&self) -> Vec<ColumnGroup> {
        vec![ColumnGroup { name: None, columns: 0..self.width(), time: None }]
    }

    /// Selects the columns, without duplicates, that [`next_row`](Self::next_row) returns, in this order. It must be
    /// called before the first row is read; by default the columns of the first group are selected.
    ///
    /// The rows are those of the group of the first selected column. Columns of other groups are interpolated
    /// linearly in time. Rows before the start or after the end of such a group are omitted, and values in a gap of
    /// it are NaN.
    fn select(&mut self, columns: &[usize]);

    /// Reads one row: a number for each selected column, NaN if missing; false at the end.
    ///
    /// # Errors
    /// If the file is corrupt at this row.
    fn next_row(&mut self, values: &mut [f64]) -> Result<bool, FileError>;

    /// Skips one row; false at the end.
    ///
    /// # Errors
    /// If the file is corrupt at this row.
    fn skip_row(&mut self) -> Result<bool, FileError>;

    /// Reads all remaining rows in their order in the file and passes each to `each`, with its group number and the
    /// columns of the group. [`select`](Self::select) must not be called before.
    ///
    /// # Errors
    /// If the file is corrupt; the rows before the error were passed on.
    fn all_rows(&mut self, each: &mut dyn FnMut(usize, &[f64])) -> Result<(), FileError> {
        let columns = self.width();
        self.select(&(0..columns).collect::<Vec<_>>());
        let mut row = vec![0.0; columns];
        while self.next_row(&mut row)? {
            each(0, &row);
        }
        Ok(())
    }

    /// Parts of the file that are not available as columns, with the reason for each.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }

    /// Number of rows, exact or approximate, if known in advance.
    fn estimated_rows(&self) -> Option<u64> {
        None
    }

    /// Whether the file is truncated after the last row.
    fn truncated(&self) -> bool {
        false
    }
}
