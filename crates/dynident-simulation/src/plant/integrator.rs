//! Selection and settings of the integrator.

use crate::error::{SimulationError, require};
use serde::{Deserialize, Serialize};

/// Integration of the simulated robot between two controller samples, with constant torque.
///
/// ```
/// use dynident_simulation::Integrator;
/// #[derive(serde::Deserialize)]
/// struct Settings { integrator: Integrator }
/// let settings: Settings = toml::from_str("integrator = { kind = \"rk4\", steps_per_sample = 2 }").unwrap();
/// assert_eq!(settings.integrator, Integrator::Rk4 { steps_per_sample: 2 });
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Integrator {
    /// Semi-implicit Euler with implicit friction: order 1, without chatter. If viscous friction is the only
    /// friction, it equals MuJoCo's `Euler`.
    SemiImplicitEuler {
        /// Number of equal steps between samples; default 1.
        #[serde(default = "one")]
        steps_per_sample: usize,
    },
    /// Runge-Kutta of order 4 with explicit friction; it stops where a joint comes to rest. Without friction it
    /// equals MuJoCo's `RK4`. Friction that changes steeply with velocity needs short steps: the step length times
    /// the slope of friction divided by the joint's inertia must be below 2.7.
    Rk4 {
        /// Number of equal steps between samples; default 1.
        #[serde(default = "one")]
        steps_per_sample: usize,
    },
    /// Runge-Kutta of order 8(5,3) with error control.
    Adaptive {
        /// Relative tolerance of a step; default 1e-10.
        #[serde(default = "tight")]
        relative_tolerance: f64,
        /// Absolute tolerance of a step, rad and rad/s; default 1e-10.
        #[serde(default = "tight")]
        absolute_tolerance: f64,
    },
}

fn one() -> usize {
    1
}

fn tight() -> f64 {
    1e-10
}

impl Default for Integrator {
    fn default() -> Self {
        Self::SemiImplicitEuler { steps_per_sample: one() }
    }
}

impl Integrator {
    /// Checks the settings.
    ///
    /// # Errors
    /// No steps or more than 10,000, tolerances outside 1e-14 to 0.1.
    pub fn validate(&self) -> Result<(), SimulationError> {
        match *self {
            Self::SemiImplicitEuler { steps_per_sample } | Self::Rk4 { steps_per_sample } => require(
                (1..=10_000).contains(&steps_per_sample),
                "integrator.steps_per_sample",
                steps_per_sample as f64,
                "give 1 to 10000",
            ),
            Self::Adaptive { relative_tolerance, absolute_tolerance } => {
                for (what, value) in [
                    ("integrator.relative_tolerance", relative_tolerance),
                    ("integrator.absolute_tolerance", absolute_tolerance),
                ] {
                    require((1e-14..=0.1).contains(&value), what, value, "give 1e-14 to 0.1")?;
                }
                Ok(())
            }
        }
    }
}
