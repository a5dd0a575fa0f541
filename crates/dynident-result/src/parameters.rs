//! Output of `identify`: identified parameters.

use super::error_terms::ErrorTermResult;
use super::numbers::number;
use dynident_identification::Condition;
use dynident_identification::examination::TorqueLag;
use dynident_identification::friction::{FrictionCandidate, FrictionConstant, UnrestrictedFriction};
use dynident_study::JointDrive;
use serde::{Deserialize, Serialize};

/// One base parameter.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct BaseParameterResult {
    /// Symbol of the regressor column that represents the base parameter: `Izz1`.
    pub symbol: String,
    /// Expression of the base parameter: `Izz1 + 0.49 m2`.
    pub expression: String,
    /// Unit at a revolute joint.
    pub unit: String,
    /// The estimate.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub value: f64,
    /// Standard deviation, computed as `method.covariance` states.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub std: f64,
    /// Standard deviation under the assumption of white residuals, for comparison.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub std_white: f64,
    /// Half-width of the 95 % interval.
    #[serde(default, deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub half_width_95: f64,
    /// `100 std / |value|`; null for a zero value.
    pub relative_std_percent: Option<f64>,
    /// Value in the robot description.
    pub prior: Option<f64>,
    /// Value in the physically consistent set of `bodies` and `joints`; null unless the study requests such a set.
    #[serde(default)]
    pub physical: Option<f64>,
    /// Parameters that were fixed at nominal values and influence this value, the strongest first. Empty if the logs
    /// determine the value.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub conditional_on: Vec<Condition>,
    /// Half-width of the 95 % interval, including the uncertainty of the nominal values in `conditional_on` (masses by
    /// 30 %, for example). For an unexcited parameter: the uncertainty of its nominal value. Null if the logs determine
    /// the value, or without nominal values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_width_95_with_nominal: Option<f64>,
    /// Standard deviation from each error source, if noise is not the only source; the squares add up to the total
    /// variance. Empty for an unexcited parameter.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub error_terms: Vec<ErrorTermResult>,
    /// False if the data do not excite the parameter. Then `value` is the value of the robot description and `std` is
    /// meaningless.
    pub excited: bool,
}

impl BaseParameterResult {
    /// Largest error source and its share of the variance; `None` if noise is the only source, and for an unexcited
    /// parameter.
    pub fn largest_error(&self) -> Option<(&ErrorTermResult, f64)> {
        let largest = self.error_terms.iter().max_by(|one, other| one.std.total_cmp(&other.std))?;
        let variance: f64 = self.error_terms.iter().map(|term| term.std * term.std).sum();
        Some((largest, largest.std * largest.std / variance))
    }

    /// `100 bar_95 / |value|`; `None` for a zero value and an unexcited parameter.
    pub fn relative_half_width_percent(&self) -> Option<f64> {
        (self.excited && self.value != 0.0).then(|| 100.0 * self.bar_95() / self.value.abs())
    }

    /// Half-width of the 95 % interval, including the uncertainty of nominal values.
    pub fn bar_95(&self) -> f64 {
        self.half_width_95_with_nominal.unwrap_or(self.half_width_95)
    }
}

/// Inertial parameters of one body.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct BodyResult {
    /// Name of its main link.
    pub name: String,
    /// All links merged into it.
    pub links: Vec<String>,
    /// Mass.
    pub mass_kg: f64,
    /// Centre of mass in the body frame; null for a body without mass.
    pub com_m: Option<[f64; 3]>,
    /// Inertia about the body frame's origin: xx, xy, xz, yy, yz, zz.
    pub inertia_at_origin_kgm2: [f64; 6],
    /// All ten parameters, in the order of `parameter_order`.
    pub parameters: [f64; 10],
    /// The ten parameters in the robot description; null if unknown.
    pub prior: Option<[f64; 10]>,
    /// Smallest eigenvalue of the pseudo-inertia; positive for a physically consistent body.
    pub pseudo_inertia_min_eigenvalue: f64,
    /// Source of each of the ten values; null in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sources: Option<[ValueSource; 10]>,
    /// Standard deviation of each of the ten values, from logs and robot description together. It is that of the logs
    /// for an identified value, and that of the robot description for an unidentified one. The half-width of the 95 %
    /// interval is 1.96 times this value. The interval covers all explanations of the differences from the description,
    /// weighted by their probability, so it is wider if the logs contradict the description. Without a complete
    /// description, nominal values have 30 % uncertainty. Null for a body without description, and if the bodies are
    /// not the physically consistent set.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub std: Option<[f64; 10]>,
}

/// Source of a body's value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum ValueSource {
    /// Identified from torque.
    Measured,
    /// Identified only as part of a sum with other values; the stated value is the nearest to the robot description.
    Partly,
    /// Not identified: as near to the robot description as physical consistency allows.
    Nominal,
}

/// A friction or drive parameter.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TermResult {
    /// Symbol.
    pub symbol: String,
    /// Unit at a revolute joint.
    pub unit: String,
    /// Value in the parameter set of `bodies`, which is physically consistent unless `estimator.physical` is false.
    pub value: f64,
    /// Standard deviation of the unconstrained estimate; null if the parameter is not a separate base parameter.
    pub std: Option<f64>,
    /// The base parameter that contains this parameter.
    pub base_parameter: Option<String>,
    /// Function of a torque declared by `[[torque]]`, with joints by number; null for other terms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub law: Option<String>,
}

/// Friction and drive of one joint.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointResult {
    /// The joint.
    pub name: String,
    /// Friction and drive parameters.
    #[serde(rename = "laws")]
    pub terms: Vec<TermResult>,
    /// Standard deviation of the filtered residual, Nm (N).
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub residual_std_nm: f64,
    /// Effective lag-1 correlation of the filtered residual, which determines the error bars. It is lower than the
    /// correlation of the residual itself if columns of the regressor alternate fast.
    pub residual_correlation: Option<f64>,
    /// Time by which the joint's torque is later than its motion, from all training logs, including the compensated
    /// part; null if it is not identifiable. An entry states whether the remaining lag is large enough to matter.
    pub torque_lag: Option<TorqueLag>,
}

/// The offset of one joint in one log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LogOffset {
    /// The log.
    pub log: String,
    /// The joint.
    pub joint: String,
    /// Offset in this log minus the mean over the training logs, Nm (N).
    pub deviation_nm: f64,
    /// Standard deviation of the deviation, Nm (N).
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub std_nm: f64,
}

/// Selection of friction for one joint.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointFrictionResult {
    /// The joint.
    pub joint: String,
    /// The selected friction law, or the reason why the study's keys stay in force.
    pub chosen: String,
    /// The selection as keys of `[drive.joints.NAME]`; null without a selection.
    pub drive: Option<JointDrive>,
    /// Nonlinear constants of the selected terms, estimated together with all parameters; null if the study states
    /// them.
    #[serde(default)]
    pub constants: Vec<FrictionConstant>,
    /// Number of time blocks of the cross-validation that selects the friction law.
    pub folds: usize,
    /// The compared friction laws, each with its best constants.
    pub candidates: Vec<FrictionCandidate>,
    /// Law that would be selected without the restriction by `drive.candidates` or `drive.exportable`; null without a
    /// restriction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unrestricted: Option<UnrestrictedFriction>,
}

impl JointFrictionResult {
    /// How much accuracy the restriction of the laws costs, as a phrase; `None` without a restriction, or if it costs
    /// nothing.
    pub fn restriction(&self) -> Option<String> {
        let free = self.unrestricted.as_ref().filter(|free| free.chosen != self.chosen)?;
        Some(format!(
            "cross-validation error {:.3} instead of {:.3} with `{}`, which the study excludes",
            free.restricted_cv_error_nm, free.cv_error_nm, free.chosen
        ))
    }
}
