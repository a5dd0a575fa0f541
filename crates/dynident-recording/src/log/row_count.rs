//! Storage of the number of rows of a source, so that rows are counted only once for all passes.

use crate::error::RecordingError;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::SystemTime;

#[derive(Debug, Default)]
pub(super) struct RowCount(Mutex<Option<(Counted, u64)>>);

/// Columns and file for which a row count is valid. The rows may depend on the columns, and the file may change.
#[derive(Debug, PartialEq)]
struct Counted {
    fields: Vec<usize>,
    file: Option<(u64, Option<SystemTime>)>,
}

impl RowCount {
    /// Number of rows of the source with these columns. It is stored until the columns or the file at `path` change.
    pub(super) fn of(
        &self,
        fields: &[usize],
        path: Option<&Path>,
        count: impl FnOnce() -> Result<u64, RecordingError>,
    ) -> Result<u64, RecordingError> {
        let file = path.and_then(|path| path.metadata().ok()).map(|data| (data.len(), data.modified().ok()));
        let now = Counted { fields: fields.to_vec(), file };
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, rows)) = known.as_ref().filter(|(counted, _)| *counted == now) {
            return Ok(*rows);
        }
        let rows = count()?;
        *known = Some((now, rows));
        Ok(rows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_count_is_valid_for_its_columns_and_its_file() {
        let path = std::env::temp_dir().join(format!("dynident_row_count_{}", std::process::id()));
        let count = RowCount::default();
        let of = |fields: &[usize], rows| count.of(fields, Some(&path), || Ok(rows)).unwrap();
        std::fs::write(&path, "one").unwrap();
        assert_eq!([of(&[0, 1], 5), of(&[0, 1], 6), of(&[2], 7), of(&[2], 8)], [5, 5, 7, 7]);
        std::fs::write(&path, "one and two").unwrap();
        assert_eq!([of(&[2], 9), of(&[2], 10)], [9, 9]);
        std::fs::remove_file(&path).unwrap();
        // Errors are not cached.
        let fails = count.of(&[3], None, || Err(RecordingError::NoFolder { log: "log".into(), key: "torque" }));
        assert!(fails.is_err());
        assert_eq!(count.of(&[3], None, || Ok(4)).unwrap(), 4);
    }
}
