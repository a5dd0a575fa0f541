//! An exported model.

/// An exported model.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// Text of the file.
    pub text: String,
    /// Contents that the format cannot represent or represents differently, one sentence each; the text contains them
    /// as comments.
    pub notes: Vec<String>,
}
