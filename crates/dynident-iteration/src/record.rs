//! What is kept of a run.

use crate::estimate::RunEstimate;
use serde::{Deserialize, Serialize};

/// Parameters of a controller's model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "of", content = "values", rename_all = "kebab-case")]
pub enum ModelParameters {
    /// Ten for each body, then one for each term.
    All(Vec<f64>),
    /// One for each base parameter.
    Base(Vec<f64>),
}

impl ModelParameters {
    /// The values.
    pub fn values(&self) -> &[f64] {
        match self {
            Self::All(values) | Self::Base(values) => values,
        }
    }

    /// `good + share (new - good)`; `new` itself where the kinds differ.
    pub(crate) fn between(good: &Self, new: &Self, share: f64) -> Self {
        let mixed = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a + share * (b - a)).collect();
        match (good, new) {
            (Self::All(a), Self::All(b)) => Self::All(mixed(a, b)),
            (Self::Base(a), Self::Base(b)) => Self::Base(mixed(a, b)),
            _ => new.clone(),
        }
    }
}

/// What controlled a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct UsedController {
    /// The controller's name.
    pub name: String,
    /// Its model; none for controllers without.
    pub model: Option<ModelParameters>,
    /// Share of the step from the last good parameters to the new ones that was taken.
    pub damping: f64,
    /// Factor of the gains of a controller without a model.
    pub stiffness: f64,
}

/// A run, as it is kept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RunRecord {
    /// Its number, from 1.
    pub run: usize,
    /// What controlled it.
    pub controller: UsedController,
    /// Whether every trajectory was run to its end.
    pub done: bool,
    /// How it ended, in words.
    pub outcome: String,
    /// Per joint: the largest distance from the reference, rad (m).
    pub max_tracking_error_rad: Vec<f64>,
    /// Whether it counts as good.
    pub accepted: bool,
    /// Why not, or why there is no estimate.
    pub reason: Option<String>,
    /// What it says about the parameters; none if it determines nothing.
    pub estimate: Option<RunEstimate>,
}

impl RunRecord {
    /// Mean over the joints of the largest tracking error, rad (m).
    pub fn tracking_error(&self) -> f64 {
        let errors = &self.max_tracking_error_rad;
        errors.iter().sum::<f64>() / errors.len().max(1) as f64
    }
}
