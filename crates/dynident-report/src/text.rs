//! Paragraphs and lists.

use crate::tone::Tone;
use serde::Serialize;

/// Paragraphs, then a list; plain text without markup.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Text {
    /// Paragraphs.
    pub paragraphs: Vec<String>,
    /// List items with ratings.
    pub points: Vec<(Tone, String)>,
}

impl Text {
    /// Creates a text with one paragraph.
    pub fn new(paragraph: impl Into<String>) -> Self {
        Self { paragraphs: vec![paragraph.into()], points: Vec::new() }
    }

    /// Adds a list item.
    #[must_use]
    pub fn point(mut self, tone: Tone, point: impl Into<String>) -> Self {
        self.points.push((tone, point.into()));
        self
    }
}
