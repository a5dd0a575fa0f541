//! Tables and figures of the paper, as data: the same for `paper.json`, the page and the pictures.

use dynident_report::LinePlot;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What a cell of a table holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged)]
pub enum PaperCell {
    /// A number.
    Number(f64),
    /// A word or an expression.
    Text(String),
    /// Nothing to compare with.
    None,
}

impl PaperCell {
    /// As a person reads it: four digits.
    pub(crate) fn shown(&self) -> String {
        match self {
            Self::Number(value) if *value == 0.0 => "0".to_owned(),
            Self::Number(value) if value.abs() < 1e-3 => format!("{value:.1e}"),
            Self::Number(value) if value.abs() >= 100.0 => format!("{value:.1}"),
            Self::Number(value) => format!("{value:.4}"),
            Self::Text(text) => text.clone(),
            Self::None => "–".to_owned(),
        }
    }
}

impl From<f64> for PaperCell {
    fn from(value: f64) -> Self {
        if value.is_finite() { Self::Number(value) } else { Self::None }
    }
}

impl From<&str> for PaperCell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

/// A table of the paper, our values beside the paper's.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PaperTable {
    /// Its number in the paper.
    #[serde(skip)]
    pub number: usize,
    /// What it shows.
    pub title: String,
    /// Heads of the columns.
    pub columns: Vec<String>,
    /// Rows, as wide as the heads.
    pub rows: Vec<Vec<PaperCell>>,
    /// What to know when reading it.
    pub note: String,
}

impl PaperTable {
    pub(crate) fn new(number: usize, title: &str, columns: &[&str], note: &str) -> Self {
        let columns = columns.iter().map(|&column| column.to_owned()).collect();
        Self { number, title: title.to_owned(), columns, rows: Vec::new(), note: note.to_owned() }
    }

    pub(crate) fn row(&mut self, cells: impl IntoIterator<Item = PaperCell>) {
        self.rows.push(cells.into_iter().collect());
    }
}

/// A figure of the paper.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PaperFigure {
    /// Its number in the paper.
    pub number: usize,
    /// The picture, beside `paper.json`.
    pub file: String,
    /// What it shows.
    pub title: String,
    /// Figures to compare with the paper's, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub values: BTreeMap<String, f64>,
    /// What to know when looking at it.
    pub note: String,
    /// The picture's data.
    #[serde(skip)]
    pub plot: LinePlot,
}

impl PaperFigure {
    pub(crate) fn new(number: usize, plot: LinePlot, note: &str) -> Self {
        let title = plot.title.clone();
        let file = format!("figure_{number:02}.svg");
        Self { number, file, title, values: BTreeMap::new(), note: note.to_owned(), plot }
    }

    pub(crate) fn value(mut self, name: &str, value: f64) -> Self {
        self.values.insert(name.to_owned(), value);
        self
    }
}

/// Where this reproduction departs from the paper's text, and why.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Deviation {
    /// Where in the paper.
    pub place: String,
    /// What the paper says or leaves out, and what is wrong with it.
    pub trouble: String,
    /// What is done here.
    pub here: String,
}
