//! Output of `export` as JSON.

use crate::servo_form::ServoForm;
use serde::{Deserialize, Serialize};

/// Name and version of the schema of [`ExportFile`].
pub const EXPORT_SCHEMA: &str = "dynident/export/1";

/// Output of `export` as JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ExportFile {
    /// [`EXPORT_SCHEMA`].
    pub schema: String,
    /// The export format, named as on the command line.
    pub target: String,
    /// Parts of the model that the target does not represent or represents differently, and problems of the model.
    pub notes: Vec<String>,
    /// The output file; null if `text` contains the export.
    pub file: Option<String>,
    /// For servo drives identified from commands: what the file cannot represent, and the error of the motion simulated
    /// with it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub servo_forms: Vec<ServoForm>,
    /// The exported text.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub text: Option<String>,
}
