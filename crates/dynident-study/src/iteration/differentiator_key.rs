//! `differentiator` of `[iteration]`: a method for velocities and accelerations, or `"auto"`.

use dynident_recording::DifferentiatorSettings;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

/// The word `"auto"`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Automatic {
    /// Each run uses the method with the smallest torque residual.
    Auto,
}

/// Method for velocities and accelerations from positions.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged)]
pub enum DifferentiatorKey {
    /// The method is selected in each run.
    Automatic(Automatic),
    /// The given method.
    Stated(DifferentiatorSettings),
}

impl<'de> Deserialize<'de> for DifferentiatorKey {
    // This is written by hand, because an untagged enum loses the error of the inner key.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct KeyVisitor;
        impl<'de> Visitor<'de> for KeyVisitor {
            type Value = DifferentiatorKey;

            fn expecting(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                formatter.write_str("\"auto\" or a table with `method`")
            }

            fn visit_str<E: Error>(self, word: &str) -> Result<Self::Value, E> {
                match word {
                    "auto" => Ok(DifferentiatorKey::Automatic(Automatic::Auto)),
                    other => Err(E::invalid_value(serde::de::Unexpected::Str(other), &self)),
                }
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                DifferentiatorSettings::deserialize(MapAccessDeserializer::new(map)).map(DifferentiatorKey::Stated)
            }
        }
        deserializer.deserialize_any(KeyVisitor)
    }
}
