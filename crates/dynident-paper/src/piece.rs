//! Tables and figures of the paper as data for `paper.json`, the page and the pictures.

use dynident_report::{Diagram, LinePlot, ReportError};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Content of a table cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged)]
pub enum PaperCell {
    /// A number.
    Number(f64),
    /// A word or an expression.
    Text(String),
    /// No value.
    None,
}

impl PaperCell {
    /// Formatted with four digits.
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

/// A table of the paper, with our values next to the paper's.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PaperTable {
    /// Number of the table in the paper.
    #[serde(skip)]
    pub number: usize,
    /// Title.
    pub title: String,
    /// Headings of the columns.
    pub columns: Vec<String>,
    /// Rows, with one cell per column.
    pub rows: Vec<Vec<PaperCell>>,
    /// Explanation for the reader.
    pub note: String,
}

impl PaperTable {
    pub(crate) fn new(number: usize, title: &str, columns: &[&str], note: &str) -> Self {
        let columns = columns.iter().map(|&column| column.to_owned()).collect();
        Self { number, title: title.to_owned(), columns, rows: Vec::new(), note: note.to_owned() }
    }

    pub(crate) fn heading(&self) -> String {
        format!("Table {}: {}", self.number, self.title)
    }

    pub(crate) fn row(&mut self, cells: impl IntoIterator<Item = PaperCell>) {
        self.rows.push(cells.into_iter().collect());
    }
}

/// A figure of the paper.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PaperFigure {
    /// Number of the figure in the paper.
    pub number: usize,
    /// File name of the picture, in the folder of `paper.json`.
    pub file: String,
    /// Title.
    pub title: String,
    /// Values for comparison with the paper, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub values: BTreeMap<String, f64>,
    /// The same values as a sentence, with units.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub caption: String,
    /// Explanation for the reader.
    pub note: String,
    /// Content of the picture.
    #[serde(skip)]
    pub picture: PaperPicture,
}

/// Content of a figure.
#[derive(Clone, Debug)]
pub enum PaperPicture {
    /// Curves.
    Plot(LinePlot),
    /// Boxes and arrows.
    Diagram(Diagram),
}

impl Default for PaperPicture {
    fn default() -> Self {
        Self::Plot(LinePlot::default())
    }
}

impl PaperPicture {
    /// The picture as an SVG document; plots have the size `width` by `height` px.
    pub(crate) fn svg(&self, width: f64, height: f64) -> Result<String, ReportError> {
        match self {
            Self::Plot(plot) => plot.svg(width, height),
            Self::Diagram(diagram) => diagram.svg(),
        }
    }
}

impl From<LinePlot> for PaperPicture {
    fn from(plot: LinePlot) -> Self {
        Self::Plot(plot)
    }
}

impl From<Diagram> for PaperPicture {
    fn from(diagram: Diagram) -> Self {
        Self::Diagram(diagram)
    }
}

impl PaperFigure {
    pub(crate) fn new(number: usize, picture: impl Into<PaperPicture>, note: &str) -> Self {
        let picture = picture.into();
        let title = match &picture {
            PaperPicture::Plot(plot) => plot.title.clone(),
            PaperPicture::Diagram(diagram) => diagram.title.clone(),
        };
        let file = format!("figure_{number:02}.svg");
        let (values, caption) = (BTreeMap::new(), String::new());
        Self { number, file, title, values, caption, note: note.to_owned(), picture }
    }

    pub(crate) fn heading(&self) -> String {
        format!("Fig. {}: {}", self.number, self.title)
    }

    pub(crate) fn caption(mut self, caption: impl Into<String>) -> Self {
        self.caption = caption.into();
        self
    }

    pub(crate) fn value(mut self, name: &str, value: f64) -> Self {
        self.values.insert(name.to_owned(), value);
        self
    }
}

/// A statement or figure reading of the paper, and its result here.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PaperStatement {
    /// Place in the paper.
    pub place: String,
    /// Statement of the paper.
    pub paper: String,
    /// Result here.
    pub here: String,
    /// Whether the result confirms the statement.
    pub holds: bool,
}

/// A reference of the paper, and the corresponding part of this project.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PaperReference {
    /// Number in the paper.
    pub number: usize,
    /// Authors, as named in the paper's text.
    pub source: String,
    /// Idea that the paper uses.
    pub idea: String,
    /// Key of a study, page of the book, or file.
    pub here: String,
}

/// A deviation of the reproduction from the paper's text, with its reason.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Deviation {
    /// Place in the paper.
    pub place: String,
    /// Statement or omission of the paper, and its problem.
    pub trouble: String,
    /// Solution here.
    pub here: String,
}

pub(crate) fn shown(value: f64) -> String {
    PaperCell::from(value).shown()
}

/// A number in a sentence: two significant digits.
pub(crate) fn rough(value: f64) -> String {
    dynident_report::short(value, 2)
}

/// Reduces the samples of smooth curves by a factor to keep the page small.
pub(crate) fn thinned(mut plot: LinePlot, step: usize) -> LinePlot {
    let every = |values: &[f64]| values.iter().step_by(step).copied().collect();
    plot.x = every(&plot.x);
    for line in &mut plot.lines {
        line.values = every(&line.values);
    }
    plot
}
