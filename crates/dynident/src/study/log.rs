//! `[[log]]`: one recording, or a part of one.

use super::arrays::exactly;
use crate::error::StudyError;
use dynident_identification::Role;
use dynident_recording::{LogFormat, MemoryLog, ReferenceSettings};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// `[[log]]`: one recording, or a part of one.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct LogSection {
    /// The main file; of samples in memory, what they are called.
    pub file: PathBuf,
    /// The samples themselves, in place of a file's: a table whose columns `format` explains. Not written.
    #[serde(skip)]
    pub samples: Option<MemoryLog>,
    /// What it is called in reports; the file's name by default.
    #[serde(default)]
    pub name: Option<String>,
    /// What it is for; to identify by default.
    #[serde(default)]
    pub role: Role,
    /// Its own format, in place of the study's.
    #[serde(default)]
    pub format: Option<LogFormat>,
    /// The motion that was commanded, in place of the differentiator's own; for differentiators that need it.
    #[serde(default)]
    pub reference: Option<ReferenceSettings>,
    /// The `[[payload]]` that it was recorded with, by name; none by default.
    #[serde(default)]
    pub payload: Option<String>,
    /// In place of the format's `rows`.
    #[serde(default, deserialize_with = "exactly")]
    pub rows: Option<[u64; 2]>,
    /// In place of the format's `fraction`.
    #[serde(default, deserialize_with = "exactly")]
    pub fraction: Option<[f64; 2]>,
    /// In place of the format's `time_range_s`.
    #[serde(default, deserialize_with = "exactly")]
    pub time_range_s: Option<[f64; 2]>,
    /// Beside the format's `drop_rows`.
    #[serde(default)]
    pub drop_rows: Vec<[u64; 2]>,
    /// Beside the format's `drop_time_s`.
    #[serde(default)]
    pub drop_time_s: Vec<[f64; 2]>,
}

impl LogSection {
    pub(crate) fn validate(&self) -> Result<(), StudyError> {
        if let Some(reference) = &self.reference {
            reference.validate().map_err(StudyError::at("reference"))?;
        }
        let ranges =
            [self.rows.map(|_| "rows"), self.fraction.map(|_| "fraction"), self.time_range_s.map(|_| "time_range_s")];
        let keys: Vec<&str> = ranges.into_iter().flatten().collect();
        if keys.len() > 1 { Err(StudyError::Exclusive { keys }) } else { Ok(()) }
    }
}
