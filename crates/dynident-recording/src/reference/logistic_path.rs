//! Spliced logistic function: a path on which the position determines velocity and acceleration.

use super::stroke::{Stroke, share_rests};
use crate::error::FilterError;
use serde::{Deserialize, Serialize};

/// The spliced logistic function of one joint, a motion there and back:
///
/// `q(t) = h + A/(1 + e^-(ω rem(t, T) - ωT/4))` in the first half of each period, `h + A/(1 + e^(ω rem(t, T) - 3ωT/4))`
/// in the second;
///
/// After the last period the joint is at its initial position. A joint with A = 0 does not move. Source: *Iterative
/// Identification of Robot Dynamic Parameters Based on Logistic Function*, Eqs. 12 to 14.
///
/// ```
/// let path: dynident_recording::LogisticPath =
///     toml::from_str("amplitude = 2.0\nomega = 1.0\noffset = 0.5\nperiod_s = 40.0").unwrap();
/// let [q, dq, ddq] = path.at(10.0); // half-way there
/// assert_eq!((q, dq, ddq), (1.5, 0.5, 0.0)); // h + A/2, Aω/4
/// assert_eq!(path.rates(1.5, true), Some([0.5, 0.0]));
/// assert_eq!(path.rates(2.6, true), None); // outside the stroke
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct LogisticPath {
    /// Amplitude A, rad (m).
    pub amplitude: f64,
    /// Steepness ω, 1/s.
    pub omega: f64,
    /// Offset h, rad (m).
    pub offset: f64,
    /// Period T of the motion there and back, s.
    pub period_s: f64,
    /// Number of periods; 1 by default.
    #[serde(default = "one")]
    pub repetitions: u32,
}

fn one() -> u32 {
    1
}

impl LogisticPath {
    /// Checks the parameters.
    ///
    /// # Errors
    /// [`FilterError::Reference`]: values that are not finite, ω or T not positive, ωT below 20 (the strokes would end
    /// with 1 % of the peak velocity) or above 1e4, repetitions not 1 to 1000.
    pub fn validate(&self) -> Result<(), FilterError> {
        let wrong = |problem: String| Err(FilterError::Reference { problem });
        let Self { amplitude, omega, offset, period_s, repetitions } = *self;
        if ![amplitude, omega, offset, period_s].iter().all(|x| x.is_finite() && x.abs() <= 1e6) {
            return wrong("amplitude, omega, offset and period_s must be finite numbers, at most 1e6".to_owned());
        }
        if !(omega > 0.0 && period_s > 0.0) {
            return wrong(format!("omega = {omega} and period_s = {period_s}: both must be positive"));
        }
        if !(20.0..=1e4).contains(&(omega * period_s)) {
            return wrong(format!("omega · period_s = {}: give 20 to 1e4 (the paper has about 40)", omega * period_s));
        }
        if !(1..=1000).contains(&repetitions) {
            return wrong(format!("repetitions = {repetitions}: give 1 to 1000"));
        }
        Ok(())
    }

    /// Position q, velocity dq and acceleration ddq at a time after the start, s. The joint is at rest before the start
    /// and after the last period.
    pub fn at(&self, time_s: f64) -> [f64; 3] {
        let end = f64::from(self.repetitions) * self.period_s;
        if !(time_s >= 0.0 && time_s < end) {
            // The initial position differs slightly from the asymptote h.
            return [self.on(-0.25 * self.period_s * self.omega, 1.0)[0], 0.0, 0.0];
        }
        let rest = time_s.rem_euclid(self.period_s);
        if rest < 0.5 * self.period_s {
            self.on(self.omega * (rest - 0.25 * self.period_s), 1.0)
        } else {
            self.on(self.omega * (0.75 * self.period_s - rest), -1.0)
        }
    }

    /// Position q, velocity dq and acceleration ddq for an argument of the logistic function and a direction.
    fn on(&self, argument: f64, sign: f64) -> [f64; 3] {
        let e = (-argument.abs()).exp();
        let d = 1.0 / (1.0 + e);
        let (value, bell) = (if argument >= 0.0 { d } else { e * d }, e * d * d);
        let slope = if argument >= 0.0 { (e - 1.0) * d } else { (1.0 - e) * d };
        [
            self.offset + self.amplitude * value,
            sign * self.amplitude * self.omega * bell,
            self.amplitude * self.omega * self.omega * bell * slope,
        ]
    }

    /// Velocity and acceleration from the position (Eqs. 15 and 16 of the same source):
    /// `dq = ±(ω/A)(q - h)(A - q + h)`, with the positive sign if `there` is true,
    /// `ddq = (ω²/A²)(q - h)(A - q + h)(A - 2q + 2h)`. `None` for positions outside the stroke, for which the formulas
    /// have the wrong sign.
    pub fn rates(&self, q: f64, there: bool) -> Option<[f64; 2]> {
        let Self { amplitude, omega, offset, .. } = *self;
        let (gone, left) = (q - offset, amplitude - (q - offset));
        let share = gone / amplitude;
        if !(share > 0.0 && share < 1.0) {
            return None;
        }
        let dq = omega / amplitude * gone * left;
        let ddq = omega * omega / (amplitude * amplitude) * gone * left * (left - gone);
        Some([if there { dq } else { -dq }, ddq])
    }

    /// Whether the joint moves there (not back) at a time, which determines the sign in Eq. 15.
    pub fn goes_there(&self, time_s: f64) -> bool {
        time_s.rem_euclid(self.period_s) < 0.5 * self.period_s
    }

    /// Peak velocity |A|ω/4 and peak acceleration |A|ω²/(6√3).
    pub(crate) fn peaks(&self) -> [f64; 2] {
        let size = self.amplitude.abs() * self.omega;
        [0.25 * size, size * self.omega / (6.0 * 3.0_f64.sqrt())]
    }

    /// Two strokes per period; empty if A = 0. A stroke contains the times at which the velocity is above 1e-3 of its
    /// peak: up to ln(4000)/ω from its middle.
    pub(crate) fn strokes(&self) -> Vec<Stroke> {
        if self.amplitude == 0.0 {
            return Vec::new();
        }
        let half = (4000.0_f64.ln() / self.omega).min(0.25 * self.period_s);
        let mut strokes: Vec<Stroke> = (0..2 * self.repetitions)
            .map(|k| {
                let middle = (0.25 + 0.5 * f64::from(k)) * self.period_s;
                Stroke {
                    owns_from_s: f64::NEG_INFINITY,
                    owns_to_s: f64::INFINITY,
                    from_s: middle - half,
                    to_s: middle + half,
                    monotone: true,
                }
            })
            .collect();
        share_rests(&mut strokes);
        strokes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Table 3, joint 2, with T = 40/ω.
    const PATH: LogisticPath =
        LogisticPath { amplitude: 2.094, omega: 0.996, offset: -0.3, period_s: 40.0 / 0.996, repetitions: 2 };

    #[test]
    fn velocity_and_acceleration_equal_the_derivatives_and_the_map() {
        let h = 1e-4;
        for i in 1..800 {
            let t = f64::from(i) * 0.1 + 0.013;
            let [q, dq, ddq] = PATH.at(t);
            let half = 0.5 * PATH.period_s;
            // Not across a splice, where the velocity changes its sign.
            if (t.rem_euclid(half) < 2.0 * h) || (half - t.rem_euclid(half) < 2.0 * h) {
                continue;
            }
            // Central differences: h²ω³A/6 = 3e-9 and rounding of 1e-16/h, 1e-16/h².
            assert!((dq - (PATH.at(t + h)[0] - PATH.at(t - h)[0]) / (2.0 * h)).abs() < 1e-8, "{t}");
            assert!((ddq - (PATH.at(t + h)[1] - PATH.at(t - h)[1]) / (2.0 * h)).abs() < 1e-8, "{t}");
            let [map_dq, map_ddq] = PATH.rates(q, PATH.goes_there(t)).unwrap();
            // Rounding of q, times ω and ω².
            assert!((map_dq - dq).abs() < 1e-14 && (map_ddq - ddq).abs() < 1e-14, "{t}");
        }
        assert_eq!(PATH.at(-1.0), PATH.at(1e3));
        assert_eq!(PATH.strokes().len(), 4);
    }

    #[test]
    fn bad_paths_are_refused() {
        let with = |change: fn(&mut LogisticPath)| {
            let mut path = PATH;
            change(&mut path);
            path.validate()
        };
        assert!(with(|_| {}).is_ok());
        assert!(with(|path| path.omega = 0.0).is_err());
        assert!(with(|path| path.amplitude = f64::NAN).is_err());
        assert!(with(|path| path.period_s = 10.0).is_err());
        assert!(with(|path| path.repetitions = 0).is_err());
    }
}
