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
use dynident_study::{JointDrive, ReportThresholds};
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
    /// Reasons not to load the exported model into a robot; empty if there are none.
    #[serde(default)]
    pub problems: Vec<String>,
    /// Thresholds of the statements about this result, as `[thresholds.report]` of the study gives them; omitted if all
    /// have their default values.
    #[serde(default, skip_serializing_if = "ReportThresholds::is_default")]
    pub thresholds: ReportThresholds,
    /// Provenance; null in results of versions before 0.1.
    #[serde(default)]
    pub provenance: Option<Provenance>,
    /// The robot.
    pub robot: RobotSummary,
    /// Method and settings of the fit.
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
    /// Fourier series of the motion, and noise, of every training log; only for the estimator `simultaneous` with a
    /// period.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub series: Option<Vec<SeriesFit>>,
    /// Spline fit of the motion, and noise, of every training log; only for the estimators `simultaneous` without a
    /// period and `maximum-likelihood`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spline_motion: Option<SplineFit>,
    /// Result of the simulated closed loop; null unless the estimator is `didim`, `clie` or `cloe`.
    pub simulated: Option<SimulatedFit>,
    /// The base parameters, in the order of the links from base to tip.
    pub base_parameters: Vec<BaseParameterResult>,
    /// Covariance of the base parameters, computed as `method.covariance` states; rows and columns in the order of
    /// `base_parameters`. Zero for unexcited parameters.
    #[serde(default, deserialize_with = "rows")]
    #[cfg_attr(feature = "schema", schemars(with = "Vec<Vec<Option<f64>>>"))]
    pub base_parameter_covariance: Vec<Vec<f64>>,
    /// Covariance of the base parameters for tests of several parameters together, such as those of `compare`. With few
    /// time segments, `base_parameter_covariance` has eigenvalues that are too small; this matrix is therefore mixed
    /// with the covariance for white errors. Empty in results of earlier versions.
    #[serde(default, deserialize_with = "rows", skip_serializing_if = "Vec::is_empty")]
    #[cfg_attr(feature = "schema", schemars(with = "Vec<Vec<Option<f64>>>"))]
    pub base_parameter_joint_covariance: Vec<Vec<f64>>,
    /// Inertial parameters of every body. Many sets of values give the same base parameters; this set is the nearest to
    /// the robot description.
    pub bodies: Vec<BodyResult>,
    /// Which bodies differ from the robot description, and the torque error if one of them gets the values of the
    /// description again. Null if the description does not contain all bodies, and in results of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub description_differences: Option<DescriptionComparison>,
    /// Interval of every inertial and friction parameter over all physically consistent sets that the data do not
    /// reject; null unless the study requests it.
    pub possible_intervals: Option<Vec<ParameterInterval>>,
    /// Poorly determined parameters that were fixed at zero; null unless the study requests this.
    pub essential: Option<EssentialReport>,
    /// The strongest correlations between estimates, strongest first.
    #[serde(default)]
    pub correlations: Vec<CorrelatedPair>,
    /// Friction and drive parameters of each joint.
    pub joints: Vec<JointResult>,
    /// Test for drive inertia of the joints for which no study key states it; null if keys state it for all joints.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drive_inertia_choice: Option<DriveInertiaChoice>,
    /// Selection of friction, for the joints where it applies.
    #[serde(default)]
    pub friction_choice: Vec<JointFrictionResult>,
    /// The complete identified robot, the input of `dynident export`; `None` for payloads on a known arm, for bodies
    /// with unknown parameters, and in results of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<StoredModel>,
    /// The model as each class of export formats can represent it, with its held-out error; empty for payloads on a
    /// known arm, with unknown gains, and in results of older versions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub forms: Vec<FormResult>,
    /// Estimated payloads.
    #[serde(default)]
    pub payloads: Vec<PayloadResult>,
    /// Constant torque of each joint in each log, relative to the mean over the logs; empty unless the study requests
    /// separate offsets. The base parameters contain the mean.
    #[serde(default)]
    pub offsets: Vec<LogOffset>,
    /// Drive gains of each joint; null unless the study declares them unknown.
    pub drive_gains: Option<Vec<DriveGain>>,
    /// Parameters of drives that two joints share.
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
    /// Whether the set of all inertial and friction parameters is physically consistent.
    pub physical: PhysicalVerdict,
    /// Import findings of each log.
    pub logs: Vec<LogSummary>,
    /// Comparison of hypotheses about mistakes in the study; null if it was not needed.
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
    /// Unit of each joint's torque, in the order of `joints`: `Nm`, or `N` for a prismatic joint. Empty in results of
    /// older versions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub torque_units: Vec<String>,
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
    /// Number of iterations of the estimator.
    pub iterations: usize,
    /// Functions that the caller's program supplied for parts of the study, by name. The same functions are necessary
    /// to reproduce the result, and to use it where those parts are needed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub functions: Vec<String>,
    /// Assumption about the residuals behind the error bars.
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
    /// Differences of the parameters between training logs, relative to their error bars. If the differences exceed the
    /// error bars, those of `base_parameters` are increased accordingly. Null for a single log.
    #[serde(default)]
    pub between_logs: Option<LogVariation>,
    /// Cut-off from the spectrum of the motion, Hz: held-out errors are for torque below 0.7 times this frequency. Null
    /// if held-out errors use the same band as the fit.
    #[serde(default)]
    pub motion_hz: Option<f64>,
    /// Condition number of the weighted regressor's base columns.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub condition_number: f64,
    /// Condition number of the weighted regressor's base columns after each column is divided by its norm.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub condition_number_scaled: f64,
    /// Method that selects the independent columns of the regressor, which define the base parameters.
    pub base_columns: String,
    /// Margin of the selection of base columns: the smallest relative residual of a column that was classified as
    /// independent, and the largest of a column that was classified as dependent.
    pub base_gap: [f64; 2],
    /// Base parameters that the data do not excite; fixed at the prior (or zero).
    #[serde(default)]
    pub not_excited: Vec<String>,
    /// Torques declared by `[[torque]]` whose columns coincide with those of other parameters; their coefficients stay
    /// near the nominal values.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub coincident: Vec<String>,
    /// Joints that no training log moves above the noise of their positions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub resting_joints: Vec<String>,
    /// Relative standard deviation of the stated torque gains, percent, as included in the error bars of payloads; null
    /// if the gains are exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_std_percent: Option<f64>,
    /// Only with load-dependent friction: base parameters of an earlier estimate without such friction. The torque that
    /// they predict is the load in the friction law.
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

/// Figures of the fit to the training logs.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TrainingResult {
    /// The logs.
    pub logs: Vec<String>,
    /// Number of filtered rows of each joint.
    pub samples: usize,
    /// Relative error of the predicted torque, `100 ‖τ - τ̂‖ / ‖τ‖`, filtered, all joints stacked.
    pub relative_error_percent: Option<f64>,
    /// Figures per joint.
    pub joints: Vec<TrainingJoint>,
    /// Errors of the physically consistent set, which is exported; null if there is none.
    #[serde(default)]
    pub physical: Option<TrainingErrors>,
}

/// Errors of a set of parameters on the training logs.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TrainingErrors {
    /// Relative error of the predicted torque, `100 ‖τ - τ̂‖ / ‖τ‖`, filtered, all joints stacked.
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
    /// Relative error of the predicted torque, `100 ‖τ - τ̂‖ / ‖τ‖`.
    pub relative_error_percent: Option<f64>,
}

/// Whether a set of all inertial and friction parameters is physically consistent.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PhysicalVerdict {
    /// Whether all pseudo-inertias are positive definite, and no friction or drive inertia is negative.
    pub consistent: bool,
    /// Violated conditions, in words.
    #[serde(default)]
    pub violations: Vec<String>,
    /// Which parameter set the verdict is about.
    pub note: String,
    /// Quality of the physically consistent fit; null if it was not requested or failed.
    pub fit: Option<PhysicalFitResult>,
    /// Reason for the failure of the physically consistent fit.
    pub failure: Option<String>,
    /// Bodies whose inertia in the robot description is not physically consistent. Their prior is an approximate body
    /// of ordinary mass instead.
    #[serde(default)]
    pub impossible_priors: Vec<String>,
    /// Test whether the torque has the right sign: which sign a physically consistent set explains. Null if no such set
    /// explains either sign.
    pub sign: Option<TorqueSignCheck>,
}

/// Quality of a physically consistent fit.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PhysicalFitResult {
    /// `solved`, `stalled` or `iteration-limit`. In all three cases, the result satisfies every constraint.
    pub status: String,
    /// Solver iterations.
    pub iterations: usize,
    /// Relative stationarity of the optimality certificate; zero at the exact optimum.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub stationarity: f64,
    /// Relative duality gap of the optimality certificate; zero at the exact optimum.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub duality_gap: f64,
    /// Distance of the base parameters of this fit from the unconstrained estimate, in standard deviations for white
    /// residuals.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub moved_sigma: f64,
    /// Largest change of a base parameter by the constraints, in units of its reported standard deviation.
    pub largest_move_std: Option<f64>,
    /// Test whether the logs contradict the physically consistent set; null if the test is not possible.
    #[serde(default)]
    pub difference: Option<ConsistencyTest>,
    /// Active constraints: friction or drive inertia that the fit holds at zero.
    #[serde(default)]
    pub active: Vec<String>,
    /// Physical consistency of each body.
    pub bodies: Vec<PhysicalBodyResult>,
}

/// Physical consistency of a body, with its margin.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PhysicalBodyResult {
    /// Name.
    pub name: String,
    /// Smallest eigenvalue of the pseudo-inertia, relative to the body in the robot description; positive for a
    /// consistent body.
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
    /// How well the inertial parameters of the robot description predict the torque of the log.
    pub prior_agreement: Option<PriorAgreement>,
    /// Time by which the torque of each joint is later than its motion, s, estimated with the model from this log
    /// alone; null if it is not identifiable.
    #[serde(default)]
    pub torque_lag_s: Vec<Option<f64>>,
    /// Standard deviations of the lags, s.
    #[serde(default)]
    pub torque_lag_std_s: Vec<Option<f64>>,
    /// Half-widths of the 95 % intervals of the lags, s.
    #[serde(default)]
    pub torque_lag_half_width_95_s: Vec<Option<f64>>,
    /// Velocity histogram of each joint, in the order of `robot.joints`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub velocities: Vec<VelocityHistogram>,
    /// Findings from the residuals of the model.
    #[serde(default)]
    pub model_findings: Vec<Finding>,
    /// Intervals and slow changes of the log that no single model explains; missing if there are none.
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
    /// Time for reading the robot and computing the base parameters.
    #[serde(rename = "machine")]
    pub robot: f64,
    /// Time for reducing the logs to triangular factors.
    pub logs: f64,
    /// Time for computing the estimates from the factors.
    pub estimation: f64,
    /// Time for the held-out logs.
    pub validation: f64,
    /// Total time.
    pub total: f64,
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
