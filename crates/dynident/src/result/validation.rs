//! What `validate` prints: the schema of its JSON.

use super::identification::LogSummary;
use dynident_identification::examination::LogValidation;
use serde::{Deserialize, Serialize};

/// Name and version of the schema of [`ValidationFile`].
pub const VALIDATION_SCHEMA: &str = "dynident/validation/1";

/// What `validate` prints as JSON.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ValidationFile {
    /// [`VALIDATION_SCHEMA`].
    pub schema: String,
    /// Name of the study.
    pub name: String,
    /// Figures by log.
    pub validation: Vec<LogValidation>,
    /// What the importer found.
    pub logs: Vec<LogSummary>,
    /// Everything that speaks against the figures, a sentence each: logs that the model was fitted to, problems of the
    /// logs. Where there are any, the command exits with status 1.
    #[serde(default)]
    pub problems: Vec<String>,
}
