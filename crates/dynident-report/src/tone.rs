//! Rating of a value as good or bad.

use serde::Serialize;

/// Rating of a value; it sets the colour of the text, and a symbol for people who cannot distinguish the colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Tone {
    /// No rating.
    #[default]
    Plain,
    /// Good.
    Good,
    /// To be checked.
    Warning,
    /// Bad.
    Bad,
}
