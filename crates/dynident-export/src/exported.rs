//! A model in a form.

/// A model in a form.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// The file's text.
    pub text: String,
    /// What the form does not hold, or holds differently, a sentence each; the text has them as comments.
    pub notes: Vec<String>,
}
