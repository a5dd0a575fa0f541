//! What `export` prints: the schema of its JSON.

use serde::{Deserialize, Serialize};

/// Name and version of the schema of [`ExportFile`].
pub const EXPORT_SCHEMA: &str = "dynident/export/1";

/// What `export` prints as JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ExportFile {
    /// [`EXPORT_SCHEMA`].
    pub schema: String,
    /// The form, as the command names it.
    pub target: String,
    /// What the form does not hold, or holds differently, and what speaks against the model; a sentence each.
    pub notes: Vec<String>,
    /// The file that it was written to; none where `text` has it.
    pub file: Option<String>,
    /// What was written.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub text: Option<String>,
}
