//! `[estimator.simulated]`: how the loop is simulated for `method = "didim"`, `"clie"` and `"cloe"`.

use super::{EstimatorMethod, EstimatorSection};
use dynident_estimation::{SimulatedCriterion, SimulatedSettings};
use serde::{Deserialize, Serialize};

/// Where the iteration begins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SimulationStart {
    /// At the one of the two below whose simulation is nearer to the record; at the other if that leads nowhere.
    #[default]
    Nearer,
    /// The possible machine that fits the measured rows best: a simulation with negative masses would get nowhere.
    Estimate,
    /// The robot's description.
    Description,
}

/// `[estimator.simulated]`. Rate, integrator, speeds and delays of the feedback, start and torque limits of the loop are those of `[simulation]`; noise is not simulated.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
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
    /// The estimator's settings.
    pub(crate) fn settings(&self, section: &EstimatorSection) -> SimulatedSettings {
        SimulatedSettings {
            criterion: match section.method {
                EstimatorMethod::Clie | EstimatorMethod::Cloe => SimulatedCriterion::Output,
                _ => SimulatedCriterion::Didim,
            },
            rank: section.rank,
            tolerance: self.tolerance,
            max_iterations: self.max_iterations,
            difference: self.difference,
        }
    }

    pub(crate) fn validate(&self, section: &EstimatorSection) -> Result<(), String> {
        self.settings(section).validate().map_err(|error| error.to_string())
    }
}
