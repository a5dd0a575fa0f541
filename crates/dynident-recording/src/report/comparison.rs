//! A logged derivative against the derivative of the position.

use super::lag::{Lag, best_lag};
use serde::{Deserialize, Serialize};

/// Samples kept for the lag.
const KEPT: usize = 1 << 13;

/// How a logged velocity (or acceleration) relates to the derivative of the position, both filtered alike.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DerivativeComparison {
    /// The joint.
    pub joint: String,
    /// RMS of the difference over the RMS of the derivative of the position.
    pub relative_rms_difference: f64,
    /// Shift of the logged signal behind the derivative; its correlation is negative if the sign is reversed.
    pub lag: Option<Lag>,
}

/// Accumulates a [`DerivativeComparison`].
#[derive(Clone, Debug)]
pub(crate) struct Comparison {
    joint: String,
    difference: f64,
    power: f64,
    derived: Vec<f64>,
    logged: Vec<f64>,
}

impl Comparison {
    pub(crate) fn new(joint: &str) -> Self {
        Self { joint: joint.to_owned(), difference: 0.0, power: 0.0, derived: Vec::new(), logged: Vec::new() }
    }

    pub(crate) fn see(&mut self, derived: &[f64], logged: &[f64]) {
        for (derived, logged) in derived.iter().zip(logged) {
            self.difference += (derived - logged).powi(2);
            self.power += derived * derived;
        }
        // One piece, as a lag across a seam means nothing.
        if self.derived.is_empty() {
            self.derived.extend(derived.iter().take(KEPT));
            self.logged.extend(logged.iter().take(KEPT));
        }
    }

    pub(crate) fn report(&self, rate_hz: f64) -> DerivativeComparison {
        let ratio = (self.difference / self.power).sqrt();
        let reach = ((0.1 * rate_hz).ceil() as usize).clamp(3, 100).min(self.derived.len() / 4);
        DerivativeComparison {
            joint: self.joint.clone(),
            relative_rms_difference: if ratio.is_finite() { ratio } else { 0.0 },
            lag: best_lag(&self.derived, &self.logged, reach, rate_hz),
        }
    }
}
