//! Output of `evaluate` as JSON.

use serde::{Deserialize, Serialize};

/// Name and version of the schema of [`EvaluationFile`].
pub const EVALUATION_SCHEMA: &str = "dynident/evaluation/1";

/// Output of `evaluate` as JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct EvaluationFile {
    /// [`EVALUATION_SCHEMA`].
    pub schema: String,
    /// The computed quantity, named as on the command line.
    pub quantity: String,
    /// Degrees of freedom.
    pub dof: usize,
    /// Number of rows.
    pub rows: u64,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// The output file; null if `values` contains the table.
    pub file: Option<String>,
    /// The table, row by row, SI units; null if it was written to a file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub values: Option<Vec<Vec<f64>>>,
}
