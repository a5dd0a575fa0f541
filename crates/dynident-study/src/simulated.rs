//! `[estimator.simulated]`: simulation of the closed loop for `method = "didim"`, `"clie"` and `"cloe"`.

use dynident_estimation::{EstimationError, SimulatedSettings};
use dynident_identification::estimators::SimulationStart;
use serde::{Deserialize, Serialize};

/// Section `[estimator.simulated]`. Sampling rate, integrator, velocities and delays of the feedback, start and
/// torque limits are those of `[simulation]`; noise is not simulated.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct SimulatedSection {
    /// Start of the simulated motion; by default the candidate nearest to the recording.
    pub start: SimulationStart,
    /// The iteration ends at this length of a step, in error bars over all directions; 1e-3 by default.
    pub tolerance: f64,
    /// Maximum number of steps; 30 by default.
    pub max_iterations: usize,
    /// Step of the finite differences for CLIE and CLOE, relative to each parameter; 1e-4 by default.
    pub difference: f64,
}

impl Default for SimulatedSection {
    fn default() -> Self {
        let SimulatedSettings { tolerance, max_iterations, difference, .. } = SimulatedSettings::default();
        Self { start: SimulationStart::default(), tolerance, max_iterations, difference }
    }
}

impl SimulatedSection {
    pub(crate) fn validate(&self) -> Result<(), EstimationError> {
        let SimulatedSection { tolerance, max_iterations, difference, .. } = *self;
        let settings = SimulatedSettings { tolerance, max_iterations, difference, ..SimulatedSettings::default() };
        settings.validate()
    }
}
