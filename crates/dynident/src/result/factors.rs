//! What `reduce` and `merge` print: the schema of their JSON.

use serde::{Deserialize, Serialize};

/// Name and version of the schema of [`FactorsFile`].
pub const FACTORS_SCHEMA: &str = "dynident/factors/1";

/// A file of factors that was written: logs reduced to what a fit needs of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FactorsFile {
    /// [`FACTORS_SCHEMA`].
    pub schema: String,
    /// Where the factors stand.
    pub file: String,
    /// Bytes of the file.
    pub bytes: u64,
    /// The robot, as its description calls it.
    pub robot: String,
    /// Its logs, by robot, time, name and hash.
    pub logs: Vec<FactorsLog>,
}

/// A log of which factors are left.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FactorsLog {
    /// What it is called.
    pub name: String,
    /// The robot that it was recorded on, where there are several of one kind.
    pub arm: Option<String>,
    /// When it was recorded, UTC: `2026-01-05T08:00:00Z`.
    pub recorded_at: Option<String>,
    /// Hash of its numbers: two logs with the same one are one log.
    pub sha256: String,
    /// Filtered rows that they stand for.
    pub rows: u64,
}
