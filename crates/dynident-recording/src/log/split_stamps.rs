//! Time stamps in two columns, whole seconds and nanoseconds, as ROS writes them: `secs` and `nsecs`, `stamp.sec` and
//! `stamp.nanosec`.

use super::source::{LogGroup, LogTable};
use crate::error::RecordingError;
use crate::place::LogPlace;

/// Last words of the names of both columns: seconds, and nanoseconds.
const NAMES: [[&str; 2]; 5] =
    [["secs", "nsecs"], ["sec", "nanosec"], ["sec", "nsec"], ["secs", "nanosecs"], ["seconds", "nanoseconds"]];

/// A table in which the values of the columns of whole seconds include the nanoseconds.
#[derive(Debug)]
pub(super) struct SplitStamps {
    table: Box<dyn LogTable>,
    /// Columns of seconds and of nanoseconds.
    pairs: Vec<[usize; 2]>,
    /// For each selected column, the index of its nanoseconds among the values of `table`.
    nanoseconds: Vec<Option<usize>>,
    row: Vec<f64>,
}

impl SplitStamps {
    /// Combines both columns; returns `table` itself if it has no such columns.
    pub(super) fn joined(table: Box<dyn LogTable>) -> Box<dyn LogTable> {
        let names = table.names().unwrap_or_default();
        let other = |name: &String| {
            NAMES.iter().find_map(|[seconds, nanoseconds]| {
                let before = name.strip_suffix(seconds)?;
                let is_word = before.is_empty() || before.ends_with(['.', '/', '_', ' ']);
                let other = format!("{before}{nanoseconds}");
                names.iter().position(|name| *name == other).filter(|_| is_word)
            })
        };
        let pairs: Vec<[usize; 2]> =
            names.iter().enumerate().filter_map(|(seconds, name)| Some([seconds, other(name)?])).collect();
        if pairs.is_empty() {
            return table;
        }
        let mut joined = Self { table, pairs, nanoseconds: Vec::new(), row: Vec::new() };
        joined.select(&[]);
        Box::new(joined)
    }
}

impl LogTable for SplitStamps {
    fn width(&self) -> usize {
        self.table.width()
    }

    fn names(&self) -> Option<&[String]> {
        self.table.names()
    }

    fn groups(&self) -> Vec<LogGroup> {
        self.table.groups()
    }

    fn unit(&self, column: usize) -> Option<&str> {
        self.table.unit(column)
    }

    fn is_text(&self, column: usize) -> bool {
        self.table.is_text(column)
    }

    fn notes(&self) -> Vec<String> {
        let names = self.table.names().unwrap_or_default();
        let note = |[seconds, nanoseconds]: &[usize; 2]| {
            format!("column `{}` includes the nanoseconds of `{}`", names[*seconds], names[*nanoseconds])
        };
        self.table.notes().into_iter().chain(self.pairs.iter().map(note)).collect()
    }

    fn select(&mut self, fields: &[usize]) {
        let mut inner = fields.to_vec();
        self.nanoseconds = fields
            .iter()
            .map(|field| {
                let [_, other] = self.pairs.iter().find(|[seconds, _]| seconds == field)?;
                Some(inner.iter().position(|known| known == other).unwrap_or_else(|| {
                    inner.push(*other);
                    inner.len() - 1
                }))
            })
            .collect();
        self.row = vec![0.0; inner.len()];
        self.table.select(&inner);
    }

    fn next_row(&mut self, values: &mut [f64]) -> Result<bool, RecordingError> {
        let found = self.table.next_row(&mut self.row)?;
        for ((value, own), other) in values.iter_mut().zip(&self.row).zip(&self.nanoseconds) {
            *value = other.map_or(*own, |other| own + 1e-9 * self.row[other]);
        }
        Ok(found)
    }

    fn skip_row(&mut self) -> Result<bool, RecordingError> {
        self.table.skip_row()
    }

    fn all_rows(&mut self, each: &mut dyn FnMut(usize, &[f64])) -> Result<(), RecordingError> {
        let (groups, pairs, mut joined) = (self.table.groups(), &self.pairs, Vec::new());
        self.table.all_rows(&mut |group, row| {
            let columns = &groups[group].columns;
            joined.clear();
            joined.extend_from_slice(row);
            for [seconds, nanoseconds] in pairs.iter().filter(|pair| pair.iter().all(|at| columns.contains(at))) {
                joined[seconds - columns.start] += 1e-9 * row[nanoseconds - columns.start];
            }
            each(group, &joined);
        })
    }

    fn place(&self) -> LogPlace {
        self.table.place()
    }

    fn field_text(&self, field: usize) -> Option<String> {
        self.table.field_text(field)
    }

    fn truncated(&self) -> Option<LogPlace> {
        self.table.truncated()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::format::Header;
    use crate::log::text::TextTable;
    use std::path::Path;

    fn table(text: &str) -> Box<dyn LogTable> {
        let text = Box::new(std::io::Cursor::new(text.as_bytes().to_vec()));
        SplitStamps::joined(Box::new(TextTable::open(Path::new("log"), text, Header::Auto, None).unwrap()))
    }

    #[test]
    fn seconds_include_their_nanoseconds() {
        let text = "stamp.nsecs,q,stamp.secs\n500000000,7,10\n250000000,8,11\n";
        let mut log = table(text);
        log.select(&[2, 1]);
        let mut row = [0.0; 2];
        assert!(log.next_row(&mut row).unwrap());
        assert_eq!(row, [10.5, 7.0]);
        let mut rows = Vec::new();
        table(text).all_rows(&mut |_, row| rows.push(row.to_vec())).unwrap();
        assert_eq!(rows, [[5e8, 7.0, 10.5], [2.5e8, 8.0, 11.25]]);
        // A column of seconds alone, and columns of other names.
        let mut other = table("secs,t_nsecs\n1,5\n");
        other.select(&[0]);
        assert!(other.next_row(&mut row[..1]).unwrap() && row[0] == 1.0 && other.notes().is_empty());
    }
}
