//! Good, bad, or neither.

use serde::Serialize;

/// How a value is to be taken; it colours the text, and a mark beside it says the same to those who do not see colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Tone {
    /// A value.
    #[default]
    Plain,
    /// As it should be.
    Good,
    /// Worth a look.
    Warning,
    /// As it should not be.
    Bad,
}
