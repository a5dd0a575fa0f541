//! `differentiator` of `[iteration]`: a way from positions to velocities and accelerations, or `"auto"`.

use dynident_recording::DifferentiatorSettings;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

/// The word `"auto"`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Automatic {
    /// Each run takes the way that leaves the least of its torques.
    Auto,
}

/// From positions to velocities and accelerations.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged)]
pub enum DifferentiatorKey {
    /// Chosen by each run.
    Automatic(Automatic),
    /// As stated.
    Stated(DifferentiatorSettings),
}

impl<'de> Deserialize<'de> for DifferentiatorKey {
    // By hand, for an untagged enum says of a mistake only that nothing fits.
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
