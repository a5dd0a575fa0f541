//! Output of `identify`: the schema of `result.json`.

use super::check::StudyCheck;
use super::comparison::DescriptionComparison;
use super::error_terms::ErrorTermResult;
use super::forms::{FormResult, StoredModel};
use super::numbers::{number, rows};
use super::provenance::Provenance;
use dynident_estimation::consistent::ConsistencyTest;
use dynident_estimation::{CorrelatedPair, EssentialReport};
use dynident_identification::consistent::ParameterInterval;
use dynident_identification::estimators::{
    GrossErrors, NoiseInRegressor, PeriodicFit, SeriesFit, SimulatedFit, SplineFit,
};
use dynident_identification::examination::{
    LagChoice, LogValidation, PriorAgreement, TorqueBand, TorqueLag, TorqueSignCheck,
};
use dynident_identification::friction::{FrictionCandidate, FrictionConstant, UnrestrictedFriction};
use dynident_identification::payload::{DriveGain, PayloadResult};
use dynident_identification::rows::VelocityHistogram;
use dynident_identification::{Condition, CutoffByError, DriveInertiaChoice, LogEvent, LogVariation, Role};
use dynident_recording::{Finding, ImportReport, MotionSettings};
use dynident_study::JointDrive;
use serde::{Deserialize, Serialize};

/// Name and version of the schema. Within a version fields are added, never renamed.
pub const RESULT_SCHEMA: &str = "dynident/result/1";

/// A finished identification.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ResultFile {
    /// [`RESULT_SCHEMA`].
    pub schema: String,
    /// Name of the study.
    pub name: String,
    /// Reasons against loading the exported model into a robot; empty without any.
    #[serde(default)]
    pub problems: Vec<String>,
    /// Provenance; null in results of versions before 0.1.
    #[serde(default)]
    pub provenance: Option<Provenance>,
    /// The robot.
    pub robot: RobotSummary,
    /// How the fit was made.
    pub method: MethodSummary,
    /// Test for bias by noise in the regressor; null if it is not possible.
    pub noise_in_regressor: Option<NoiseInRegressor>,
    /// Rows with small weights in a robust estimator; null for other estimators.
    pub gross_errors: Option<GrossErrors>,
    /// Correlations of the joints' errors at one instant, in the order of `robot.joints`; null unless the estimator is
    /// `generalized`.
    pub noise_correlation: Option<Vec<Vec<f64>>>,
    /// Smallest and largest noise level of each joint's rows, relative to its mean; null unless the estimator is
    /// `noise-weighted`.
    pub noise_levels: Option<Vec<[f64; 2]>>,
    /// Periods and their noise, in results of earlier versions with the estimator `maximum-likelihood`; otherwise
    /// null.
    pub periodic: Option<PeriodicFit>,
    /// Fourier motion and noise of every training log; only for the estimator `simultaneous` with a period.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub series: Option<Vec<SeriesFit>>,
    /// Spline motion and noise of every training log; only for the estimators `simultaneous`
    /// without a period and `maximum-likelihood`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spline_motion: Option<SplineFit>,
    /// The simulated loop; null unless the estimator is `didim`, `clie` or `cloe`.
    pub simulated: Option<SimulatedFit>,
    /// The base parameters, in the order of the tree.
    pub base_parameters: Vec<BaseParameterResult>,
    /// Covariance of the base parameters, in their order, by the method in `method.covariance`; zero for unexcited
    /// parameters.
    #[serde(default, deserialize_with = "rows")]
    #[cfg_attr(feature = "schema", schemars(with = "Vec<Vec<Option<f64>>>"))]
    pub base_parameter_covariance: Vec<Vec<f64>>,
    /// Covariance of the base parameters for tests of several parameters together, as `compare` makes them: with few
    /// segments `base_parameter_covariance` has too small eigenvalues, so white errors are mixed in. Empty in results
    /// of earlier versions.
    #[serde(default, deserialize_with = "rows", skip_serializing_if = "Vec::is_empty")]
    #[cfg_attr(feature = "schema", schemars(with = "Vec<Vec<Option<f64>>>"))]
    pub base_parameter_joint_covariance: Vec<Vec<f64>>,
    /// The bodies: of all full sets with these base parameters the nearest to the prior.
    pub bodies: Vec<BodyResult>,
    /// Which bodies differ from the robot description, with the torque error after each is restored; null without a
    /// description of all bodies, and in results of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub description_differences: Option<DescriptionComparison>,
    /// Interval of every body and term parameter over the physically consistent sets that the data do not reject; null
    /// unless requested.
    pub possible_intervals: Option<Vec<ParameterInterval>>,
    /// Poorly determined parameters that were fixed at zero; null unless requested.
    pub essential: Option<EssentialReport>,
    /// The strongest correlations between estimates, strongest first.
    #[serde(default)]
    pub correlations: Vec<CorrelatedPair>,
    /// Friction and drives.
    pub joints: Vec<JointResult>,
    /// Test for drive inertia of the joints where no key states it; null if keys state it for all joints.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drive_inertia_choice: Option<DriveInertiaChoice>,
    /// Selection of friction, for the joints where it applies.
    #[serde(default)]
    pub friction_choice: Vec<JointFrictionResult>,
    /// The complete identified robot, for `dynident export`; `None` for payloads on a known arm, for bodies with
    /// unknown parameters, and in results of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<StoredModel>,
    /// The model in each class of forms that `dynident export` writes, with its own held-out error; empty for payloads
    /// on a known arm, with unknown gains, and in results of older versions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub forms: Vec<FormResult>,
    /// Estimated payloads.
    #[serde(default)]
    pub payloads: Vec<PayloadResult>,
    /// Offsets of each log; empty unless the study requests them. The base parameters contain their mean.
    #[serde(default)]
    pub offsets: Vec<LogOffset>,
    /// Drive gains of each joint; null unless the study declares them unknown.
    pub drive_gains: Option<Vec<DriveGain>>,
    /// Drives coupled to two joints.
    #[serde(default)]
    pub couplings: Vec<TermResult>,
    /// Fit to the training logs.
    pub training: TrainingResult,
    /// Validation on held-out logs.
    #[serde(default)]
    pub validation: Vec<LogValidation>,
    /// Coverage of the 95 % band of the predicted torque on held-out logs.
    #[serde(default)]
    pub torque_band: Vec<TorqueBand>,
    /// Whether the full set is physically consistent.
    pub physical: PhysicalVerdict,
    /// Import findings of each log.
    pub logs: Vec<LogSummary>,
    /// Examination of the study by alternative hypotheses; null if it was not needed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub check: Option<StudyCheck>,
    /// Reason for a missing identified.urdf; null if it exists.
    pub no_urdf: Option<String>,
    /// Reason for a missing identified.xml although the robot description is an MJCF and identified.urdf exists.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub no_mjcf: Option<String>,
    /// Reason for a missing identified.sdf although the robot description is an SDF and identified.urdf exists.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub no_sdf: Option<String>,
    /// Computing times.
    pub timings_s: Timings,
}

/// The robot of a result.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RobotSummary {
    /// Name.
    pub name: String,
    /// The robot description, relative to the study's folder.
    pub file: String,
    /// Degrees of freedom.
    pub dof: usize,
    /// Joint names in the order of all vectors.
    pub joints: Vec<String>,
    /// Gravity in the base frame, m/s².
    pub gravity_m_s2: [f64; 3],
    /// Order of the ten inertial parameters of a body.
    pub parameter_order: [String; 10],
}

/// Method of a fit.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct MethodSummary {
    /// The study's `estimator.method`; for `auto` the selected one, `weighted` or `instrumental`.
    pub estimator: String,
    /// `complete`, `not-all-excited` or `iteration-limit`.
    pub status: String,
    /// Number of solutions.
    pub iterations: usize,
    /// Parts of the study with code of the caller, each with its function name; this code is required to reproduce the
    /// result, and to use it where those parts are needed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub functions: Vec<String>,
    /// Assumption of the error bars.
    pub covariance: String,
    /// Number of time segments for the covariance.
    pub clusters: usize,
    /// Method for velocities and accelerations, with the cut-off of all logs.
    pub motion: MotionSettings,
    /// Selection of the cut-off; null if the study states it, or the logs are too short.
    #[serde(default)]
    pub cutoff: Option<CutoffByError>,
    /// Lag of the torque behind the motion: estimate and compensated part.
    #[serde(default)]
    pub torque_lag: LagChoice,
    /// Parameter differences between training logs relative to their error bars; the error bars of `base_parameters`
    /// include the excess. Null for a single log.
    #[serde(default)]
    pub between_logs: Option<LogVariation>,
    /// Held-out figures are for torque below 0.7 times this frequency, the cut-off from the spectrum of the motion, Hz;
    /// null if they use the band of the fit.
    #[serde(default)]
    pub motion_hz: Option<f64>,
    /// Condition number of the weighted regressor's base columns.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub condition_number: f64,
    /// The same after division of each column by its norm.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub condition_number_scaled: f64,
    /// Method of selecting the base columns.
    pub base_columns: String,
    /// Smallest relative residual of an independent column, and largest of a dependent one.
    pub base_gap: [f64; 2],
    /// Base parameters that the data do not excite; fixed at the prior (or zero).
    #[serde(default)]
    pub not_excited: Vec<String>,
    /// Declared torques that coincide with those of other parameters; their coefficients stay near the nominal values.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub coincident: Vec<String>,
    /// Joints that no training log moves above the noise of their positions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub resting_joints: Vec<String>,
    /// Standard deviation of stated gains, percent, as included in the error bars of payloads; null if they are exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_std_percent: Option<f64>,
    /// With load-dependent friction: base parameters of an estimate without it, whose torque is the load.
    pub load_parameters: Option<Vec<f64>>,
}

impl MethodSummary {
    /// Whether the estimator converged within its iterations.
    pub fn is_settled(&self) -> bool {
        self.status != "iteration-limit"
    }
}

/// One base parameter.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct BaseParameterResult {
    /// Symbol of the independent column: `Izz1`.
    pub symbol: String,
    /// Expression: `Izz1 + 0.49 m2`.
    pub expression: String,
    /// Unit at a revolute joint.
    pub unit: String,
    /// The estimate.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub value: f64,
    /// Standard deviation, from the covariance of the method.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub std: f64,
    /// Standard deviation for white residuals, for comparison.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub std_white: f64,
    /// Half-width of the 95 % interval.
    #[serde(default, deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub half_width_95: f64,
    /// `100 std / |value|`.
    pub relative_std_percent: Option<f64>,
    /// Value in the robot description.
    pub prior: Option<f64>,
    /// Value of the physically consistent set in `bodies` and `joints`; null unless requested.
    #[serde(default)]
    pub physical: Option<f64>,
    /// Parameters fixed at nominal on which this value depends, the strongest first. Empty if the logs determine the
    /// value.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub conditional_on: Vec<Condition>,
    /// Half-width of the 95 % interval including the uncertainty of those nominal values (masses by 30 %, for example);
    /// for an unexcited parameter, the uncertainty of its nominal value. Null if the logs determine the value, or
    /// without nominal values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_width_95_with_nominal: Option<f64>,
    /// Standard deviation per error source, if there are others than noise; the squares add up to the total variance.
    /// Empty for an unexcited parameter.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub error_terms: Vec<ErrorTermResult>,
    /// False if the data do not excite it; then `value` is the prior and `std` is meaningless.
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

/// One body of the full set.
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
    /// Standard deviation of each of the ten values from the logs and the robot description: that of the logs for an
    /// identified value, that of the robot description for an unidentified one. 1.96 times it is the
    /// half width of the interval that contains 95 % of the mixture over all explanations of the difference from the
    /// description, so that a description that the logs contradict widens it; without a complete description, nominal
    /// values have 30 % uncertainty. Null for a body that is not described, and if the
    /// bodies are not the physically consistent set.
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
    /// Identified in sums with others; the value is the nearest to the robot description.
    Partly,
    /// Not identified: near the robot description, as far as physical consistency allows.
    Nominal,
}

/// A parameter of a term.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TermResult {
    /// Symbol.
    pub symbol: String,
    /// Unit at a revolute joint.
    pub unit: String,
    /// Value in the full set of `bodies`: physically consistent unless `estimator.physical` is false.
    pub value: f64,
    /// Standard deviation of the unconstrained estimate; null if it is not a separate base parameter.
    pub std: Option<f64>,
    /// The base parameter that contains it.
    pub base_parameter: Option<String>,
    /// Function of a declared torque, with joints by number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub law: Option<String>,
}

/// Friction and drive of one joint.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointResult {
    /// The joint.
    pub name: String,
    /// The terms.
    #[serde(rename = "laws")]
    pub terms: Vec<TermResult>,
    /// Standard deviation of the filtered residual, Nm (N).
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub residual_std_nm: f64,
    /// Lag-1 correlation of the residual that determines the error bars.
    pub residual_correlation: Option<f64>,
    /// Lag of the torque behind the motion from all training logs, including the compensated part; null if it is not
    /// identifiable. It is marked if the remaining lag matters.
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
    /// Deviation from the mean over the training logs, Nm (N).
    pub deviation_nm: f64,
    /// Standard deviation of the deviation, Nm (N).
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub std_nm: f64,
}

/// Figures of the fit to the training logs.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TrainingResult {
    /// The logs.
    pub logs: Vec<String>,
    /// Filtered rows of each joint.
    pub samples: usize,
    /// `100 ‖τ - τ̂‖ / ‖τ‖`, filtered, all joints stacked.
    pub relative_error_percent: Option<f64>,
    /// Figures per joint.
    pub joints: Vec<TrainingJoint>,
    /// The same for the physically consistent set, which is exported; null without one.
    #[serde(default)]
    pub physical: Option<TrainingErrors>,
}

/// Errors of a set of parameters on the training logs.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TrainingErrors {
    /// `100 ‖τ - τ̂‖ / ‖τ‖`, filtered, all joints stacked.
    pub relative_error_percent: Option<f64>,
    /// Figures per joint.
    pub joints: Vec<TrainingJoint>,
}

/// One joint of [`TrainingResult`].
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TrainingJoint {
    /// The joint.
    pub name: String,
    /// Root mean square residual, Nm (N).
    pub rmse_nm: f64,
    /// `100 ‖τ - τ̂‖ / ‖τ‖`.
    pub relative_error_percent: Option<f64>,
}

/// Whether a full set is physically consistent.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PhysicalVerdict {
    /// All pseudo-inertias positive definite, no negative friction or drive inertia.
    pub consistent: bool,
    /// Violations.
    #[serde(default)]
    pub violations: Vec<String>,
    /// Subject of the verdict.
    pub note: String,
    /// The physically consistent fit for the bodies; null if it was not requested or failed.
    pub fit: Option<PhysicalFitResult>,
    /// Reason of a failure.
    pub failure: Option<String>,
    /// Bodies with inconsistent nominal inertia, for which the prior is an approximate body of ordinary mass.
    #[serde(default)]
    pub impossible_priors: Vec<String>,
    /// Sign of the torque that a physically consistent set explains; null without a physically consistent set for
    /// either sign.
    pub sign: Option<TorqueSignCheck>,
}

/// A physically consistent fit.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PhysicalFitResult {
    /// `solved`, `stalled` or `iteration-limit`; all of them satisfy every constraint.
    pub status: String,
    /// Solver iterations.
    pub iterations: usize,
    /// Relative stationarity of its certificate.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub stationarity: f64,
    /// Relative duality gap of its certificate.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub duality_gap: f64,
    /// Distance of the base parameters from the estimate, in standard deviations for white residuals.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub moved_sigma: f64,
    /// Largest change of a base parameter in units of its reported standard deviation.
    pub largest_move_std: Option<f64>,
    /// Test whether the logs contradict the consistent set; null if it is not possible.
    #[serde(default)]
    pub difference: Option<ConsistencyTest>,
    /// Active constraints: friction or drive inertia at zero.
    #[serde(default)]
    pub active: Vec<String>,
    /// Figures per body.
    pub bodies: Vec<PhysicalBodyResult>,
}

/// Physical consistency of a body, with its margin.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PhysicalBodyResult {
    /// Name.
    pub name: String,
    /// Smallest eigenvalue of the pseudo-inertia relative to the body in the robot description.
    pub margin: f64,
    /// Whether the constraint of this body is active.
    pub on_the_boundary: bool,
}

/// Summary of a log.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LogSummary {
    /// Name.
    pub log: String,
    /// `identify` or `validate`.
    pub role: Role,
    /// The importer's report.
    pub import: ImportReport,
    /// Cut-off of the differentiator, Hz.
    pub motion_cutoff_hz: Option<f64>,
    /// Cut-off of the parallel filter, Hz.
    pub filter_cutoff_hz: Option<f64>,
    /// Rate of the filtered rows, Hz.
    pub filtered_rate_hz: f64,
    /// Filtered rows of each joint.
    pub filtered_rows: u64,
    /// Agreement of the log with the inertials of the robot description.
    pub prior_agreement: Option<PriorAgreement>,
    /// Lag of torque behind motion of each joint, s, estimated with the model from this log alone; null if it is not
    /// identifiable.
    #[serde(default)]
    pub torque_lag_s: Vec<Option<f64>>,
    /// Standard deviations of the lags, s.
    #[serde(default)]
    pub torque_lag_std_s: Vec<Option<f64>>,
    /// Half-widths of their 95 % intervals, s.
    #[serde(default)]
    pub torque_lag_half_width_95_s: Vec<Option<f64>>,
    /// Velocity histogram of each joint, in the order of `robot.joints`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub velocities: Vec<VelocityHistogram>,
    /// Findings from the model.
    #[serde(default)]
    pub model_findings: Vec<Finding>,
    /// Intervals and slow changes that no single model explains; missing without any.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub events: Vec<LogEvent>,
}

/// Time of creation, and computing times in seconds. Only these differ when a result is reproduced.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Timings {
    /// Time of creation, UTC: `2026-11-22T10:30:13Z`.
    #[serde(default)]
    pub made_at: String,
    /// Reading the robot, base parameters.
    #[serde(rename = "machine")]
    pub robot: f64,
    /// Logs to triangular factors.
    pub logs: f64,
    /// Factors to estimates.
    pub estimation: f64,
    /// Held-out logs.
    pub validation: f64,
    /// Total.
    pub total: f64,
}

/// Selection of friction for one joint.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointFrictionResult {
    /// The joint.
    pub joint: String,
    /// The selected friction, or the reason why the study's keys stay in force.
    pub chosen: String,
    /// The selection as keys of `[drive.joints.NAME]`; null without a selection.
    pub drive: Option<JointDrive>,
    /// Constants of the selected terms, estimated with all parameters; null if they were stated.
    #[serde(default)]
    pub constants: Vec<FrictionConstant>,
    /// Number of time blocks of the cross-validation.
    pub folds: usize,
    /// The compared candidates, each with its best constants.
    pub candidates: Vec<FrictionCandidate>,
    /// The selection among all laws, if `drive.candidates` or `drive.exportable` restricts them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unrestricted: Option<UnrestrictedFriction>,
}

impl JointFrictionResult {
    /// What the restriction of the laws costs, as a phrase; `None` without a restriction or if it costs nothing.
    pub fn restriction(&self) -> Option<String> {
        let free = self.unrestricted.as_ref().filter(|free| free.chosen != self.chosen)?;
        Some(format!(
            "cross-validation error {:.3} instead of {:.3} with `{}`, which the study excludes",
            free.restricted_cv_error_nm, free.cv_error_nm, free.chosen
        ))
    }
}
