//! A logged derivative against the derivative of the position.

use super::lag::{Lag, best_lag};
use serde::{Deserialize, Serialize};

/// Samples kept for the lag, at most.
const KEPT: usize = 1 << 13;

/// How a logged velocity (or acceleration) relates to the derivative of the position, both filtered alike.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DerivativeComparison {
    /// The joint.
    pub joint: String,
    /// RMS of the difference over the RMS of the derivative of the position.
    pub relative_rms_difference: f64,
    /// `Σ a b / √(Σ a² Σ b²)` of derivative a and logged signal b over the whole log, -1 to 1: close to -1 if the sign
    /// is reversed. Not centred, so that a joint at constant velocity says as much as one that swings, and samples
    /// count by how fast they are. Zero where either signal is.
    #[serde(default)]
    pub correlation: f64,
    /// Shift of the logged signal behind the derivative, where the derivative varies most.
    pub lag: Option<Lag>,
}

/// Accumulates a [`DerivativeComparison`].
#[derive(Clone, Debug)]
pub(crate) struct Comparison {
    joint: String,
    difference: f64,
    power: f64,
    logged_power: f64,
    product: f64,
    /// How much the derivative varies over the samples that are kept.
    varies: f64,
    derived: Vec<f64>,
    logged: Vec<f64>,
}

impl Comparison {
    pub(crate) fn new(joint: &str) -> Self {
        Self {
            joint: joint.to_owned(),
            difference: 0.0,
            power: 0.0,
            logged_power: 0.0,
            product: 0.0,
            varies: 0.0,
            derived: Vec::new(),
            logged: Vec::new(),
        }
    }

    /// Samples of one piece.
    pub(crate) fn see(&mut self, derived: &[f64], logged: &[f64]) {
        for (derived, logged) in derived.iter().zip(logged) {
            self.difference += (derived - logged).powi(2);
            self.power += derived * derived;
            self.logged_power += logged * logged;
            self.product += derived * logged;
        }
        // One piece, as a lag across a seam means nothing: the one that tells most.
        let some = &derived[..derived.len().min(KEPT)];
        let mean = some.iter().sum::<f64>() / some.len().max(1) as f64;
        let varies: f64 = some.iter().map(|x| (x - mean).powi(2)).sum();
        if self.derived.is_empty() || varies > self.varies {
            self.varies = varies;
            self.derived = some.to_vec();
            self.logged = logged[..some.len()].to_vec();
        }
    }

    /// The lag is looked for within a period of the cut-off: what is later is none of this motion.
    pub(crate) fn report(&self, rate_hz: f64, cutoff_hz: f64) -> DerivativeComparison {
        let ratio = (self.difference / self.power).sqrt();
        let reach = ((rate_hz / cutoff_hz).ceil() as usize).clamp(3, 100).min(self.derived.len() / 4);
        DerivativeComparison {
            joint: self.joint.clone(),
            correlation: {
                let correlation = self.product / (self.power * self.logged_power).sqrt();
                if correlation.is_finite() { correlation } else { 0.0 }
            },
            relative_rms_difference: if ratio.is_finite() { ratio } else { 0.0 },
            lag: best_lag(&self.derived, &self.logged, reach, rate_hz),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn compared(pieces: &[(Vec<f64>, Vec<f64>)]) -> DerivativeComparison {
        let mut comparison = Comparison::new("arm");
        for (derived, logged) in pieces {
            comparison.see(derived, logged);
        }
        comparison.report(1000.0, 10.0)
    }

    /// A short first piece at nearly constant velocity, in which noise decides the sign of a centred correlation.
    #[test]
    fn a_piece_at_constant_velocity_does_not_speak_for_the_log() {
        let wobble = |i: usize| 1e-3 * (i as f64 * 0.7).sin();
        let steady: (Vec<f64>, Vec<f64>) = (0..357).map(|i| (0.5 + wobble(i), 0.5 - wobble(i))).unzip();
        let swing: (Vec<f64>, Vec<f64>) = (0..5000).map(|i| (f64::from(i) * 0.01).sin()).map(|x| (x, x + 0.02)).unzip();
        let found = compared(&[steady.clone(), swing.clone()]);
        assert!(found.correlation > 0.99 && found.lag.is_some_and(|lag| lag.correlation > 0.99), "{found:?}");
        // Alone it says the same, and its mirror the opposite.
        assert!(compared(core::slice::from_ref(&steady)).correlation > 0.99);
        let reversed = (swing.0, swing.1.iter().map(|x| -x).collect());
        assert!(compared(&[(steady.0, steady.1.iter().map(|x| -x).collect()), reversed]).correlation < -0.99);
        assert_eq!(compared(&[]).correlation, 0.0);
    }
}
