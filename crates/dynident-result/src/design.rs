//! Content of `design.json`.

use super::provenance::Provenance;
use dynident_excitation::check::LimitReport;
use dynident_excitation::step_wise::StrokeQuantity;
use dynident_study::{FamilyChoice, WindowedProblem};
use serde::{Deserialize, Serialize};

/// Name and version of the schema of [`DesignFile`].
pub const DESIGN_SCHEMA: &str = "dynident/design/1";

/// Output of `design` as JSON, also written as `design.json`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DesignFile {
    /// [`DESIGN_SCHEMA`].
    pub schema: String,
    /// Name of the study.
    pub name: String,
    /// Provenance; null in files of earlier versions.
    #[serde(default)]
    pub provenance: Option<Provenance>,
    /// Joints in the order of all vectors.
    pub joints: Vec<String>,
    /// Family of trajectories; `given` for a trajectory or log that was checked.
    pub family: String,
    /// The checked trajectory or log; null for a search.
    pub given: Option<String>,
    /// Settings of the family, in the format of a study; null for a given motion.
    pub family_settings: Option<FamilyChoice>,
    /// Parameters of the family. They describe the motion before it is shifted to `start_posture`.
    pub parameters: Vec<f64>,
    /// Fixed start position of each joint, rad (m): null for a free joint, empty if all are free.
    pub start_posture: Vec<Option<f64>>,
    /// The optimiser; `none` for a given motion.
    pub optimiser: String,
    /// The criterion.
    pub criterion: String,
    /// Value of the criterion, lower is better; null if a parameter is not excited.
    pub criterion_figure: Option<f64>,
    /// Condition number of the base regressor, rows of all samples and joints stacked, in SI units without weights.
    pub condition_number: Option<f64>,
    /// Condition number of the stacked base regressor after each column is divided by its norm.
    pub condition_number_scaled: Option<f64>,
    /// `log det WᵀW` of the stacked base regressor W, for a torque noise of 1 Nm (N).
    pub log_det: Option<f64>,
    /// Logarithm of the determinant of the information matrix, `log det D`, with the torque noise of the study.
    pub log_det_weighted: Option<f64>,
    /// Number of base parameters, including friction and drives.
    pub base_columns: usize,
    /// Duration, s.
    pub duration_s: f64,
    /// Sample rate that the predictions assume, Hz.
    pub rate_hz: f64,
    /// Standard deviation of each joint's torque noise, Nm (N).
    pub torque_std_nm: Vec<f64>,
    /// Whether all limits are satisfied in the independent check.
    pub feasible: bool,
    /// Sample rate of the check, Hz.
    pub check_rate_hz: f64,
    /// What was checked: the motion itself, or an interpolation of the given samples.
    pub check_of: String,
    /// Every limit, with the largest value of the motion relative to it.
    pub limits: Vec<LimitReport>,
    /// Predicted error bars of the base parameters for this motion or log. The torque noise is assumed white.
    pub forecast: Vec<ParameterForecast>,
    /// Combinations of parameters with the largest predicted error, including prior knowledge.
    pub worst_directions: Vec<DirectionForecast>,
    /// Result of a windowed design: one stroke per joint, the condition number in each stroke's window, and the best
    /// possible strokes. Null for other designs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub windowed: Option<WindowedFile>,
    /// Number of evaluations of criterion, limits and gradient together.
    pub evaluations: usize,
    /// Processor time of all threads, s; null if the operating system does not report it.
    pub cpu_s: Option<f64>,
    /// Elapsed time, s.
    pub seconds: f64,
    /// Whether the search or the check of its result was stopped early. A complete search with the same seed may find
    /// another motion.
    #[serde(default)]
    pub stopped: bool,
    /// Seed of the random starts.
    pub seed: u64,
    /// Reasons for infeasibility with fixes; empty for a feasible motion.
    pub diagnosis: Vec<String>,
    /// Assumed limits that neither study nor robot description state, with the key that changes each.
    #[serde(default)]
    pub assumed: Vec<String>,
    /// Properties of the motion that have no limit, so that `feasible` does not cover them.
    #[serde(default)]
    pub not_checked: Vec<String>,
    /// Assumptions for values that the study does not state.
    pub notes: Vec<String>,
}

/// Predicted error bar of one base parameter.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ParameterForecast {
    /// Symbol of the regressor column.
    pub symbol: String,
    /// Expression of the base parameter.
    pub expression: String,
    /// Unit.
    pub unit: String,
    /// Expected standard deviation from the motion alone; null if the motion does not excite the parameter.
    pub std: Option<f64>,
    /// Expected standard deviation from motion and prior knowledge; null without prior knowledge.
    pub std_with_prior: Option<f64>,
    /// `std` in percent of the value in the robot description.
    pub relative_std_percent: Option<f64>,
    /// Value in the robot description.
    pub prior: Option<f64>,
}

/// A combination of base parameters, as a direction in the space of parameters that are scaled by the norms of their
/// columns.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DirectionForecast {
    /// Factor by which correlation with other parameters increases the standard deviation in this direction: `1 / √λ`,
    /// with the eigenvalue λ of the information matrix scaled to unit diagonal.
    pub inflation: f64,
    /// Symbols of the columns with the largest shares in the direction, and these shares, the largest first.
    pub terms: Vec<(String, f64)>,
}

/// Windowed design in `design.json` under `windowed`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct WindowedFile {
    /// Order in which the joints move.
    pub problem: WindowedProblem,
    /// `gradient`, `cma-es`, `genetic`, or `given` for strokes in the study.
    pub optimiser: String,
    /// Objective H of the design: the sum of the condition numbers, plus a penalty if a limit is violated (equation 19
    /// of *Iterative Identification of Robot Dynamic Parameters Based on Logistic Function*).
    pub fitness: f64,
    /// Sum of the condition numbers of all windows.
    pub condition_sum: f64,
    /// Smallest objective H that gradient-based optimisation finds within the limits; null if no strokes keep the
    /// limits.
    pub optimum: Option<f64>,
    /// Excess of `condition_sum` over the optimum, percent (negative only for strokes that violate limits).
    pub above_optimum_percent: Option<f64>,
    /// The strokes, in the order of the joints' motion.
    pub strokes: Vec<StrokeFile>,
    /// The strokes that belong to `optimum`.
    pub optimum_strokes: Vec<StrokeFile>,
}

/// Stroke of one joint: a smooth motion from rest to rest.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct StrokeFile {
    /// The joint.
    pub joint: String,
    /// Amplitude A, rad.
    pub amplitude_rad: f64,
    /// Steepness ω, 1/s.
    pub steepness_per_s: f64,
    /// Offset h of the position, rad.
    pub offset_rad: f64,
    /// Period T, s.
    pub period_s: f64,
    /// Half width δ of the time window around the middle of the stroke, s.
    pub window_s: f64,
    /// Condition number of the regressor within the window.
    pub condition_number: f64,
    /// Limits, evaluated on the whole stroke, not only at samples.
    pub limits: Vec<StrokeLimitFile>,
}

/// One limit of a stroke.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct StrokeLimitFile {
    /// Limited quantity.
    pub quantity: StrokeQuantity,
    /// Largest value along the stroke, in rad and s; a position is relative to the offset.
    pub value: f64,
    /// Upper limit.
    pub limit: f64,
    /// Excess over the limit, percent of the limit; negative if the value is below the limit.
    pub excess_percent: f64,
    /// Whether the limit is satisfied.
    pub kept: bool,
}

impl WindowedFile {
    /// Whether every stroke satisfies its limits.
    pub fn kept(&self) -> bool {
        self.strokes.iter().flat_map(|stroke| &stroke.limits).all(|limit| limit.kept)
    }

    /// Messages about violated limits.
    pub fn sentences(&self) -> Vec<String> {
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
                    "Stroke of `{}`, {what}: {} where less than {} is allowed, {:.0} % too much.",
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

/// Text of a number with four decimals, or with four significant digits if it is small.
fn digits(value: f64) -> String {
    if value < 1e-2 { format!("{value:.3e}") } else { format!("{value:.4}") }
}
