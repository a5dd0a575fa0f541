//! Which parameters of a known arm are fitted again together with a payload.

use serde::{Deserialize, Serialize};

/// What of a known arm is fitted again, beside the payload.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Refit {
    /// Nothing.
    #[default]
    Nothing,
    /// The joints' offsets.
    Offset,
    /// Offsets and friction: both change with the temperature from run to run.
    Friction,
}
