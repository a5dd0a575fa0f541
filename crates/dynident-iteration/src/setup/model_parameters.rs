use serde::{Deserialize, Serialize};

/// Parameters of a controller's model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "of", content = "values", rename_all = "kebab-case")]
pub enum ModelParameters {
    /// All parameters: ten per body, then one per term.
    All(Vec<f64>),
    /// One value per base parameter.
    Base(Vec<f64>),
}

impl ModelParameters {
    /// The values.
    pub fn values(&self) -> &[f64] {
        match self {
            Self::All(values) | Self::Base(values) => values,
        }
    }

    /// Parameters between two sets: `good + share (new - good)`; `new` if the sets are of different kinds.
    pub(crate) fn between(good: &Self, new: &Self, share: f64) -> Self {
        let mixed = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a + share * (b - a)).collect();
        match (good, new) {
            (Self::All(a), Self::All(b)) => Self::All(mixed(a, b)),
            (Self::Base(a), Self::Base(b)) => Self::Base(mixed(a, b)),
            _ => new.clone(),
        }
    }
}
