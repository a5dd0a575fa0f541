//! Output of `reduce` and `merge` as JSON.

use serde::{Deserialize, Serialize};

/// Name and version of the schema of [`FactorsFile`].
pub const FACTORS_SCHEMA: &str = "dynident/factors/1";

/// A factor file: logs reduced for identification.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FactorsFile {
    /// [`FACTORS_SCHEMA`].
    pub schema: String,
    /// The factor file.
    pub file: String,
    /// Size, bytes.
    pub bytes: u64,
    /// Name of the robot in its description.
    pub robot: String,
    /// The logs, sorted by individual robot, time, name and hash.
    pub logs: Vec<FactorsLog>,
}

/// A reduced log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FactorsLog {
    /// Name.
    pub name: String,
    /// Identifier of the individual robot, for several robots of the same type.
    pub arm: Option<String>,
    /// Time of recording, UTC: `2026-01-05T08:00:00Z`.
    pub recorded_at: Option<String>,
    /// SHA-256 of the log's numbers; equal hashes mean the same log.
    pub sha256: String,
    /// Number of filtered rows.
    pub rows: u64,
}
