//! The paper's design problem: one logistic stroke for each joint of the planar 2R arm, chosen for the smallest cond(M) + cond(Q).
//!
//! *Iterative Identification of Robot Dynamic Parameters Based on Logistic Function*, equations 7 to 10 and 14 to 19, Fig. 6, Table 3.
//!
//! ```
//! use core::ops::ControlFlow;
//! use dynident_excitation::paper_problem::{PaperLimit, PaperProblem, strokes};
//!
//! let problem = PaperProblem::default();
//! let solution = problem.gradient_solution(0, 2, |_| ControlFlow::Continue(()))?;
//! let x = &solution.best().expect("defined at every start").best;
//! assert!(problem.fitness(x) < 161.4);
//! assert!(problem.limits(&strokes(x)).iter().all(PaperLimit::kept));
//! # Ok::<(), dynident_excitation::optimisers::OptimiserError>(())
//! ```

mod condition;
mod smooth;
mod smooth_stroke;

pub use smooth::SmoothPaperProblem;
pub(crate) use smooth_stroke::SmoothStroke;

use crate::optimisers::{
    AugmentedLagrangianSettings, AugmentedLagrangianState, MultiStartResult, OptimiserError, Progress, multi_start,
};
use condition::Singular3;
use core::f64::consts::PI;
use core::ops::ControlFlow;
use dynident_model::sample::Random;
use serde::{Deserialize, Serialize};

/// The variables of one joint: the stroke of equation 14 with h = 0, and the window of Fig. 6.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stroke {
    /// Amplitude A in rad.
    pub amplitude_rad: f64,
    /// Steepness ω in 1/s.
    pub steepness_per_s: f64,
    /// Half width δ of the window about a mid-point, in s.
    pub window_s: f64,
}

impl Stroke {
    pub(crate) fn of(x: &[f64]) -> Self {
        Self { amplitude_rad: x[0], steepness_per_s: x[1], window_s: x[2] }
    }

    /// Position and acceleration at `t_s` after the mid-point of the rising stroke: q = A f(ωt), q̈ = A ω² f''(ωt), f = 1/(1 + e⁻ᶻ) (equations 14 and
    /// 16). rad, rad/s².
    pub fn position_and_acceleration(&self, t_s: f64) -> (f64, f64) {
        let f = 1.0 / (1.0 + (-self.steepness_per_s * t_s).exp());
        let amplitude = self.amplitude_rad;
        (amplitude * f, amplitude * self.steepness_per_s.powi(2) * f * (1.0 - f) * (1.0 - 2.0 * f))
    }
}

/// The strokes of both joints as the vector A1, ω1, δ1, A2, ω2, δ2.
///
/// # Panics
/// If `x` has fewer than six entries.
pub fn strokes(x: &[f64]) -> [Stroke; 2] {
    [Stroke::of(&x[..3]), Stroke::of(&x[3..6])]
}

/// What the paper's limits (17), (18) bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PaperQuantity {
    /// Highest position, A/(1 + e^(-ωT/4)), in rad. The lowest is above zero for every stroke.
    Position,
    /// Peak speed A ω/4, in rad/s.
    Speed,
    /// Peak acceleration A ω²/(6√3), in rad/s².
    Acceleration,
    /// Speed at start, splice and end, in rad/s.
    RestSpeed,
    /// Acceleration at start, splice and end, in rad/s².
    RestAcceleration,
    /// How far the arm's end dips below the ground while the other joint rests at 0, as the sine of the angle (times the lengths that turn, in m):
    /// the paper's workspace S.
    Ground,
}

/// One limit of the paper and what a stroke makes of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PaperLimit {
    /// Joint 1 or 2.
    pub joint: usize,
    /// What is bounded.
    pub quantity: PaperQuantity,
    /// Its peak on the whole stroke.
    pub value: f64,
    /// What it must stay below (the ground: must not exceed).
    pub limit: f64,
}

impl PaperLimit {
    /// Whether the limit is kept.
    pub fn kept(&self) -> bool {
        match self.quantity {
            PaperQuantity::Ground => self.value <= self.limit,
            _ => self.value < self.limit,
        }
    }

    /// By how much the limit is exceeded, as a share of it: 0.68 for 68 % too much, negative inside. None where the limit is zero.
    pub fn excess(&self) -> Option<f64> {
        (self.limit != 0.0).then(|| self.value / self.limit - 1.0)
    }

    /// The excess, zero inside, told a touch early, so that the lowest point of a graded penalty keeps the limits strictly; ground in rad of sine.
    pub(crate) fn violation(&self) -> f64 {
        self.excess().map_or(self.value, |excess| excess + 1e-6 * (1.0 + excess)).max(0.0)
    }
}

/// The problem's constants; the defaults are the paper's, or this project's reading where the paper is silent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PaperProblem {
    /// Gravity in m/s². Default 9.8.
    pub gravity: f64,
    /// Samples a second; the clock ticks at every mid-point. The paper states none. Default 100.
    pub rate_hz: f64,
    /// T ω, period times steepness; the paper states no T. Default 40: |q̇(0)| and |q̈(0)| are below 1e-4 for every stroke inside (18).
    pub period_times_steepness: f64,
    /// Positions are between 0 and this, in rad. Default π.
    pub position_limit_rad: f64,
    /// Default π/6 rad/s.
    pub speed_limit: f64,
    /// Default π/15 rad/s².
    pub acceleration_limit: f64,
    /// Bound of speed and acceleration at rest (equation 17). Default 1e-4.
    pub rest_limit: f64,
    /// ε of equation 19 where a limit is broken. Default 1000.
    pub penalty: f64,
    /// Range of A in rad. The paper states no ranges. Default 0.1 to π.
    pub amplitude_range: [f64; 2],
    /// Range of ω in 1/s. Default 0.1 to 3.
    pub steepness_range: [f64; 2],
    /// Range of δ in s. Default 0.1 to 10.
    pub window_range: [f64; 2],
}

impl Default for PaperProblem {
    fn default() -> Self {
        Self {
            gravity: 9.8,
            rate_hz: 100.0,
            period_times_steepness: 40.0,
            position_limit_rad: PI,
            speed_limit: PI / 6.0,
            acceleration_limit: PI / 15.0,
            rest_limit: 1e-4,
            penalty: 1000.0,
            amplitude_range: [0.1, PI],
            steepness_range: [0.1, 3.0],
            window_range: [0.1, 10.0],
        }
    }
}

/// Peak of f''(z) = f (1 - f)(1 - 2f), at f = (3 - √3)/6: 1/(6√3).
const PEAK_OF_SECOND: f64 = 0.096_225_044_864_937_63;

impl PaperProblem {
    /// Whether every constant is usable.
    ///
    /// # Errors
    /// [`OptimiserError::Setting`] names the first that is not; [`OptimiserError::Bounds`] an empty range.
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

    /// Ranges of A1, ω1, δ1, A2, ω2, δ2.
    pub fn bounds(&self) -> Vec<[f64; 2]> {
        let one = [self.amplitude_range, self.steepness_range, self.window_range];
        [one, one].concat()
    }

    /// The stroke's share of a period on either side of its mid-point, T/4, in s: a window reaches no further, where it meets the next.
    pub fn longest_window_s(&self, stroke: &Stroke) -> f64 {
        0.25 * self.period_times_steepness / stroke.steepness_per_s
    }

    /// Condition number of the observation matrix of one joint while the other rests at 0: M and Q of equations 7 to 10 are then the same function of
    /// the moving joint, with the rows
    /// [q̈, g cos q, -g sin q] (φ11 to φ13; φ24 to φ26), whatever a1.
    ///
    /// Rows are the samples k/rate from a mid-point with |k|/rate <= δ. Falling strokes and further periods repeat the same rows, which changes no
    /// condition number, so one rising stroke is enough.
    /// Infinite for a matrix without full rank.
    pub fn condition_number(&self, stroke: &Stroke) -> f64 {
        let reach = stroke.window_s.min(self.longest_window_s(stroke));
        if !(reach >= 0.0 && reach * self.rate_hz <= 1e6) {
            return f64::INFINITY;
        }
        // A window of a whole number of samples must not lose its ends to rounding.
        let last = (reach * self.rate_hz * (1.0 + 1e-12)).floor() as i64;
        let rows = (-last..=last).map(|k| {
            let (q, ddq) = stroke.position_and_acceleration(k as f64 / self.rate_hz);
            let (sin, cos) = q.sin_cos();
            [ddq, self.gravity * cos, -self.gravity * sin]
        });
        Singular3::of_rows(rows).condition_number()
    }

    /// Every limit of (17) and (18) for both joints, kept or not.
    pub fn limits(&self, strokes: &[Stroke; 2]) -> Vec<PaperLimit> {
        (1..).zip(strokes).flat_map(|(joint, stroke)| self.limits_of(joint, stroke)).collect()
    }

    /// Every limit of (17) and (18) for one joint, which is only named by `joint`.
    pub fn limits_of(&self, joint: usize, stroke: &Stroke) -> [PaperLimit; 6] {
        // At rest the stroke stands at f(-ωT/4).
        let rest = 1.0 / (1.0 + (0.25 * self.period_times_steepness).exp());
        let (rest_speed, rest_acceleration) = (rest * (1.0 - rest), rest * (1.0 - rest) * (1.0 - 2.0 * rest));
        let Stroke { amplitude_rad: a, steepness_per_s: w, .. } = *stroke;
        let highest = a * (1.0 - rest);
        // The sine is concave up to π: its lowest value is at an end of the stroke.
        let dip = -(a * rest).sin().min(highest.sin()).min(if highest > 1.5 * PI { -1.0 } else { 1.0 });
        [
            (PaperQuantity::Position, highest, self.position_limit_rad),
            (PaperQuantity::Speed, 0.25 * a * w, self.speed_limit),
            (PaperQuantity::Acceleration, a * w * w * PEAK_OF_SECOND, self.acceleration_limit),
            (PaperQuantity::RestSpeed, a * w * rest_speed, self.rest_limit),
            (PaperQuantity::RestAcceleration, a * w * w * rest_acceleration, self.rest_limit),
            (PaperQuantity::Ground, dip.max(0.0), 0.0),
        ]
        .map(|(quantity, value, limit)| PaperLimit { joint, quantity, value, limit })
    }

    /// H of equation 19: cond(M) + cond(Q), plus the penalty if any limit is broken. `x` is A1, ω1, δ1, A2, ω2, δ2.
    ///
    /// # Panics
    /// If `x` has fewer than six entries.
    pub fn fitness(&self, x: &[f64]) -> f64 {
        let strokes = strokes(x);
        let kept = self.limits(&strokes).iter().all(PaperLimit::kept);
        let conditions: f64 = strokes.iter().map(|stroke| self.condition_number(stroke)).sum();
        conditions + if kept { 0.0 } else { self.penalty }
    }

    /// H with a penalty that grows with the violation: cond(M) + cond(Q) + penalty · Σ max(0, value/limit - 1). Inside the limits it is H, and its
    /// lowest point is the same, because the penalty outweighs what
    /// a violation gains (about 80 per unit at the optimum, against 1000). The step of equation 19 hides from a search on which side of a limit to
    /// go, and lets evolution strategies die at the wall: their
    /// covariance collapses before they have slid along it.
    ///
    /// # Panics
    /// If `x` has fewer than six entries.
    pub fn graded_fitness(&self, x: &[f64]) -> f64 {
        let strokes = strokes(x);
        let violation: f64 = self.limits(&strokes).iter().map(PaperLimit::violation).sum();
        let conditions: f64 = strokes.iter().map(|stroke| self.condition_number(stroke)).sum();
        conditions + self.penalty * violation
    }

    /// The paper's Table 3. Its δ (367 and 246) has no unit; here it is a number of samples at `delta_rate_hz`.
    pub fn table_3(delta_rate_hz: f64) -> [Stroke; 2] {
        let stroke = |amplitude_rad, steepness_per_s, samples: f64| Stroke {
            amplitude_rad,
            steepness_per_s,
            window_s: samples / delta_rate_hz,
        };
        [stroke(2.313, 1.523, 367.0), stroke(2.094, 0.996, 246.0)]
    }

    /// Solves [`SmoothPaperProblem`] by the augmented Lagrangian from `starts` random points of the ranges. The best point keeps every limit of (18);
    /// judge it by [`fitness`](PaperProblem::fitness).
    ///
    /// # Errors
    /// A constant out of range; no start.
    pub fn gradient_solution(
        &self,
        seed: u64,
        starts: usize,
        watch: impl Fn(&Progress<'_>) -> ControlFlow<()> + Sync,
    ) -> Result<MultiStartResult, OptimiserError> {
        self.validate()?;
        let mut random = Random::new(seed);
        let bounds = self.bounds();
        let smooth = SmoothPaperProblem::new(self);
        let points: Vec<AugmentedLagrangianState> = (0..starts)
            .map(|_| {
                let x: Vec<f64> = bounds.iter().map(|[lower, upper]| random.uniform(*lower, *upper)).collect();
                smooth.with_bounds_of_conditions(&x).into()
            })
            .collect();
        multi_start(|| smooth.clone(), &points, &AugmentedLagrangianSettings::default(), watch)
    }
}

#[cfg(test)]
mod tests;
