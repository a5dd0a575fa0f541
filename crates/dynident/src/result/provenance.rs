//! Where a result comes from.

use serde::{Deserialize, Serialize};

/// Where a result comes from; the same for the same study, files and program, whenever and wherever it is made.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Provenance {
    /// Twelve hexadecimal digits that stand for all below but the command: files of one run carry the same. The first
    /// of the SHA-256 of the version, the study as it was read, and the hashes of all further files that were read.
    pub identity: String,
    /// Version of the program.
    pub version: String,
    /// What was called, without what does not change the result (folder of the outputs, threads, what is printed); none
    /// when it was not the command.
    #[serde(default)]
    pub command: Option<String>,
    /// SHA-256 of the content of this `result.json` without `timings_s` and `command`: a result that was edited or
    /// damaged is not read. None in other files and in results of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub content_sha256: Option<String>,
    /// The study's file; none when it was not read from a file.
    pub study: Option<InputFile>,
    /// Everything else that was read.
    pub inputs: Vec<InputFile>,
}

/// A file that was read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct InputFile {
    /// What it is: `study`, `robot`, `log`, `trajectory` or `result`.
    pub what: String,
    /// Where it lay, seen from the study's folder.
    pub file: String,
    /// Its length.
    pub bytes: u64,
    /// SHA-256 of its contents, as `sha256sum` prints it.
    pub sha256: String,
}
