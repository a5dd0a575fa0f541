//! Errors when columns are read from a file. Each message names the file, the place and the fix.

use crate::kind::FileFormat;
use std::path::{Path, PathBuf};

/// A file that cannot be read in its format.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// The file does not exist, or you have no permission to read it. Correct the path or the permissions.
    #[error("{}: cannot be read ({source}); check the path and its permissions", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// Dynident recognised the file, but it does not read this format. Convert the file as the message states.
    #[error("{}: this is {format}, which Dynident does not read; {fix}", file.display())]
    OtherFormat {
        /// The file.
        file: PathBuf,
        /// The format.
        format: &'static str,
        /// How to convert the file.
        fix: &'static str,
    },
    /// This program was compiled without the reader of this format. Use the released program, or build with the feature
    /// that the message names.
    #[error(
        "{}: this is {format}, which this build does not read; build with the feature `{feature}` of dynident-formats",
        file.display()
    )]
    NotBuilt {
        /// The file.
        file: PathBuf,
        /// The format.
        format: &'static str,
        /// The required feature.
        feature: &'static str,
    },
    /// The file is truncated, damaged, or does not follow the rules of its format. Often the recorder was stopped while
    /// it wrote. Copy or record the file again.
    #[error("{}: {format}, {place}: {problem}; {fix}", file.display())]
    Broken {
        /// The file.
        file: PathBuf,
        /// The format.
        format: &'static str,
        /// Place in the file.
        place: String,
        /// The problem.
        problem: String,
        /// The fix.
        fix: &'static str,
    },
    /// The file contains text or structures but no lists of numbers. Export the samples as columns, one row for each
    /// sample.
    #[error("{}: {format} without a column of numbers ({found}); {fix}", file.display())]
    NoColumns {
        /// The file.
        file: PathBuf,
        /// The format.
        format: &'static str,
        /// What the file contains instead.
        found: String,
        /// The fix.
        fix: &'static str,
    },
}

impl FileError {
    /// The file.
    pub fn file(&self) -> &Path {
        match self {
            Self::Io { file, .. }
            | Self::OtherFormat { file, .. }
            | Self::NotBuilt { file, .. }
            | Self::Broken { file, .. }
            | Self::NoColumns { file, .. } => file,
        }
    }

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

/// Escapes control characters in a text from a file and shortens it for a message.
pub(crate) fn visible(text: &str) -> String {
    const MAX_SHOWN: usize = 200;
    let shown: String = text
        .chars()
        .take(MAX_SHOWN)
        .flat_map(|c| if c.is_control() { c.escape_default().collect::<Vec<_>>() } else { vec![c] })
        .collect();
    if text.chars().nth(MAX_SHOWN).is_some() { shown + ".." } else { shown }
}
