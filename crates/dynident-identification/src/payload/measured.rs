//! A value with its error bar.

use serde::{Deserialize, Serialize};

/// A value with its error bar.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Measured {
    /// Value.
    pub value: f64,
    /// Standard deviation.
    pub std: f64,
    /// Half width of the 95 % interval.
    pub half_width_95: f64,
}
