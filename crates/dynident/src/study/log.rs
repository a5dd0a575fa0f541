//! `[[log]]`: one recording, or a part of one.

use super::arrays::exactly;
use dynident_identification::Role;
use dynident_recording::{LogFormat, ReferenceSettings};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// `[[log]]`: one recording, or a part of one.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct LogSection {
    /// The main file.
    pub file: PathBuf,
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
}

impl LogSection {
    pub(crate) fn validate(&self) -> Result<(), String> {
        if let Some(reference) = &self.reference {
            reference.validate().map_err(|error| format!("reference: {error}"))?;
        }
        let ranges = [self.rows.is_some(), self.fraction.is_some(), self.time_range_s.is_some()];
        if ranges.into_iter().filter(|given| *given).count() > 1 {
            return Err("give one of rows, fraction and time_range_s, not several".to_owned());
        }
        Ok(())
    }
}
