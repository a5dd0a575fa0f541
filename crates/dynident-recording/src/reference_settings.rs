//! How a study file names the commanded motion.

use crate::error::FilterError;
use crate::logistic_path::LogisticPath;
use crate::reference::{Reference, check_boundaries};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Where the commanded motion comes from: the table that `design` wrote, or the closed form of the paper's strokes. A text alone is the table's file.
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
/// assert!(table.validate().is_ok() && table.build(1.0).is_err()); // the table has still to be read
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ReferenceSettings {
    /// Table with columns `t_s, q1.., dq1.., ddq1..` (SI), the joints in the order of the robot's description.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// In place of a table: one spliced logistic function for each joint, in the same order.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub joints: Vec<LogisticPath>,
    /// Where strokes begin and end, seconds after the motion's start, for all joints; by default they are what lies between rests.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub strokes_s: Vec<f64>,
    /// When it begins, in seconds after the log's first row; 0 by default.
    pub start_s: f64,
}

impl<'de> Deserialize<'de> for ReferenceSettings {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(
            untagged,
            expecting = "reference is a file in quotes, or a table with file or joints, and start_s: { file = \"trajectory.csv\", start_s = 0.0 }"
        )]
        enum Written {
            File(PathBuf),
            Table(Table),
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Table {
            #[serde(default)]
            file: Option<PathBuf>,
            #[serde(default)]
            joints: Vec<LogisticPath>,
            #[serde(default)]
            strokes_s: Vec<f64>,
            #[serde(default)]
            start_s: f64,
        }
        Ok(match Written::deserialize(deserializer)? {
            Written::File(file) => Self { file: Some(file), ..Self::default() },
            Written::Table(Table { file, joints, strokes_s, start_s }) => Self { file, joints, strokes_s, start_s },
        })
    }
}

impl ReferenceSettings {
    /// Checks what can be checked without the table.
    ///
    /// # Errors
    /// [`FilterError::Reference`] if file and joints are both given or a path has no meaning; [`FilterError::Setting`] if the start is not finite.
    pub fn validate(&self) -> Result<(), FilterError> {
        if !(self.start_s.is_finite() && self.start_s.abs() <= 1e6) {
            return Err(FilterError::Setting { name: "start_s", value: self.start_s, mend: "give seconds" });
        }
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

    /// The closed form, if joints are given.
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

    /// A motion with the strokes and the start that the settings name.
    ///
    /// # Errors
    /// [`FilterError::Reference`] if the strokes' boundaries do not increase.
    pub fn placed(&self, reference: Reference) -> Result<Reference, FilterError> {
        let reference =
            if self.strokes_s.is_empty() { reference } else { reference.with_boundaries(&self.strokes_s)? };
        Ok(reference.starting_at(self.start_s))
    }
}

#[cfg(test)]
mod tests {
    use crate::DifferentiatorSettings;

    /// A result stores its settings as JSON, and `validate` reads them back.
    #[test]
    fn settings_survive_json() {
        for text in [
            "method = \"time-warp\"\nreference = \"a.csv\"",
            "method = \"logistic-map\"\nreference = { start_s = -1.5, joints = [{ amplitude = 1.0, omega = 1.0, offset = 0.0, period_s = 40.0 }] }",
            "method = \"deviation\"\nmax_lag_s = 0.1\nreference = { file = \"a.csv\", start_s = 2.0, strokes_s = [0.0, 1.5] }\nsmoother = { method = \"savitzky-golay\", window = 21 }",
            "method = \"frequency-domain\"\nends = \"periodic\"",
        ] {
            let settings: DifferentiatorSettings = toml::from_str(text).unwrap();
            settings.validate().unwrap();
            let json = serde_json::to_string(&settings).unwrap();
            assert_eq!(serde_json::from_str::<DifferentiatorSettings>(&json).unwrap(), settings, "{json}");
        }
    }

    #[test]
    fn contradictions_and_misspelt_keys_are_refused() {
        for text in [
            "method = \"time-warp\"\nreference = { fle = \"a.csv\" }",
            "method = \"time-warp\"\nrefrence = \"a.csv\"",
            "method = \"time-warp\"\nreference = 3",
        ] {
            assert!(toml::from_str::<DifferentiatorSettings>(text).is_err(), "{text}");
        }
        for text in [
            "method = \"time-warp\"\nmax_lag_s = 0.0",
            "method = \"time-warp\"\nreference = { start_s = inf }",
            "method = \"time-warp\"\nreference = { strokes_s = [1.0] }",
            "method = \"time-warp\"\nreference = { strokes_s = [1.0, 0.5] }",
            "method = \"time-warp\"\nreference = { file = \"a.csv\", joints = [{ amplitude = 1.0, omega = 1.0, offset = 0.0, period_s = 40.0 }] }",
            "method = \"deviation\"\nsmoother = { method = \"time-warp\" }",
        ] {
            let settings: DifferentiatorSettings = toml::from_str(text).unwrap();
            assert!(settings.validate().is_err(), "{text}");
        }
    }

    #[test]
    fn a_cutoff_left_to_the_data_is_filled_in_wherever_it_stands() {
        let settings: DifferentiatorSettings = toml::from_str("method = \"deviation\"").unwrap();
        assert!(settings.wants_cutoff());
        let settings = settings.with_cutoff(3.0).with_cutoff(5.0);
        assert_eq!((settings.wants_cutoff(), settings.cutoff_hz()), (false, Some(3.0)));
        let none: DifferentiatorSettings = toml::from_str("method = \"savitzky-golay\"\nwindow = 5").unwrap();
        assert_eq!((none.wants_cutoff(), none.with_cutoff(3.0).cutoff_hz()), (false, None));
    }
}
