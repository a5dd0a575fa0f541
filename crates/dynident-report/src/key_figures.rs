//! A few figures in large type.

use crate::tone::Tone;
use serde::Serialize;

/// One figure.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct KeyFigure {
    /// What it is.
    pub label: String,
    /// The figure, with its unit.
    pub value: String,
    /// A word on it; may be empty.
    pub note: String,
    /// How it is to be taken.
    pub tone: Tone,
}

/// A few figures side by side.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct KeyFigures {
    /// The figures.
    pub figures: Vec<KeyFigure>,
}

impl KeyFigures {
    /// None yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// A further figure.
    #[must_use]
    pub fn figure(self, label: impl Into<String>, value: impl Into<String>, note: impl Into<String>) -> Self {
        self.judged(label, value, note, Tone::Plain)
    }

    /// A further figure, and how it is to be taken.
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
