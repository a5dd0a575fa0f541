use dynident_report::ReportError;
use std::path::PathBuf;
use thiserror::Error;

/// A figure that cannot be written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FigureError {
    /// The form of a figure or table follows from the ending of the file name, and this ending is unknown. Change the
    /// file name.
    #[error("{}: give a file that ends in .svg, .pdf, .png, .csv, .tex or .md", path.display())]
    Ending {
        /// The file.
        path: PathBuf,
    },
    /// A figure that cannot be drawn.
    #[error("{0}")]
    Report(#[from] ReportError),
}
