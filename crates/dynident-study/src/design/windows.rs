//! `criterion = { kind = "windowed-condition", .. }`: the paper's criterion over windows, and strokes given in the
//! study.

use serde::{Deserialize, Serialize};

/// Sequence in which joints move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum WindowedProblem {
    /// One joint after another makes its stroke, from the tip to the base, while all others rest at their offsets: the
    /// paper's Q for the tip joint, then M for the base joint.
    #[default]
    StepWise,
}

/// The sum of condition numbers over windows around the mid-points of the strokes (the paper's equation 19 and Fig. 6).
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct WindowedCondition {
    /// Sequence in which joints move; `"step-wise"` is the only choice.
    pub problem: WindowedProblem,
    /// The moving joints in the order of their strokes. Default: all, from the tip to the base.
    pub joints: Option<Vec<String>>,
    /// ε: penalty added to the fitness for a violated limit. Default 1000.
    pub penalty: f64,
    /// Bound of velocity and acceleration at rest (equation 17), rad/s and rad/s². Default 1e-4.
    pub rest_limit: f64,
    /// Range of A, rad. Default 0.1 to π.
    pub amplitude_range: [f64; 2],
    /// Range of ω, 1/s. Default 0.1 to 3.
    pub steepness_range: [f64; 2],
    /// Range of δ, s. Default 0.1 to 10.
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

/// A stroke given in the study, which is evaluated without a search.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct GivenStroke {
    /// The joint.
    pub joint: String,
    /// A, rad.
    pub amplitude_rad: f64,
    /// ω, 1/s.
    pub steepness_per_s: f64,
    /// δ, s.
    pub window_s: f64,
}
