//! Figures and tables for papers: each with a picture, its data, and a table.

mod convergence;
mod data;
mod friction;
mod parameters;
mod residuals;

use crate::error::Error;
use data::Data;
use dynident_report::{PrintFigure, PrintPanel, PrintStyle, ReportError, Table};

/// A figure of a result or an iteration: picture, data, table.
#[derive(Clone, Debug)]
pub struct Figure {
    picture: PrintFigure,
    data: Data,
    table: Table,
}

impl Figure {
    fn new(title: impl Into<String>, panels: Vec<PrintPanel>, data: Data, table: Table) -> Self {
        Self { picture: PrintFigure { title: title.into(), panels }, data, table }
    }

    /// The picture as SVG.
    ///
    /// # Errors
    /// [`ReportError::PrintSize`] for a size without room for the plots.
    pub fn svg(&self, style: &PrintStyle) -> Result<String, ReportError> {
        self.picture.svg(style)
    }

    /// Every drawn number as CSV, with the shortest text that gives the same number. An empty cell is a missing value.
    pub fn csv(&self) -> String {
        self.data.csv()
    }

    /// The table as LaTeX, with the rules of the package booktabs.
    ///
    /// # Errors
    /// [`Error::Report`], which indicates a bug.
    pub fn latex(&self) -> Result<String, Error> {
        Ok(self.table.latex()?)
    }

    /// The table as Markdown.
    ///
    /// # Errors
    /// [`Error::Report`], which indicates a bug.
    pub fn markdown(&self) -> Result<String, Error> {
        Ok(self.table.markdown()?)
    }
}

/// Units in the order of their first appearance.
fn units<'a>(all: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    all.fold(Vec::new(), |mut units, unit| {
        if !units.contains(&unit) {
            units.push(unit);
        }
        units
    })
}
