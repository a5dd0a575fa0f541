//! The error bar of a parameter by source.

use super::numbers::number;
use dynident_identification::ErrorSource;
use serde::{Deserialize, Serialize};

/// Contribution of one error source to a parameter's error bar.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ErrorTermResult {
    /// The source.
    pub source: ErrorSource,
    /// Standard deviation, in the parameter's unit.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub std: f64,
}

impl ErrorTermResult {
    /// Name of the source.
    pub fn name(&self) -> &'static str {
        match self.source {
            ErrorSource::Noise => "noise",
            ErrorSource::Lag => "lag",
            ErrorSource::LogVariation => "differences between logs",
            ErrorSource::FrictionConstants => "friction constants",
            ErrorSource::Gains => "drive gains",
            ErrorSource::NominalValues => "nominal values",
        }
    }
}
