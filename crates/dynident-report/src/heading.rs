//! A heading within the page.

use serde::Serialize;

/// A headline; it stands in the page's list of contents.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Heading {
    /// The headline.
    pub text: String,
}

impl Heading {
    /// A headline.
    pub fn new(text: impl Into<String>) -> Self {
        Self { text: text.into() }
    }
}
