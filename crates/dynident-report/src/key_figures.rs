//! Key figures in large type.

use crate::tone::Tone;
use serde::Serialize;

/// One figure.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct KeyFigure {
    /// Label.
    pub label: String,
    /// Value, with its unit.
    pub value: String,
    /// Note; may be empty.
    pub note: String,
    /// Rating.
    pub tone: Tone,
}

/// Key figures side by side.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct KeyFigures {
    /// The figures.
    pub figures: Vec<KeyFigure>,
}

impl KeyFigures {
    /// Creates an empty list.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a figure.
    #[must_use]
    pub fn figure(self, label: impl Into<String>, value: impl Into<String>, note: impl Into<String>) -> Self {
        self.judged(label, value, note, Tone::Plain)
    }

    /// Adds a figure with a rating.
    #[must_use]
    pub fn judged(
        mut self,
        label: impl Into<String>,
        value: impl Into<String>,
        note: impl Into<String>,
        tone: Tone,
    ) -> Self {
        self.figures.push(KeyFigure { label: label.into(), value: value.into(), note: note.into(), tone });
        self
    }
}
