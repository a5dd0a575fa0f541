//! Held-out error of an exported file; `dynident export` writes it next to the file.

use super::forms::FormError;
use super::provenance::Provenance;
use super::servo_form::ServoForm;
use dynident_export::ModelTerm;
use dynident_identification::payload::ControllerPayload;
use serde::{Deserialize, Serialize};

/// Name and version of the schema of [`ExportValidationFile`].
pub const EXPORT_VALIDATION_SCHEMA: &str = "dynident/export-validation/1";

/// Validation of an exported file NAME, stored as `NAME.validation.json` in the same folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ExportValidationFile {
    /// [`EXPORT_VALIDATION_SCHEMA`].
    pub schema: String,
    /// Provenance of the result.
    pub provenance: Option<Provenance>,
    /// Name of the study.
    pub name: String,
    /// Export format, named as in `dynident export`; `dh` for a Denavit-Hartenberg table.
    pub form: String,
    /// Name of the exported file.
    pub file: String,
    /// SHA-256 of the exported file, as `sha256sum` prints it.
    pub sha256: String,
    /// Whether the format lacks some torque terms of the result. The values of the remaining terms were then fitted
    /// again.
    pub refitted: bool,
    /// Torque error of the exported file and of the identified model on each held-out log. Empty without held-out logs,
    /// for payloads and for results of older versions.
    pub held_out: Vec<FormError>,
    /// Torque terms of the identified model that the file does not contain, with their values in the model.
    pub left_out: Vec<ModelTerm>,
    /// The exported payload with the interval of each value; null for models of the arm.
    pub payload: Option<ControllerPayload>,
    /// For servo drives identified from commands: the error of the motion that is simulated with the file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub servo_forms: Vec<ServoForm>,
    /// Problems of the result.
    pub problems: Vec<String>,
}
