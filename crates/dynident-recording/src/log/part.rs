//! One recording in a file with several recordings: the columns whose names begin with its name.

use super::source::{LogGroup, LogTable};
use crate::error::RecordingError;
use crate::place::LogPlace;

/// A table with only the columns `PART.NAME` of another table, named `NAME`.
#[derive(Debug)]
pub(super) struct PartTable {
    table: Box<dyn LogTable>,
    /// Index in the table, and name, of each column.
    columns: Vec<usize>,
    names: Vec<String>,
}

impl PartTable {
    /// Selects the columns of `part` in `table`.
    ///
    /// # Errors
    /// A table without columns of this part.
    pub(super) fn new(table: Box<dyn LogTable>, part: &str) -> Result<Self, RecordingError> {
        let own = |name: &String| name.strip_prefix(part)?.strip_prefix('.').map(str::to_owned);
        let found = table.names().into_iter().flatten().enumerate();
        let (columns, names): (Vec<usize>, Vec<String>) =
            found.filter_map(|(column, name)| Some((column, own(name)?))).unzip();
        if !columns.is_empty() {
            return Ok(Self { table, columns, names });
        }
        let parts: Vec<String> = table.groups().into_iter().filter_map(|group| group.name).collect();
        let hint = match &parts[..] {
            [] => "the file has one part: leave the key out".to_owned(),
            [one] => format!("there is {one}"),
            [first, .., last] => format!("there are {} parts, {first} to {last}", parts.len()),
        };
        Err(RecordingError::UnknownColumn {
            place: table.place(),
            key: "part".to_owned(),
            wanted: part.to_owned(),
            hint,
        })
    }
}

impl LogTable for PartTable {
    fn width(&self) -> usize {
        self.columns.len()
    }

    fn names(&self) -> Option<&[String]> {
        Some(&self.names)
    }

    fn groups(&self) -> Vec<LogGroup> {
        let at = |column: usize| self.columns.iter().position(|own| *own == column);
        let time = self.table.groups().into_iter().filter_map(|group| group.time).find_map(at);
        vec![LogGroup { name: None, columns: 0..self.columns.len(), time }]
    }

    fn unit(&self, column: usize) -> Option<&str> {
        self.table.unit(*self.columns.get(column)?)
    }

    fn select(&mut self, fields: &[usize]) {
        let fields: Vec<usize> = fields.iter().map(|field| self.columns[*field]).collect();
        self.table.select(&fields);
    }

    fn next_row(&mut self, values: &mut [f64]) -> Result<bool, RecordingError> {
        self.table.next_row(values)
    }

    fn skip_row(&mut self) -> Result<bool, RecordingError> {
        self.table.skip_row()
    }

    fn place(&self) -> LogPlace {
        self.table.place()
    }

    fn field_text(&self, field: usize) -> Option<String> {
        self.table.field_text(*self.columns.get(field)?)
    }

    fn truncated(&self) -> Option<LogPlace> {
        self.table.truncated()
    }
}
