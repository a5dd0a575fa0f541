use crate::error::FigureError;
use std::path::Path;

/// Form of a file of a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FigureForm {
    /// The picture; text in the fonts of the reader's computer.
    Svg,
    /// The picture; text in an embedded font.
    Pdf,
    /// The picture in pixels.
    Png,
    /// Every drawn number, with the shortest text that gives the same number. An empty cell is a missing value.
    Csv,
    /// The table, with the rules of the package booktabs.
    Latex,
    /// The table.
    Markdown,
}

impl FigureForm {
    /// The form of a file, by the ending of its name.
    ///
    /// # Errors
    /// [`FigureError::Ending`]
    pub fn of(path: &Path) -> Result<Self, FigureError> {
        let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
        Ok(match &*ending {
            "svg" => Self::Svg,
            "pdf" => Self::Pdf,
            "png" => Self::Png,
            "csv" => Self::Csv,
            "tex" => Self::Latex,
            "md" => Self::Markdown,
            _ => return Err(FigureError::Ending { path: path.to_owned() }),
        })
    }
}
