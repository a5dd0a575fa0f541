//! Output of `validate` as JSON.

use super::method::LogSummary;
use dynident_identification::examination::LogValidation;
use serde::{Deserialize, Serialize};

/// Name and version of the schema of [`ValidationFile`].
pub const VALIDATION_SCHEMA: &str = "dynident/validation/1";

/// Output of `validate` as JSON.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ValidationFile {
    /// [`VALIDATION_SCHEMA`].
    pub schema: String,
    /// Name of the study.
    pub name: String,
    /// Errors on each log.
    pub validation: Vec<LogValidation>,
    /// Import findings.
    pub logs: Vec<LogSummary>,
    /// Reasons not to trust the errors: tested logs that were used for the fit, problems of the logs. If there are any,
    /// the command exits with status 1.
    #[serde(default)]
    pub problems: Vec<String>,
}
