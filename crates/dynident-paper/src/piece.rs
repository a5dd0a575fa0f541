//! Tables and figures of the paper, as data: the same for `paper.json`, the page and the pictures.

use dynident_report::{Diagram, LinePlot, ReportError};
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

    /// Its headline on the page.
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
    /// Its number in the paper.
    pub number: usize,
    /// The picture, beside `paper.json`.
    pub file: String,
    /// What it shows.
    pub title: String,
    /// Figures to compare with the paper's, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub values: BTreeMap<String, f64>,
    /// The same figures as a sentence, with units.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub caption: String,
    /// What to know when looking at it.
    pub note: String,
    /// What is drawn.
    #[serde(skip)]
    pub picture: PaperPicture,
}

/// What a figure draws.
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
    /// The picture as a document, plots `width` by `height` px.
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

    /// Its headline on the page.
    pub(crate) fn heading(&self) -> String {
        format!("Fig. {}: {}", self.number, self.title)
    }

    /// What to compare with the paper, as a sentence.
    pub(crate) fn caption(mut self, caption: impl Into<String>) -> Self {
        self.caption = caption.into();
        self
    }

    pub(crate) fn value(mut self, name: &str, value: f64) -> Self {
        self.values.insert(name.to_owned(), value);
        self
    }
}

/// What the paper says in words or reads off its figures, and whether it comes out here.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PaperStatement {
    /// Where in the paper.
    pub place: String,
    /// What it says.
    pub paper: String,
    /// What is found here.
    pub here: String,
    /// Whether that is so here too.
    pub holds: bool,
}

/// A source of the paper, and where its idea lives in this project.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PaperReference {
    /// Its number in the paper.
    pub number: usize,
    /// Whose it is, as far as the paper's text says.
    pub source: String,
    /// What the paper takes from it.
    pub idea: String,
    /// Key of a study, page of the book, file.
    pub here: String,
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

/// A number as a person reads it.
pub(crate) fn shown(value: f64) -> String {
    PaperCell::from(value).shown()
}

/// A number in a sentence: two significant digits.
pub(crate) fn rough(value: f64) -> String {
    dynident_report::short(value, 2)
}

/// Every `step`-th sample of smooth curves, so that the page stays small.
pub(crate) fn thinned(mut plot: LinePlot, step: usize) -> LinePlot {
    let every = |values: &[f64]| values.iter().step_by(step).copied().collect();
    plot.x = every(&plot.x);
    for line in &mut plot.lines {
        line.values = every(&line.values);
    }
    plot
}
