//! What `design.json` holds.

use super::provenance::Provenance;
use crate::study::{FamilyChoice, WindowedProblem};
use dynident_excitation::check::LimitReport;
use dynident_excitation::step_wise::StrokeQuantity;
use serde::{Deserialize, Serialize};

/// Name and version of the schema of [`DesignFile`].
pub const DESIGN_SCHEMA: &str = "dynident/design/1";

/// What `design` prints as JSON and writes as `design.json`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DesignFile {
    /// [`DESIGN_SCHEMA`].
    pub schema: String,
    /// Name of the study.
    pub name: String,
    /// Where it comes from; none in files of before it was written.
    #[serde(default)]
    pub provenance: Option<Provenance>,
    /// Joints in the order of all vectors.
    pub joints: Vec<String>,
    /// The family; `given` for a trajectory or log that was only looked at.
    pub family: String,
    /// The trajectory or log that was looked at; none for a search.
    pub given: Option<String>,
    /// The family's settings, as a study would have them; none for a motion that was given.
    pub family_settings: Option<FamilyChoice>,
    /// The family's parameters of the motion found; the motion is then moved to `start_posture`.
    pub parameters: Vec<f64>,
    /// Where the study lets each joint start, rad (m): none for a joint that is free, empty where all are.
    pub start_posture: Vec<Option<f64>>,
    /// What looked for the motion; `none` for one that was given.
    pub optimiser: String,
    /// The criterion.
    pub criterion: String,
    /// The criterion's figure, smaller is better; none where a parameter is not excited.
    pub criterion_figure: Option<f64>,
    /// Condition number of the stacked base regressor, SI units, no weights.
    pub condition_number: Option<f64>,
    /// The same after division of each column by its norm.
    pub condition_number_scaled: Option<f64>,
    /// `log det WᵀW` of the stacked base regressor: every torque noise 1 Nm (N).
    pub log_det: Option<f64>,
    /// `log det D` with the torque noise of the study.
    pub log_det_weighted: Option<f64>,
    /// Base parameters, friction and drive included.
    pub base_columns: usize,
    /// Seconds from rest to rest.
    pub duration_s: f64,
    /// Rate of the log that the figures count on, Hz.
    pub rate_hz: f64,
    /// Standard deviation of each joint's torque, Nm (N).
    pub torque_std_nm: Vec<f64>,
    /// Whether every limit is kept, by the independent check.
    pub feasible: bool,
    /// Rate of that check, Hz.
    pub check_rate_hz: f64,
    /// What was checked: the motion itself, or how a given one was understood between its samples.
    pub check_of: String,
    /// Every limit, and how much of it the motion uses.
    pub limits: Vec<LimitReport>,
    /// Error bars that this motion will give, or that a log gives, white torque noise assumed.
    pub forecast: Vec<ParameterForecast>,
    /// The combinations of parameters that will be known worst, with the prior if there is one.
    pub worst_directions: Vec<DirectionForecast>,
    /// The strokes of a windowed design, their condition numbers and the optimum beside them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub windowed: Option<WindowedFile>,
    /// Evaluations of criterion, limits and gradient.
    pub evaluations: usize,
    /// Processor seconds, all threads together; none where the system does not say.
    pub cpu_s: Option<f64>,
    /// Seconds by the clock.
    pub seconds: f64,
    /// Whether the search or its check was stopped before its end. A complete search with the same seed may find
    /// another motion.
    #[serde(default)]
    pub stopped: bool,
    /// Seed of the random starts.
    pub seed: u64,
    /// Why nothing feasible was found, and what would help; empty for a feasible motion.
    pub diagnosis: Vec<String>,
    /// Limits that were assumed where study and description are silent, and the key that changes each.
    #[serde(default)]
    pub assumed: Vec<String>,
    /// What no limit looks at: `feasible` says nothing about it.
    #[serde(default)]
    pub not_checked: Vec<String>,
    /// What was assumed where the study is silent.
    pub notes: Vec<String>,
}

/// What will be known of one base parameter.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ParameterForecast {
    /// Symbol of its column.
    pub symbol: String,
    /// What it sums.
    pub expression: String,
    /// Unit.
    pub unit: String,
    /// Expected standard deviation from the motion alone; none if the motion does not excite it.
    pub std: Option<f64>,
    /// The same with what the prior knows; none without a prior.
    pub std_with_prior: Option<f64>,
    /// `std` in percent of the prior value.
    pub relative_std_percent: Option<f64>,
    /// Value by the description.
    pub prior: Option<f64>,
}

/// A direction in the space of column-scaled parameters.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DirectionForecast {
    /// How many times less is known in it than of a column that stood alone: `1 / √λ` of the correlation-scaled
    /// information.
    pub inflation: f64,
    /// Symbols of the columns that make it, the largest share first, and their shares.
    pub terms: Vec<(String, f64)>,
}

/// What `design.json` holds of a windowed design under `windowed`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct WindowedFile {
    /// Which joints move while others rest.
    pub problem: WindowedProblem,
    /// `gradient`, `cma-es`, `genetic`, or `given` where the study gives the strokes.
    pub optimiser: String,
    /// H of equation 19: the sum of the condition numbers, with the penalty where a limit is broken.
    pub fitness: f64,
    /// The sum of the condition numbers alone.
    pub condition_sum: f64,
    /// H of the best strokes inside the limits, by exact gradients; none if nothing inside the limits was found.
    pub optimum: Option<f64>,
    /// How far `condition_sum` is above it, percent (below zero only for strokes that break limits).
    pub above_optimum_percent: Option<f64>,
    /// The strokes, in the order in which the joints move.
    pub strokes: Vec<StrokeFile>,
    /// The strokes of the optimum.
    pub optimum_strokes: Vec<StrokeFile>,
}

/// One joint's stroke.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct StrokeFile {
    /// The joint.
    pub joint: String,
    /// A, rad.
    pub amplitude_rad: f64,
    /// ω, 1/s.
    pub steepness_per_s: f64,
    /// h, rad.
    pub offset_rad: f64,
    /// T, s.
    pub period_s: f64,
    /// δ, s.
    pub window_s: f64,
    /// Condition number of the window.
    pub condition_number: f64,
    /// What the stroke makes of each limit, on the whole stroke and not only at samples.
    pub limits: Vec<StrokeLimitFile>,
}

/// One limit of a stroke.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct StrokeLimitFile {
    /// What is bounded.
    pub quantity: StrokeQuantity,
    /// Its peak; positions count from the offset. rad and s.
    pub value: f64,
    /// What it must stay below.
    pub limit: f64,
    /// By how much it is exceeded, percent of the limit; negative inside.
    pub excess_percent: f64,
    /// Whether it is kept.
    pub kept: bool,
}

impl WindowedFile {
    /// Whether every stroke keeps its limits.
    pub fn kept(&self) -> bool {
        self.strokes.iter().flat_map(|stroke| &stroke.limits).all(|limit| limit.kept)
    }

    /// Every broken limit in a sentence.
    pub(crate) fn sentences(&self) -> Vec<String> {
        let mut sentences = Vec::new();
        for stroke in &self.strokes {
            for limit in stroke.limits.iter().filter(|limit| !limit.kept) {
                let what = match limit.quantity {
                    StrokeQuantity::Position => "reach (rad)",
                    StrokeQuantity::Speed => "peak velocity (rad/s)",
                    StrokeQuantity::Acceleration => "peak acceleration (rad/s\u{b2})",
                    StrokeQuantity::RestSpeed => "speed at rest (rad/s)",
                    StrokeQuantity::RestAcceleration => "acceleration at rest (rad/s\u{b2})",
                };
                sentences.push(format!(
                    "The stroke of `{}`, {what}: {} where less than {} is allowed, {:.0} % too much.",
                    stroke.joint,
                    digits(limit.value),
                    digits(limit.limit),
                    limit.excess_percent
                ));
            }
        }
        sentences
    }
}

/// Four decimals, or as many digits of a small number.
fn digits(value: f64) -> String {
    if value < 1e-2 { format!("{value:.3e}") } else { format!("{value:.4}") }
}
