//! `[estimator.physical]`: physically consistent fit and constraints on the bodies.

use dynident_estimation::consistent::PhysicalError;
use dynident_identification::consistent::ConsistencySettings;
use serde::de::value::MapAccessDeserializer;
use serde::{Deserialize, Deserializer, Serialize};

/// `true`, `false`, or a table of [`ConsistencySettings`], which implies `true`.
///
/// ```
/// use dynident_study::{EstimatorSection, PhysicalChoice};
/// let off: EstimatorSection = toml::from_str("physical = false")?;
/// assert_eq!(off.physical, PhysicalChoice::Switch(false));
/// let known: EstimatorSection = toml::from_str("[physical]\nprior = \"pullback\"\nbodies.forearm.mass_kg = [1.0, 3.0]")?;
/// assert_eq!(known.physical.settings().unwrap().bodies["forearm"].mass_kg, Some([1.0, 3.0]));
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged)]
pub enum PhysicalChoice {
    /// Physically consistent fit with the default settings, or no such fit.
    Switch(bool),
    /// Physically consistent fit with constraints on the robot.
    Known(Box<ConsistencySettings>),
}

impl Default for PhysicalChoice {
    fn default() -> Self {
        Self::Switch(true)
    }
}

impl PhysicalChoice {
    /// The settings of the fit; `None` if it is disabled.
    pub fn settings(&self) -> Option<ConsistencySettings> {
        match self {
            Self::Switch(true) => Some(ConsistencySettings::default()),
            Self::Switch(false) => None,
            Self::Known(settings) => Some((**settings).clone()),
        }
    }

    pub(crate) fn validate(&self) -> Result<(), PhysicalError> {
        self.settings().map_or(Ok(()), |settings| settings.validate())
    }
}

impl<'de> Deserialize<'de> for PhysicalChoice {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;
        // An untagged enum would not report which key of the table is wrong.
        impl<'de> serde::de::Visitor<'de> for Visitor {
            type Value = PhysicalChoice;
            fn expecting(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.write_str("true, false, or a table of constraints on the bodies")
            }
            fn visit_bool<E>(self, switch: bool) -> Result<Self::Value, E> {
                Ok(PhysicalChoice::Switch(switch))
            }
            fn visit_map<A: serde::de::MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                let settings = ConsistencySettings::deserialize(MapAccessDeserializer::new(map))?;
                Ok(PhysicalChoice::Known(Box::new(settings)))
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}
