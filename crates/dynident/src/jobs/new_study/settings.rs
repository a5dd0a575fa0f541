//! Thresholds of a new study.

use crate::error::{Expected, StudyError};

/// Thresholds of [`new_study_with`](crate::new_study_with).
#[derive(Clone, Debug, PartialEq)]
pub struct NewStudySettings {
    /// Part of a single recording that is used for training, as fractions of its rows. Default 0 to 0.65.
    pub training_fraction: [f64; 2],
    /// Part of a single recording that is used for validation, as fractions of its rows. Default 0.7 to 1: the gap
    /// after the training part separates correlated samples.
    pub validation_fraction: [f64; 2],
    /// Largest position, in turns, that is assumed to be in radians. Default 4.
    pub max_radian_turns: f64,
    /// Largest position of a prismatic joint, in m, that is assumed to be in metres. Default 10.
    pub max_travel_m: f64,
    /// Largest range of the positions and of the torques of a joint that stands still, as a share of the largest range
    /// of the other joints. Default 1e-3: a finger that holds its place moves by a few units of its encoder.
    pub max_still_share: f64,
}

impl Default for NewStudySettings {
    fn default() -> Self {
        Self {
            training_fraction: [0.0, 0.65],
            validation_fraction: [0.7, 1.0],
            max_radian_turns: 4.0,
            max_travel_m: 10.0,
            max_still_share: 1e-3,
        }
    }
}

impl NewStudySettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// A fraction outside of 0 to 1, an overlap of training and validation, or a number of turns or a travel that is
    /// not positive.
    pub fn validate(&self) -> Result<(), StudyError> {
        let ([from, to], [validation_from, validation_to]) = (self.training_fraction, self.validation_fraction);
        Expected::Range(0.0, to).check("training_fraction", from)?;
        Expected::Range(to, validation_to).check("validation_fraction", validation_from)?;
        Expected::Range(0.0, 1.0).check("validation_fraction", validation_to)?;
        Expected::Positive.check("max_radian_turns", self.max_radian_turns)?;
        Expected::Positive.check("max_travel_m", self.max_travel_m)?;
        Expected::Range(0.0, 1.0).check("max_still_share", self.max_still_share)
    }
}
