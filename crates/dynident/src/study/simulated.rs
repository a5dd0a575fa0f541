//! `[estimator.simulated]`: how the loop is simulated for `method = "didim"`, `"clie"` and `"cloe"`.

use dynident_estimation::{EstimationError, SimulatedSettings};
use dynident_identification::estimators::SimulationStart;
use serde::{Deserialize, Serialize};

/// `[estimator.simulated]`. Rate, integrator, velocities and delays of the feedback, start and torque limits of the
/// loop are those of `[simulation]`; noise is not simulated.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct SimulatedSection {
    /// Where the iteration begins; at what is nearer to the record by default.
    pub start: SimulationStart,
    /// Length of a step, in error bars over all directions, at which the iteration ends; 1e-3 by default.
    pub tolerance: f64,
    /// Most steps; 30 by default.
    pub max_iterations: usize,
    /// Step of the differences of CLIE and CLOE, relative to each parameter's size; 1e-4 by default.
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
