//! `[[log]]`: one recording, or a part of one.

use super::arrays::exactly;
use super::servo::PerJoint;
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
    /// The main file; for samples in memory, their name.
    pub file: PathBuf,
    /// The samples, instead of a file: a table whose columns `format` describes. Not serialised.
    #[serde(skip)]
    pub samples: Option<MemoryLog>,
    /// Overrides `part` of the format: selects one recording in a file with several.
    #[serde(default)]
    pub part: Option<String>,
    /// Name in reports; the file name by default.
    #[serde(default)]
    pub name: Option<String>,
    /// Use of the log; `identify` by default.
    #[serde(default)]
    pub role: Role,
    /// Format of this log, instead of the study's `format`.
    #[serde(default)]
    pub format: Option<LogFormat>,
    /// The commanded motion, instead of that in the differentiator's settings.
    #[serde(default)]
    pub reference: Option<ReferenceSettings>,
    /// Name of the `[[payload]]` that the robot carries in this recording; no payload by default.
    #[serde(default)]
    pub payload: Option<String>,
    /// Position gain of the servos in this log, relative to `stiffness` of `[drive.servo]`: one number, or one number
    /// per joint. Use it for logs with different gains in the firmware; 0 means that the position controller is off.
    /// 1 by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub servo_gain: Option<PerJoint>,
    /// Overrides `rows` of the format.
    #[serde(default, deserialize_with = "exactly")]
    pub rows: Option<[u64; 2]>,
    /// Overrides `fraction` of the format.
    #[serde(default, deserialize_with = "exactly")]
    pub fraction: Option<[f64; 2]>,
    /// Overrides `time_range_s` of the format.
    #[serde(default, deserialize_with = "exactly")]
    pub time_range_s: Option<[f64; 2]>,
    /// Added to `drop_rows` of the format.
    #[serde(default)]
    pub drop_rows: Vec<[u64; 2]>,
    /// Added to `drop_time_s` of the format.
    #[serde(default)]
    pub drop_time_s: Vec<[f64; 2]>,
}

impl LogSection {
    /// Relative position gain of each of `joints` joints; empty if the log has none.
    pub fn servo_gains(&self, joints: usize) -> Vec<f64> {
        match &self.servo_gain {
            None => Vec::new(),
            Some(PerJoint::Same(gain)) => vec![*gain; joints],
            Some(PerJoint::Each(gains)) => gains.clone(),
        }
    }

    /// The format of this log with its range: its own format, or that of the study; `None` if neither is given.
    pub fn format_or(&self, of_study: Option<&LogFormat>) -> Option<LogFormat> {
        let mut format = self.format.as_ref().or(of_study)?.clone();
        if self.rows.is_some() || self.fraction.is_some() || self.time_range_s.is_some() {
            (format.rows, format.fraction, format.time_range_s) = (self.rows, self.fraction, self.time_range_s);
        }
        if self.part.is_some() {
            format.part.clone_from(&self.part);
        }
        format.drop_rows.extend_from_slice(&self.drop_rows);
        format.drop_time_s.extend_from_slice(&self.drop_time_s);
        Some(format)
    }

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
