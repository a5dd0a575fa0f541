//! What is kept of a run.

use crate::estimate::RunEstimate;
use crate::model_parameters::ModelParameters;
use serde::{Deserialize, Serialize};

/// What controlled a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
