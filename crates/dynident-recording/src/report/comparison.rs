//! Comparison of a logged velocity or acceleration with the derivative of the position.

use super::lag::{Lag, best_lag};
use super::settings::ReportSettings;
use crate::log::{Quantity, si_factor};
use serde::{Deserialize, Serialize};

const MAX_LAG_SAMPLES: usize = 1 << 13;

/// Comparison of a logged velocity (or acceleration) with the derivative of the position, after the same filter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DerivativeComparison {
    /// Joint name.
    pub joint: String,
    /// RMS of the difference divided by the RMS of the derivative of the position.
    pub relative_rms_difference: f64,
    /// Correlation `Σ a b / √(Σ a² Σ b²)` of the derivative a and the logged signal b over the whole log, -1 to 1;
    /// close to -1 if the sign is reversed. The means are not subtracted, so a joint at constant velocity is also used,
    /// and fast samples have more weight. Zero if one of the signals is zero.
    #[serde(default)]
    pub correlation: f64,
    /// Factor `Σ a b / Σ a²` from the derivative a to the logged signal b; `None` if the derivative is negligible, as
    /// for a dead position.
    #[serde(default)]
    pub ratio: Option<f64>,
    /// Time by which the logged signal is later than the derivative, in the piece where the derivative varies most.
    pub lag: Option<Lag>,
}

/// Power of the derivative, as a share of the logged signal's power, below which the derivative is negligible.
const NEGLIGIBLE_POWER_SHARE: f64 = 1e-12;
/// Units of velocity that are often mistaken for rad/s.
const COMMON_UNITS: [&str; 2] = ["deg/s", "rpm"];

impl DerivativeComparison {
    /// Factor from the derivative to the logged signal, if the two are proportional and the factor differs from 1.
    pub(crate) fn times(&self, limits: &ReportSettings) -> Option<f64> {
        let is_other = |ratio: &f64| *ratio > 0.0 && ratio.ln().abs() > limits.min_log_factor;
        self.ratio.filter(is_other).filter(|_| self.correlation > limits.proportional_correlation)
    }

    /// Explains in words why a logged velocity is `times` the derivative, in a log at `rate_hz`.
    pub(crate) fn describe_velocity(times: f64, rate_hz: f64, limits: &ReportSettings) -> String {
        let is_it = |unit: &&str| {
            si_factor(unit, Quantity::Velocity).is_some_and(|si| (times * si - 1.0).abs() < limits.unit_tolerance)
        };
        match COMMON_UNITS.into_iter().find(is_it) {
            Some(unit) => format!(
                "is {times:.4} times the position's derivative throughout: set `unit = \"{unit}\"` under velocity"
            ),
            None => format!(
                "is {times:.4} times the position's derivative throughout: it has another unit, or, if this applies to \
                 every joint, the rate is {:.4} Hz instead of {rate_hz:.4}",
                times * rate_hz
            ),
        }
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Comparison {
    joint: String,
    difference: f64,
    power: f64,
    logged_power: f64,
    product: f64,
    /// Sum of the squared deviations of the derivative from its mean, over the kept samples.
    variation: f64,
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
            variation: 0.0,
            derived: Vec::new(),
            logged: Vec::new(),
        }
    }

    pub(crate) fn add(&mut self, derived: &[f64], logged: &[f64]) {
        for (derived, logged) in derived.iter().zip(logged) {
            self.difference += (derived - logged).powi(2);
            self.power += derived * derived;
            self.logged_power += logged * logged;
            self.product += derived * logged;
        }
        // Only one piece is used, because a lag across a gap is undefined: the piece with the largest variation.
        let some = &derived[..derived.len().min(MAX_LAG_SAMPLES)];
        let mean = some.iter().sum::<f64>() / some.len().max(1) as f64;
        let variation: f64 = some.iter().map(|x| (x - mean).powi(2)).sum();
        if self.derived.is_empty() || variation > self.variation {
            self.variation = variation;
            self.derived = some.to_vec();
            self.logged = logged[..some.len()].to_vec();
        }
    }

    /// Result of the comparison. The lag is searched within one period of the cut-off; a longer lag would belong to
    /// another motion.
    pub(crate) fn report(&self, rate_hz: f64, cutoff_hz: f64) -> DerivativeComparison {
        let is_valid = self.power > NEGLIGIBLE_POWER_SHARE * self.logged_power;
        let difference = if is_valid { (self.difference / self.power).sqrt() } else { 0.0 };
        let reach = ((rate_hz / cutoff_hz).ceil() as usize).clamp(3, 100).min(self.derived.len() / 4);
        DerivativeComparison {
            joint: self.joint.clone(),
            correlation: {
                let correlation = self.product / (self.power * self.logged_power).sqrt();
                if correlation.is_finite() { correlation } else { 0.0 }
            },
            ratio: Some(self.product / self.power).filter(|ratio| is_valid && ratio.is_finite()),
            relative_rms_difference: if difference.is_finite() { difference } else { 0.0 },
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
            comparison.add(derived, logged);
        }
        comparison.report(1000.0, 10.0)
    }

    /// Velocities in another unit, or of a log with a wrong rate, are proportional to the derivative; noise and the
    /// derivative of a dead position are not.
    #[test]
    fn another_unit_is_distinguished_from_noise() {
        let swing = |times: f64| -> (Vec<f64>, Vec<f64>) {
            (0..2000).map(|i| (f64::from(i) * 0.01).sin()).map(|x| (x, times * x)).unzip()
        };
        for (times, words) in
            [(9.5493, "unit = \"rpm\""), (57.3, "unit = \"deg/s\""), (1.25, "the rate is 125.0000 Hz")]
        {
            let found = compared(&[swing(times)]).times(&ReportSettings::default()).unwrap();
            assert!((found / times - 1.0).abs() < 1e-9);
            let message = DerivativeComparison::describe_velocity(found, 100.0, &ReportSettings::default());
            assert!(message.contains(words), "{message}");
        }
        assert_eq!(compared(&[swing(1.02)]).times(&ReportSettings::default()), None);
        let noisy: Vec<f64> = (0..2000).map(|i| (f64::from(i) * f64::from(i) * 0.37).sin()).collect();
        assert_eq!(compared(&[(swing(1.0).0, noisy.clone())]).times(&ReportSettings::default()), None);
        let dead = compared(&[(vec![1e-17; 2000], noisy)]);
        assert_eq!((dead.ratio, dead.relative_rms_difference), (None, 0.0));
    }

    /// The short first piece has a nearly constant velocity, so that noise determines the sign of a centred
    /// correlation.
    #[test]
    fn a_piece_at_constant_velocity_does_not_reverse_the_sign() {
        let wobble = |i: usize| 1e-3 * (i as f64 * 0.7).sin();
        let steady: (Vec<f64>, Vec<f64>) = (0..357).map(|i| (0.5 + wobble(i), 0.5 - wobble(i))).unzip();
        let swing: (Vec<f64>, Vec<f64>) = (0..5000).map(|i| (f64::from(i) * 0.01).sin()).map(|x| (x, x + 0.02)).unzip();
        let found = compared(&[steady.clone(), swing.clone()]);
        assert!(found.correlation > 0.99 && found.lag.is_some_and(|lag| lag.correlation > 0.99), "{found:?}");
        // The piece alone has a correlation of the same sign, and its mirror image one of the opposite sign.
        assert!(compared(core::slice::from_ref(&steady)).correlation > 0.99);
        let reversed = (swing.0, swing.1.iter().map(|x| -x).collect());
        assert!(compared(&[(steady.0, steady.1.iter().map(|x| -x).collect()), reversed]).correlation < -0.99);
        assert_eq!(compared(&[]).correlation, 0.0);
    }
}
