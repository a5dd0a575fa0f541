//! Provenance of a result.

use serde::{Deserialize, Serialize};

/// Provenance of a result; equal for the same study, files and program version.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Provenance {
    /// Twelve hexadecimal digits that identify all inputs of a run; all files of the run have the same digits. They are
    /// the first digits of the SHA-256 of the version, the study, and the hashes of all further inputs, but not the
    /// command.
    pub identity: String,
    /// Version of the program.
    pub version: String,
    /// The command, without options that do not affect the result (output folder, threads, printing); null if the
    /// command was not used.
    #[serde(default)]
    pub command: Option<String>,
    /// SHA-256 of this `result.json` without `timings_s` and `command`, which detects edited or damaged results. Null
    /// in other files and in results of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub content_sha256: Option<String>,
    /// The study file; null if the study was not read from a file.
    pub study: Option<InputFile>,
    /// All other inputs.
    pub inputs: Vec<InputFile>,
}

/// An input file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct InputFile {
    /// Kind: `study`, `robot`, `log`, `trajectory` or `result`.
    pub what: String,
    /// Path relative to the study's folder.
    pub file: String,
    /// Size, bytes.
    pub bytes: u64,
    /// SHA-256 of its contents, as `sha256sum` prints it.
    pub sha256: String,
}
