//! A heading within the page.

use serde::Serialize;

/// A heading; it is listed in the table of contents.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Heading {
    /// Text.
    pub text: String,
}

impl Heading {
    /// Creates a heading.
    pub fn new(text: impl Into<String>) -> Self {
        Self { text: text.into() }
    }
}
