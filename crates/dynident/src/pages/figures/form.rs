use crate::error::FigureError;
use std::path::Path;

/// File format of a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FigureForm {
    /// The picture; text uses fonts of the reader's computer.
    Svg,
    /// The picture; text uses an embedded font.
    Pdf,
    /// The picture in pixels.
    Png,
    /// All plotted numbers, each as the shortest text that parses to the same number. An empty cell is a missing
    /// value.
    Csv,
    /// The table as LaTeX, with the rules of the package booktabs.
    Latex,
    /// The table as Markdown.
    Markdown,
}

impl FigureForm {
    /// The format of a file, by the ending of its name.
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
