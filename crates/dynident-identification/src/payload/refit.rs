use serde::{Deserialize, Serialize};

/// Parameters of a known arm that are fitted again together with the payload.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Refit {
    /// No parameters.
    #[default]
    Nothing,
    /// The torque offsets of the joints.
    Offset,
    /// Torque offsets and friction, which change with temperature from run to run.
    Friction,
}
