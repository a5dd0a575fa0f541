//! Logistic stroke of one joint: condition number of the windows around its mid-points, and its limits.
//!
//! *Iterative Identification of Robot Dynamic Parameters Based on Logistic Function*, equations 7 to 10 and 14 to 19,
//! Fig. 6.

use super::singular_values::Singular3;
use crate::optimisers::OptimiserError;
use serde::{Deserialize, Serialize};

/// Variables of one joint: the stroke of equation 14 with h = 0, and the window of Fig. 6.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stroke {
    /// Amplitude A, rad.
    pub amplitude_rad: f64,
    /// Steepness ω, 1/s.
    pub steepness_per_s: f64,
    /// Half width δ of the window around a mid-point, s.
    pub window_s: f64,
}

impl Stroke {
    pub(super) fn of(x: &[f64]) -> Self {
        Self { amplitude_rad: x[0], steepness_per_s: x[1], window_s: x[2] }
    }

    /// Position and acceleration at `t_s` after the mid-point of the rising stroke: q = A f(ωt), q̈ = A ω² f''(ωt),
    /// f = 1/(1 + e⁻ᶻ) (equations 14 and 16). rad, rad/s².
    pub fn position_and_acceleration(&self, t_s: f64) -> (f64, f64) {
        let f = 1.0 / (1.0 + (-self.steepness_per_s * t_s).exp());
        let amplitude = self.amplitude_rad;
        (amplitude * f, amplitude * self.steepness_per_s.powi(2) * f * (1.0 - f) * (1.0 - 2.0 * f))
    }
}

/// Quantities that equations 17 and 18 limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum StrokeQuantity {
    /// Maximum position, A/(1 + e^(-ωT/4)), in rad. The minimum position of every stroke is above zero.
    Position,
    /// Peak velocity A ω/4, in rad/s.
    Speed,
    /// Peak acceleration A ω²/(6√3), in rad/s².
    Acceleration,
    /// Velocity at start, splice and end, in rad/s.
    RestSpeed,
    /// Acceleration at start, splice and end, in rad/s².
    RestAcceleration,
}

/// A limit, and the peak of the limited quantity on a stroke.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StrokeLimit {
    /// Limited quantity.
    pub quantity: StrokeQuantity,
    /// Peak on the whole stroke.
    pub value: f64,
    /// The limit.
    pub limit: f64,
}

impl StrokeLimit {
    /// Whether the limit is kept.
    pub fn kept(&self) -> bool {
        self.value < self.limit
    }

    /// Relative excess over the limit: 0.68 for 68 % too much, negative inside.
    pub fn excess(&self) -> f64 {
        self.value / self.limit - 1.0
    }

    /// The excess with a margin of 1e-6, and zero inside the limit. With the margin, the minimum of a graded penalty
    /// keeps the limits strictly.
    pub(super) fn violation(&self) -> f64 {
        let excess = self.excess();
        (excess + 1e-6 * (1.0 + excess)).max(0.0)
    }
}

/// Constants of one joint's stroke.
#[derive(Clone, Debug, PartialEq)]
pub struct StrokeConstants {
    /// Gravity component normal to the joint's axis, m/s² ([`gravity_across`](super::gravity_across)).
    pub gravity: f64,
    /// Sampling rate, Hz; every mid-point is a sample.
    pub rate_hz: f64,
    /// T ω, period times steepness. At 40, velocity and acceleration at rest are below 1e-4 for every slow stroke.
    pub period_times_steepness: f64,
    /// Maximum position relative to the start of the stroke, rad; the minimum is 0.
    pub position_limit_rad: f64,
    /// Maximum velocity, rad/s.
    pub speed_limit: f64,
    /// Maximum acceleration, rad/s².
    pub acceleration_limit: f64,
    /// Maximum velocity (rad/s) and acceleration (rad/s²) at rest (equation 17).
    pub rest_limit: f64,
    /// Penalty ε of equation 19 for a violated limit.
    pub penalty: f64,
    /// Range of A, rad.
    pub amplitude_range: [f64; 2],
    /// Range of ω, 1/s.
    pub steepness_range: [f64; 2],
    /// Range of δ, s.
    pub window_range: [f64; 2],
}

/// Peak of f''(z) = f (1 - f)(1 - 2f), at f = (3 - √3)/6: 1/(6√3).
pub(super) const PEAK_OF_SECOND: f64 = 0.096_225_044_864_937_63;

impl StrokeConstants {
    /// Checks every constant.
    ///
    /// # Errors
    /// [`OptimiserError::Setting`] with the first invalid one; [`OptimiserError::Bounds`] for an empty range.
    pub fn validate(&self) -> Result<(), OptimiserError> {
        let needed = "positive and finite";
        for (name, value) in [
            ("gravity", self.gravity),
            ("rate_hz", self.rate_hz),
            ("period_times_steepness", self.period_times_steepness),
            ("position_limit_rad", self.position_limit_rad),
            ("speed_limit", self.speed_limit),
            ("acceleration_limit", self.acceleration_limit),
            ("rest_limit", self.rest_limit),
            ("penalty", self.penalty),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(OptimiserError::Setting { name, value, needed });
            }
        }
        let (rate, most) = (self.rate_hz, 1e5 / self.window_range[1].abs());
        if rate > most {
            return Err(OptimiserError::Setting {
                name: "rate_hz",
                value: rate,
                needed: "low enough that a window has at most 200,000 samples",
            });
        }
        for (variable, [lower, upper]) in self.bounds().into_iter().enumerate() {
            if !(0.0 < lower && lower < upper && upper.is_finite()) {
                return Err(OptimiserError::Bounds { variable, lower, upper });
            }
        }
        Ok(())
    }

    /// Ranges of A, ω, δ.
    pub fn bounds(&self) -> [[f64; 2]; 3] {
        [self.amplitude_range, self.steepness_range, self.window_range]
    }

    /// Maximum half width of a window, T/4, in s, at which neighbouring windows meet.
    pub fn longest_window_s(&self, stroke: &Stroke) -> f64 {
        0.25 * self.period_times_steepness / stroke.steepness_per_s
    }

    /// Condition number of the joint's observation matrix while the other joints rest. The matrices M and Q of
    /// equations 7 to 10 are then the same function of the moving joint, with the rows [q̈, g cos q, -g sin q] (φ11
    /// to φ13; φ24 to φ26), for any lengths of the links.
    ///
    /// Rows are the samples at the times k/rate from a mid-point with |k|/rate <= δ. Falling strokes and further
    /// periods repeat the same rows, which does not change the condition number, so one rising stroke is sufficient.
    /// Infinite if the rank is not full.
    pub fn condition_number(&self, stroke: &Stroke) -> f64 {
        let reach = stroke.window_s.min(self.longest_window_s(stroke));
        if !(reach >= 0.0 && reach * self.rate_hz <= 1e6) {
            return f64::INFINITY;
        }
        // Rounding must not remove the last sample of a window.
        let last = (reach * self.rate_hz * (1.0 + 1e-12)).floor() as i64;
        let rows = (-last..=last).map(|k| {
            let (q, ddq) = stroke.position_and_acceleration(k as f64 / self.rate_hz);
            let (sin, cos) = q.sin_cos();
            [ddq, self.gravity * cos, -self.gravity * sin]
        });
        Singular3::of_rows(rows).condition_number()
    }

    /// Limits of equations 17 and 18, with the peaks of the stroke.
    pub fn limits(&self, stroke: &Stroke) -> [StrokeLimit; 5] {
        // At rest the stroke is at f(-ωT/4).
        let rest = 1.0 / (1.0 + (0.25 * self.period_times_steepness).exp());
        let (rest_speed, rest_acceleration) = (rest * (1.0 - rest), rest * (1.0 - rest) * (1.0 - 2.0 * rest));
        let Stroke { amplitude_rad: a, steepness_per_s: w, .. } = *stroke;
        [
            (StrokeQuantity::Position, a * (1.0 - rest), self.position_limit_rad),
            (StrokeQuantity::Speed, 0.25 * a * w, self.speed_limit),
            (StrokeQuantity::Acceleration, a * w * w * PEAK_OF_SECOND, self.acceleration_limit),
            (StrokeQuantity::RestSpeed, a * w * rest_speed, self.rest_limit),
            (StrokeQuantity::RestAcceleration, a * w * w * rest_acceleration, self.rest_limit),
        ]
        .map(|(quantity, value, limit)| StrokeLimit { quantity, value, limit })
    }
}
