//! Columns of numbers, read row by row.

use crate::error::FileError;
use core::fmt;
use core::ops::Range;

/// Columns that were recorded together, row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColumnGroup {
    /// What messages call it: a topic; `None` where the file has only one.
    pub name: Option<String>,
    /// Its columns.
    pub columns: Range<usize>,
    /// Its column of time stamps in seconds, where the format has such a thing.
    pub time: Option<usize>,
}

/// For each of `width` columns its place among the selected ones.
#[cfg(any(feature = "json", feature = "parquet"))]
pub(crate) fn slots(width: usize, columns: &[usize]) -> Vec<Option<usize>> {
    let mut slot_of = vec![None; width];
    for (slot, column) in columns.iter().enumerate() {
        slot_of[*column] = Some(slot);
    }
    slot_of
}

/// One pass over a table, from its first row to its last.
pub trait Table: fmt::Debug + Send {
    /// Number of columns.
    fn width(&self) -> usize;

    /// Names of the columns, one for each; `None` if they are addressed by 0-based index only.
    fn names(&self) -> Option<&[String]>;

    /// Which columns were recorded together; every column stands in one group, groups in ascending order.
    fn groups(&self) -> Vec<ColumnGroup> {
        vec![ColumnGroup { name: None, columns: 0..self.width(), time: None }]
    }

    /// The columns, each once, that [`next_row`](Self::next_row) is to give, in this order. Called before the first
    /// row; without it, rows are those of the first group.
    ///
    /// Rows are those of the group of the first column. Columns of other groups are interpolated linearly between
    /// their neighbours in time; rows before such a group has begun or after it has ended are left out, and a value in
    /// a hole of it is NaN.
    fn select(&mut self, columns: &[usize]);

    /// Reads one row: a number for each selected column, NaN where it is missing; false at the end.
    ///
    /// # Errors
    /// If the file is broken there.
    fn next_row(&mut self, values: &mut [f64]) -> Result<bool, FileError>;

    /// Passes over one row; false at the end.
    ///
    /// # Errors
    /// If the file is broken there.
    fn skip_row(&mut self) -> Result<bool, FileError>;

    /// Reads all that is left: `each` row with the number of its group, whose columns it has, in the order in which
    /// rows lie in the file. Not after [`select`](Self::select).
    ///
    /// # Errors
    /// If the file is broken, behind the last row that was given.
    fn all_rows(&mut self, each: &mut dyn FnMut(usize, &[f64])) -> Result<(), FileError> {
        let columns = self.width();
        self.select(&(0..columns).collect::<Vec<_>>());
        let mut row = vec![0.0; columns];
        while self.next_row(&mut row)? {
            each(0, &row);
        }
        Ok(())
    }

    /// What the file holds beside its columns and why it is none, a sentence each.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }

    /// Number of rows where it is known beforehand, or about.
    fn estimated_rows(&self) -> Option<u64> {
        None
    }

    /// Whether the file is cut off behind the last row that was given.
    fn truncated(&self) -> bool {
        false
    }
}
