//! Settings of the commanded motion in a study file.

use super::logistic_path::LogisticPath;
use super::{Reference, check_boundaries};
use crate::error::{FilterError, require};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Source of the commanded motion: a table that `design` wrote, or the closed form of logistic strokes. A string is the
/// file name of the table.
///
/// ```
/// use dynident_recording::DifferentiatorSettings;
/// let table: DifferentiatorSettings =
///     toml::from_str("method = \"time-warp\"\nreference = \"trajectory.csv\"").unwrap();
/// let closed: DifferentiatorSettings = toml::from_str(
///     r#"
///     method = "position-map"
///     reference = { start_s = 2.0, joints = [{ amplitude = 2.094, omega = 0.996, offset = 0.0, period_s = 40.16 }] }
///     "#,
/// )
/// .unwrap();
/// assert!(closed.build(1.0).is_ok());
/// assert!(table.validate().is_ok() && table.build(1.0).is_err()); // the table was not read yet
/// ```
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(from = "WrittenReference")]
pub struct ReferenceSettings {
    /// File of a table with the columns `t_s, q1.., dq1.., ddq1..` (SI units), joints in the order of the robot
    /// description.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Instead of a table: one spliced logistic function for each joint, in the order of the robot description.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub joints: Vec<LogisticPath>,
    /// Times between the strokes, s after the start of the motion, for all joints. By default, strokes are the parts of
    /// the motion between rests.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub strokes_s: Vec<f64>,
    /// Start of the motion, s after the first row of the log; 0 by default.
    pub start_s: f64,
}

/// Serialised form of [`ReferenceSettings`]: a file name, or a table.
#[derive(Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(
    untagged,
    expecting = "reference is a file in quotes, or a table with file or joints, and start_s: { file = \"trajectory.csv\", start_s = 0.0 }"
)]
enum WrittenReference {
    File(PathBuf),
    Table(ReferenceTable),
}

#[derive(Default, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
struct ReferenceTable {
    file: Option<PathBuf>,
    joints: Vec<LogisticPath>,
    strokes_s: Vec<f64>,
    start_s: f64,
}

impl From<WrittenReference> for ReferenceSettings {
    fn from(written: WrittenReference) -> Self {
        match written {
            WrittenReference::File(file) => Self { file: Some(file), ..Self::default() },
            WrittenReference::Table(ReferenceTable { file, joints, strokes_s, start_s }) => {
                Self { file, joints, strokes_s, start_s }
            }
        }
    }
}

impl ReferenceSettings {
    /// Checks the settings, without reading the table.
    ///
    /// # Errors
    /// [`FilterError::Reference`] if file and joints are both given or a path is invalid; [`FilterError::Setting`] if
    /// the start is not finite.
    pub fn validate(&self) -> Result<(), FilterError> {
        require(self.start_s.is_finite() && self.start_s.abs() <= 1e6, "start_s", self.start_s, "give seconds")?;
        if self.file.is_some() && !self.joints.is_empty() {
            return Err(FilterError::Reference {
                problem: "file and joints are both given: keep one of them".to_owned(),
            });
        }
        if !self.strokes_s.is_empty() {
            check_boundaries(&self.strokes_s)?;
        }
        self.joints.iter().try_for_each(LogisticPath::validate)
    }

    /// The commanded motion in closed form, if `joints` are given.
    ///
    /// # Errors
    /// As [`validate`](Self::validate).
    pub fn closed_form(&self) -> Result<Option<Reference>, FilterError> {
        self.validate()?;
        if self.joints.is_empty() {
            return Ok(None);
        }
        self.placed(Reference::logistic(&self.joints)?).map(Some)
    }

    /// Applies the strokes and the start of the settings to a motion.
    ///
    /// # Errors
    /// [`FilterError::Reference`] if the boundaries of the strokes do not increase.
    pub fn placed(&self, reference: Reference) -> Result<Reference, FilterError> {
        let reference =
            if self.strokes_s.is_empty() { reference } else { reference.with_boundaries(&self.strokes_s)? };
        Ok(reference.starting_at(self.start_s))
    }
}
