//! Factors on the limits of all joints.

use super::error::LimitError;
use super::numbers::positive;
use serde::{Deserialize, Serialize};

/// Factors on the limits of all joints from the robot description and on assumed accelerations, above 0 and at most
/// 1. In a study they are one number (`scale = 0.8`) or a table (`scale = { speed = 0.8, torque = 0.5 }`).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(from = "Stated")]
pub struct LimitScale {
    /// Factor on maximum velocities.
    pub speed: f64,
    /// Factor on maximum accelerations.
    pub acceleration: f64,
    /// Factor on maximum torques.
    pub torque: f64,
}

/// The two notations in a study file.
#[derive(Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged)]
enum Stated {
    All(f64),
    Each(Factors),
}

#[derive(Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
struct Factors {
    speed: f64,
    acceleration: f64,
    torque: f64,
}

impl Default for Factors {
    fn default() -> Self {
        Self { speed: 1.0, acceleration: 1.0, torque: 1.0 }
    }
}

impl From<Stated> for LimitScale {
    fn from(stated: Stated) -> Self {
        match stated {
            Stated::All(all) => Self { speed: all, acceleration: all, torque: all },
            Stated::Each(Factors { speed, acceleration, torque }) => Self { speed, acceleration, torque },
        }
    }
}

impl Default for LimitScale {
    fn default() -> Self {
        Self { speed: 1.0, acceleration: 1.0, torque: 1.0 }
    }
}

impl LimitScale {
    /// Whether nothing is scaled.
    pub fn is_one(&self) -> bool {
        *self == Self::default()
    }

    /// # Errors
    /// A factor that is not above 0 and at most 1.
    pub(super) fn validate(&self) -> Result<(), LimitError> {
        for (name, factor) in [("speed", self.speed), ("acceleration", self.acceleration), ("torque", self.torque)] {
            let what = format!("the factor on all limits of {name} (scale)");
            positive(&what, factor)?;
            if factor > 1.0 {
                return Err(LimitError::AboveOne { what, value: factor });
            }
        }
        Ok(())
    }
}
