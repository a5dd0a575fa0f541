//! What `evaluate` prints: the schema of its JSON.

use serde::{Deserialize, Serialize};

/// Name and version of the schema of [`EvaluationFile`].
pub const EVALUATION_SCHEMA: &str = "dynident/evaluation/1";

/// What `evaluate` prints as JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct EvaluationFile {
    /// [`EVALUATION_SCHEMA`].
    pub schema: String,
    /// What was computed, as the command names it.
    pub quantity: String,
    /// Degrees of freedom.
    pub dof: usize,
    /// Rows of the table.
    pub rows: u64,
    /// Names of its columns.
    pub columns: Vec<String>,
    /// The file that it was written to; none where `values` has it.
    pub file: Option<String>,
    /// The table, row by row, SI units.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub values: Option<Vec<Vec<f64>>>,
}
