//! A matrix in colours.

use crate::error::ReportError;
use crate::ticks::short;
use serde::Serialize;

/// Most cells that carry a text under the pointer: beyond, the page would grow too large.
const MOST_TEXTS: usize = 4096;
/// Width of the cells together, px; letters of a name that are drawn, and their width.
const CELLS: f64 = 560.0;
const LETTERS: usize = 22;
const LETTER: f64 = 6.5;

/// A matrix in colours: blue below zero, red above, as strong as the value against the largest; gaps stay empty. The
/// value stands under the pointer.
#[derive(Clone, Debug, PartialEq)]
pub struct HeatMap {
    /// Headline.
    pub title: String,
    /// A sentence below it; may be empty.
    pub note: String,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Names of the rows.
    pub rows: Vec<String>,
    /// Values by row, NaN for gaps.
    pub values: Vec<Vec<f64>>,
    /// The value of full colour; the largest magnitude unless given.
    pub limit: Option<f64>,
}

impl HeatMap {
    /// A matrix with its names.
    pub fn new<C: Into<String>, R: Into<String>>(
        title: impl Into<String>,
        rows: impl IntoIterator<Item = R>,
        columns: impl IntoIterator<Item = C>,
        values: Vec<Vec<f64>>,
    ) -> Self {
        Self {
            title: title.into(),
            note: String::new(),
            columns: columns.into_iter().map(Into::into).collect(),
            rows: rows.into_iter().map(Into::into).collect(),
            values,
            limit: None,
        }
    }

    /// A sentence below the headline.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// The value of full colour.
    #[must_use]
    pub fn limit(mut self, limit: f64) -> Self {
        self.limit = Some(limit);
        self
    }

    /// The map as an SVG picture.
    ///
    /// # Errors
    /// If rows or columns do not have as many values as names.
    pub fn svg(&self) -> Result<String, ReportError> {
        let wrong =
            |what: String, expected, found| ReportError::Shape { section: self.title.clone(), what, expected, found };
        if self.values.len() != self.rows.len() {
            return Err(wrong("values".to_owned(), self.rows.len(), self.values.len()));
        }
        if let Some(row) = self.values.iter().position(|row| row.len() != self.columns.len()) {
            return Err(wrong(format!("row {row} (0-based)"), self.columns.len(), self.values[row].len()));
        }
        let finite = self.values.iter().flatten().filter(|value| value.is_finite());
        let largest = finite.fold(0.0_f64, |largest, value| largest.max(value.abs()));
        let limit = self.limit.filter(|limit| limit.is_finite() && *limit > 0.0).unwrap_or(largest);
        let side = (CELLS / self.columns.len().max(1) as f64).clamp(4.0, 36.0);
        let longest = self.rows.iter().chain(&self.columns).map(|name| name.chars().count().min(LETTERS)).max();
        let labels = 14.0 + LETTER * longest.unwrap_or(0) as f64;
        let texts = self.columns.len() * self.rows.len() <= MOST_TEXTS;
        let cells = self.values.iter().enumerate().flat_map(|(row, values)| {
            values
                .iter()
                .enumerate()
                .filter(|(_, value)| value.is_finite())
                .map(move |(column, value)| (row, column, *value))
        });
        let cells = cells.map(|(row, column, value)| CellView {
            x: labels + side * column as f64,
            y: labels + side * row as f64,
            colour: if value < 0.0 { "#0072b2" } else { "#d55e00" },
            strength: if limit > 0.0 { ((value.abs() / limit).min(1.0) * 100.0).round() / 100.0 } else { 0.0 },
            text: texts.then(|| format!("{} × {}: {}", self.rows[row], self.columns[column], short(value, 4))),
        });
        // Names that would overlap are left out; the text under the pointer has them.
        let every = (11.0 / side).ceil().max(1.0) as usize;
        let names = |names: &[String]| -> Vec<(f64, String)> {
            let shown = names.iter().enumerate().step_by(every);
            shown.map(|(k, name)| (labels + side * (k as f64 + 0.5), name.chars().take(LETTERS).collect())).collect()
        };
        let view = Picture {
            title: &self.title,
            width: labels + side * self.columns.len() as f64 + 8.0,
            height: labels + side * self.rows.len() as f64 + 8.0,
            labels,
            side,
            columns: names(&self.columns),
            rows: names(&self.rows),
            cells: cells.collect(),
        };
        crate::templates::rendered("heat_map.svg", &view)
    }
}

#[derive(Serialize)]
struct Picture<'a> {
    title: &'a str,
    width: f64,
    height: f64,
    labels: f64,
    side: f64,
    columns: Vec<(f64, String)>,
    rows: Vec<(f64, String)>,
    cells: Vec<CellView>,
}

#[derive(Serialize)]
struct CellView {
    x: f64,
    y: f64,
    colour: &'static str,
    strength: f64,
    text: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_stay_empty_and_ragged_matrices_are_refused() {
        let map = HeatMap::new("t", ["a", "b"], ["x", "y<"], vec![vec![1.0, -0.5], vec![f64::NAN, 0.0]]);
        let svg = map.svg().unwrap();
        assert_eq!(svg.matches("<title>").count() - 1, 3, "{svg}");
        assert!(svg.contains("b × y&lt;: 0") && !svg.contains("NaN"));
        assert!(HeatMap::new("t", ["a"], ["x"], vec![]).svg().is_err());
        assert!(HeatMap::new("t", ["a"], ["x"], vec![vec![1.0, 2.0]]).svg().is_err());
        assert!(!HeatMap::new("zeros", ["a"], ["x"], vec![vec![0.0]]).svg().unwrap().contains("NaN"));
        let none: [&str; 0] = [];
        assert!(HeatMap::new("none", none, none, vec![]).svg().is_ok());
    }
}
