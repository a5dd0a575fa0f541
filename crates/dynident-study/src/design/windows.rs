//! `criterion = { kind = "windowed-condition", .. }`: step-wise design. The criterion is the sum of condition numbers
//! over time windows; the moves can also be given in the study.

use serde::{Deserialize, Serialize};

/// Order in which joints move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum WindowedProblem {
    /// One joint after another moves, from the tip to the base, while all others rest at their offsets. In *Iterative
    /// Identification of Robot Dynamic Parameters Based on Logistic Function* these are the matrices Q for the tip
    /// joint, then M for the base joint.
    #[default]
    StepWise,
}

/// Sum of the joints' condition numbers over time windows around the mid-points of their logistic moves (*Iterative
/// Identification of Robot Dynamic Parameters Based on Logistic Function*, equation 19 and Fig. 6).
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct WindowedCondition {
    /// Order in which joints move; `"step-wise"` is the only value.
    pub problem: WindowedProblem,
    /// The moving joints in the order of their moves. Default: all, from the tip to the base.
    pub joints: Option<Vec<String>>,
    /// ε: penalty added to the fitness if a limit is violated. Default 1000.
    pub penalty: f64,
    /// Largest velocity, rad/s, and acceleration, rad/s², at rest (equation 17). Default 1e-4.
    pub rest_limit: f64,
    /// Range of the amplitude A of a move, rad. Default 0.1 to π.
    pub amplitude_range: [f64; 2],
    /// Range of the steepness ω of a move, 1/s. Default 0.1 to 3.
    pub steepness_range: [f64; 2],
    /// Range of the half width δ of a time window, s. Default 0.1 to 10.
    pub window_range: [f64; 2],
}

impl Default for WindowedCondition {
    fn default() -> Self {
        Self {
            problem: WindowedProblem::StepWise,
            joints: None,
            penalty: 1000.0,
            rest_limit: 1e-4,
            amplitude_range: [0.1, core::f64::consts::PI],
            steepness_range: [0.1, 3.0],
            window_range: [0.1, 10.0],
        }
    }
}

/// A logistic move (stroke) given in the study; it is evaluated without a search.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct GivenStroke {
    /// The joint.
    pub joint: String,
    /// Amplitude A, rad.
    pub amplitude_rad: f64,
    /// Steepness ω, 1/s.
    pub steepness_per_s: f64,
    /// Half width δ of the time window, s.
    pub window_s: f64,
}
