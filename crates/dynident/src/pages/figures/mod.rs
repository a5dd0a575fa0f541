//! Figures and tables for papers: each with a picture, its data, and a table.

mod convergence;
mod data;
mod form;
mod friction;
mod parameters;
mod residuals;

pub use form::FigureForm;

use crate::error::FigureError;
use data::Data;
use dynident_report::{PrintFigure, PrintPanel, PrintStyle, Table};

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
    /// A size without room for the plots.
    pub fn svg(&self, style: &PrintStyle) -> Result<String, FigureError> {
        Ok(self.picture.svg(style)?)
    }

    /// Contents of a file of the figure.
    ///
    /// # Errors
    /// [`FigureError::Report`]: a size without room for the plots, an invalid resolution, characters without glyphs.
    pub fn contents(&self, form: FigureForm, style: &PrintStyle) -> Result<Vec<u8>, FigureError> {
        Ok(match form {
            FigureForm::Svg => self.svg(style)?.into_bytes(),
            FigureForm::Pdf => self.picture.pdf(style)?,
            FigureForm::Png => self.picture.png(style)?,
            FigureForm::Csv => self.data.csv().into_bytes(),
            FigureForm::Latex => self.table.latex()?.into_bytes(),
            FigureForm::Markdown => self.table.markdown()?.into_bytes(),
        })
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
