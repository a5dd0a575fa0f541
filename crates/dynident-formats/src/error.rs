//! What can go wrong between a file and its columns: each message names the file, the place and the fix.

use crate::kind::FileFormat;
use std::path::{Path, PathBuf};

/// A file that cannot be read as what it is.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// The operating system refused the file.
    #[error("{}: cannot be read ({source}); check the path and its permissions", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A file of a format that is not read.
    #[error("{}: this is {format}, which is not read; {fix}", file.display())]
    OtherFormat {
        /// The file.
        file: PathBuf,
        /// What it is.
        format: &'static str,
        /// How to make something of it that is read.
        fix: &'static str,
    },
    /// A format that this build leaves out.
    #[error(
        "{}: this is {format}, which this build does not read; build with the feature `{feature}` of dynident-formats",
        file.display()
    )]
    NotBuilt {
        /// The file.
        file: PathBuf,
        /// What it is.
        format: &'static str,
        /// The feature that reads it.
        feature: &'static str,
    },
    /// A file that breaks its format's rules, or is cut off.
    #[error("{}: {format}, {place}: {problem}; {fix}", file.display())]
    Broken {
        /// The file.
        file: PathBuf,
        /// What it is.
        format: &'static str,
        /// Where in it.
        place: String,
        /// What is wrong.
        problem: String,
        /// What to do.
        fix: &'static str,
    },
    /// A file without a column of numbers.
    #[error("{}: {format} without a column of numbers ({found}); {fix}", file.display())]
    NoColumns {
        /// The file.
        file: PathBuf,
        /// What it is.
        format: &'static str,
        /// What it holds instead.
        found: String,
        /// What to do.
        fix: &'static str,
    },
}

impl FileError {
    pub(crate) fn broken(
        file: &Path,
        format: FileFormat,
        place: impl Into<String>,
        problem: impl Into<String>,
        fix: &'static str,
    ) -> Self {
        let (place, problem) = (place.into(), visible(&problem.into()));
        Self::Broken { file: file.to_owned(), format: format.name(), place: visible(&place), problem, fix }
    }

    pub(crate) fn no_columns(file: &Path, format: FileFormat, found: impl Into<String>, fix: &'static str) -> Self {
        Self::NoColumns { file: file.to_owned(), format: format.name(), found: visible(&found.into()), fix }
    }
}

/// A text from a file as it can be shown: escaped, and not endless.
pub(crate) fn visible(text: &str) -> String {
    const LONGEST: usize = 200;
    let shown: String = text
        .chars()
        .take(LONGEST)
        .flat_map(|c| if c.is_control() { c.escape_default().collect::<Vec<_>>() } else { vec![c] })
        .collect();
    if text.chars().nth(LONGEST).is_some() { shown + ".." } else { shown }
}
