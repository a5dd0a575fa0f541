//! A value for all joints, or one for each.

use crate::error::{SimulationError, require, require_length};
use serde::{Deserialize, Serialize};

/// A setting of every joint: one value for all joints, or a list with one value per joint in the order of the model.
///
/// ```
/// use dynident_simulation::PerJoint;
/// #[derive(serde::Deserialize)]
/// struct Settings { gain: PerJoint }
/// let all: Settings = toml::from_str("gain = 16.0").unwrap();
/// let each: Settings = toml::from_str("gain = [100.0, 16.0]").unwrap();
/// assert_eq!((all.gain.of(1), each.gain.of(0)), (16.0, 100.0));
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged)]
pub enum PerJoint {
    /// The same value for all joints.
    All(f64),
    /// One value for each joint.
    Each(Vec<f64>),
}

impl PerJoint {
    /// Value at `joint`.
    ///
    /// # Panics
    /// If a list has no such entry; [`values`](Self::values) checks the length.
    pub fn of(&self, joint: usize) -> f64 {
        match self {
            Self::All(value) => *value,
            Self::Each(values) => values[joint],
        }
    }

    /// Values of a number of joints.
    ///
    /// # Errors
    /// A list of the wrong length, or a value for which `holds` is false.
    pub fn values(
        &self,
        what: &str,
        joints: usize,
        fix: &'static str,
        holds: impl Fn(f64) -> bool,
    ) -> Result<Vec<f64>, SimulationError> {
        if let Self::Each(values) = self {
            require_length(what, joints, values.len())?;
        }
        let values: Vec<f64> = (0..joints).map(|joint| self.of(joint)).collect();
        for &value in &values {
            require(holds(value), what, value, fix)?;
        }
        Ok(values)
    }

    /// Values of a number of joints, which must be finite and not negative.
    pub(crate) fn gains(&self, what: &str, joints: usize) -> Result<Vec<f64>, SimulationError> {
        self.values(what, joints, "give zero or a finite positive number", |x| x >= 0.0 && x.is_finite())
    }
}

impl From<f64> for PerJoint {
    fn from(value: f64) -> Self {
        Self::All(value)
    }
}

impl From<Vec<f64>> for PerJoint {
    fn from(values: Vec<f64>) -> Self {
        Self::Each(values)
    }
}
