//! Paragraphs and lists.

use crate::tone::Tone;
use serde::Serialize;

/// Paragraphs, then a list of points; plain text, no markup.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Text {
    /// Paragraphs.
    pub paragraphs: Vec<String>,
    /// Points of a list, with how they are to be taken.
    pub points: Vec<(Tone, String)>,
}

impl Text {
    /// One paragraph.
    pub fn new(paragraph: impl Into<String>) -> Self {
        Self { paragraphs: vec![paragraph.into()], points: Vec::new() }
    }

    /// A further point of the list.
    #[must_use]
    pub fn point(mut self, tone: Tone, point: impl Into<String>) -> Self {
        self.points.push((tone, point.into()));
        self
    }
}
