//! Tables.

use crate::error::ReportError;
use crate::tone::Tone;
use serde::Serialize;

/// One cell.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Cell {
    /// Text.
    pub text: String,
    /// Rating.
    pub tone: Tone,
    /// Title of the section of this page that the cell links to.
    pub to: Option<String>,
}

impl<T: Into<String>> From<T> for Cell {
    fn from(text: T) -> Self {
        Self { text: text.into(), tone: Tone::Plain, to: None }
    }
}

impl Cell {
    /// Creates a cell with a rating.
    pub fn judged(text: impl Into<String>, tone: Tone) -> Self {
        Self { text: text.into(), tone, to: None }
    }

    /// Creates a cell that links to the section of this page with the title `to`.
    pub fn link(text: impl Into<String>, to: impl Into<String>) -> Self {
        Self { text: text.into(), tone: Tone::Plain, to: Some(to.into()) }
    }
}

/// A table with named columns; numeric columns (or empty cells) are right-aligned. A click on a column name sorts by
/// it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Table {
    /// Title; may be empty.
    pub title: String,
    /// Note below the title; may be empty.
    pub note: String,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Rows, one cell per column.
    pub rows: Vec<Vec<Cell>>,
}

impl Table {
    /// Creates a table without rows.
    pub fn new<C: Into<String>>(title: impl Into<String>, columns: impl IntoIterator<Item = C>) -> Self {
        Self {
            title: title.into(),
            note: String::new(),
            columns: columns.into_iter().map(Into::into).collect(),
            rows: Vec::new(),
        }
    }

    /// Sets the note below the title.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// Adds a row.
    #[must_use]
    pub fn row<C: Into<Cell>>(mut self, cells: impl IntoIterator<Item = C>) -> Self {
        self.rows.push(cells.into_iter().map(Into::into).collect());
        self
    }

    /// Adds rows.
    #[must_use]
    pub fn rows(mut self, rows: impl IntoIterator<Item = Vec<Cell>>) -> Self {
        self.rows.extend(rows);
        self
    }

    pub(crate) fn check(&self) -> Result<(), ReportError> {
        match self.rows.iter().position(|row| row.len() != self.columns.len()) {
            None => Ok(()),
            Some(at) => Err(ReportError::Shape {
                section: self.title.clone(),
                what: format!("row {at} (0-based)"),
                expected: self.columns.len(),
                found: self.rows[at].len(),
            }),
        }
    }

    pub(crate) fn numeric(&self) -> Vec<bool> {
        let number = |text: &str| {
            let text = text.trim().trim_end_matches(['%', '°']).trim_end();
            text.is_empty() || matches!(text, "–" | "-") || text.replace('−', "-").parse::<f64>().is_ok()
        };
        (0..self.columns.len())
            .map(|column| {
                let mut cells = self.rows.iter().map(|row| row[column].text.as_str());
                self.rows.iter().any(|row| row[column].text.chars().any(|c| c.is_ascii_digit())) && cells.all(number)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_numbers_are_found_and_ragged_rows_refused() {
        let table = Table::new("t", ["name", "value", "mark"]).row(["a1", "1.5", "–"]).row(["b", "−2e-3 %", ""]);
        assert_eq!(table.numeric(), [false, true, false]);
        assert!(table.check().is_ok());
        let error = table.row(["c"]).check().unwrap_err().to_string();
        assert!(error.contains("row 2") && error.contains("`t`"), "{error}");
    }
}
