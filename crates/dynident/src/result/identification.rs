//! What `identify` writes: the schema of `result.json`.

use super::check::StudyCheck;
use super::error_terms::ErrorTermResult;
use super::forms::{FormResult, StoredModel};
use super::numbers::{number, rows};
use super::provenance::Provenance;
use crate::study::JointDrive;
use dynident_estimation::consistent::ConsistencyTest;
use dynident_estimation::{CorrelatedPair, EssentialReport};
use dynident_identification::consistent::ParameterInterval;
use dynident_identification::estimators::{
    GrossErrors, NoiseInRegressor, PeriodicFit, SeriesFit, SimulatedFit, SplineFit,
};
use dynident_identification::examination::{
    LagChoice, LogValidation, PriorAgreement, TorqueBand, TorqueLag, TorqueSignCheck,
};
use dynident_identification::friction::{FrictionCandidate, FrictionConstant};
use dynident_identification::payload::{DriveGain, PayloadResult};
use dynident_identification::rows::VelocityHistogram;
use dynident_identification::{BetweenLogs, Condition, CutoffByError, DriveInertiaChoice, Role};
use dynident_recording::{Finding, ImportReport, MotionSettings};
use serde::{Deserialize, Serialize};

/// Name and version of the schema. Fields are added, never renamed, within a version.
pub const RESULT_SCHEMA: &str = "dynident/result/1";

/// A finished identification.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ResultFile {
    /// [`RESULT_SCHEMA`].
    pub schema: String,
    /// Name of the study.
    pub name: String,
    /// Everything that speaks against loading the model that was written into a robot, a sentence each; empty where
    /// nothing does.
    #[serde(default)]
    pub problems: Vec<String>,
    /// Where it comes from; none in results of before 0.1.
    #[serde(default)]
    pub provenance: Option<Provenance>,
    /// The robot.
    pub robot: RobotSummary,
    /// How the fit was made.
    pub method: MethodSummary,
    /// Whether noise in the regressor biases least squares; none where that cannot be tested.
    pub noise_in_regressor: Option<NoiseInRegressor>,
    /// Rows that a robust estimator gave little weight; none for other estimators.
    pub gross_errors: Option<GrossErrors>,
    /// Correlations of the joints' errors at one instant, in the order of `robot.joints`; none unless the estimator is
    /// `generalized`.
    pub noise_correlation: Option<Vec<Vec<f64>>>,
    /// For each joint the smallest and the largest noise level of its rows over its mean one; none unless the estimator
    /// is `noise-weighted`.
    pub noise_levels: Option<Vec<[f64; 2]>>,
    /// Periods and their noise; none unless the estimator is `maximum-likelihood`.
    pub periodic: Option<PeriodicFit>,
    /// Motion and noise of every training log; only with the estimator `simultaneous` and a period.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub series: Option<Vec<SeriesFit>>,
    /// Motion, a smoothing spline, and noise of every training log; only with the estimator `simultaneous` without a
    /// period.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spline_motion: Option<SplineFit>,
    /// The simulated loop; none unless the estimator is `didim`, `clie` or `cloe`.
    pub simulated: Option<SimulatedFit>,
    /// The base parameters, in the order of the tree.
    pub base_parameters: Vec<BaseParameterResult>,
    /// Covariance of the base parameters by the method's own account, rows and columns in their order, symmetric; zero
    /// where a parameter is not excited.
    #[serde(default, deserialize_with = "rows")]
    #[cfg_attr(feature = "schema", schemars(with = "Vec<Vec<Option<f64>>>"))]
    pub base_parameter_covariance: Vec<Vec<f64>>,
    /// The bodies: one of the full sets that give these base parameters, the nearest to the prior.
    pub bodies: Vec<BodyResult>,
    /// How far every parameter of a body or term could go in a physically consistent set that the data do not reject;
    /// none unless asked for.
    pub possible_intervals: Option<Vec<ParameterInterval>>,
    /// What was held at zero because the data hardly determine it; none unless asked for.
    pub essential: Option<EssentialReport>,
    /// The strongest correlations between estimates, strongest first.
    #[serde(default)]
    pub correlations: Vec<CorrelatedPair>,
    /// Friction and drives.
    pub joints: Vec<JointResult>,
    /// Whether the logs show the inertia of the drives, for the joints where no key states it; none where keys state it
    /// for all of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drive_inertia_choice: Option<DriveInertiaChoice>,
    /// How friction was chosen, for the joints where the study asks for it.
    #[serde(default)]
    pub friction_choice: Vec<JointFrictionResult>,
    /// The identified robot for `dynident export`, which needs no study with it; `None` for payloads on a known arm, for
    /// bodies with unknown parameters, and in results of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<StoredModel>,
    /// The model in each class of forms that `dynident export` writes, with its own held-out error; empty for payloads
    /// on a known arm, with unknown gains, and in results of older versions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub forms: Vec<FormResult>,
    /// Payloads that were estimated.
    #[serde(default)]
    pub payloads: Vec<PayloadResult>,
    /// Offsets log by log; empty unless the study asks for them. The base parameters hold their mean.
    #[serde(default)]
    pub offsets: Vec<LogOffset>,
    /// Drive gains, joint by joint; none unless the study says that they are unknown.
    pub drive_gains: Option<Vec<DriveGain>>,
    /// Drives that turn with two joints.
    #[serde(default)]
    pub couplings: Vec<TermResult>,
    /// The fit on the logs that it was made from.
    pub training: TrainingResult,
    /// The test on logs that were not used.
    #[serde(default)]
    pub validation: Vec<LogValidation>,
    /// How well the 95 % band of the predicted torque holds on held-out logs.
    #[serde(default)]
    pub torque_band: Vec<TorqueBand>,
    /// Whether the full set is physically consistent.
    pub physical: PhysicalVerdict,
    /// What the importer found in each log.
    pub logs: Vec<LogSummary>,
    /// Whether another reading of the logs explains them better; none where there was no reason to ask.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub check: Option<StudyCheck>,
    /// Why there is no identified.urdf; none when there is one.
    pub no_urdf: Option<String>,
    /// Why there is no identified.xml although the description is an MJCF and there is an identified.urdf.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub no_mjcf: Option<String>,
    /// Why there is no identified.sdf although the description is an SDF and there is an identified.urdf.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub no_sdf: Option<String>,
    /// Where the time went.
    pub timings_s: Timings,
}

/// The robot of a result.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RobotSummary {
    /// Its name.
    pub name: String,
    /// The description, seen from the study's folder.
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

/// How a fit was made.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct MethodSummary {
    /// The study's `estimator.method`; of `auto` the one that it took, `weighted` or `instrumental`.
    pub estimator: String,
    /// `complete`, `not-all-excited` or `iteration-limit`.
    pub status: String,
    /// Solutions made.
    pub iterations: usize,
    /// Parts of the study that were a caller's own code, each with the name of its function: the result can be made
    /// again, and used where it needs them, only with that code.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub functions: Vec<String>,
    /// What the error bars account for.
    pub covariance: String,
    /// Time segments behind the covariance.
    pub clusters: usize,
    /// From positions to accelerations, with the cut-off in force for all logs.
    pub motion: MotionSettings,
    /// How that cut-off was chosen; none where the study states it, or the logs are too short to try any.
    #[serde(default)]
    pub cutoff: Option<CutoffByError>,
    /// The lag of the torque behind the motion: what was taken off before the fit, and how well it is known.
    #[serde(default)]
    pub torque_lag: LagChoice,
    /// By how much the parameters of two training logs differ, in units of what the logs' own error bars allow; the
    /// bars of `base_parameters` hold what is beyond. None for a single log.
    #[serde(default)]
    pub between_logs: Option<BetweenLogs>,
    /// Held-out figures are for the torque below 0.7 of this, the cut-off that the motion's spectrum asks for; none
    /// where they are for the fit's own band.
    #[serde(default)]
    pub motion_hz: Option<f64>,
    /// Condition number of the weighted regressor's base columns.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub condition_number: f64,
    /// The same after each column was divided by its norm.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub condition_number_scaled: f64,
    /// How the base columns were chosen.
    pub base_columns: String,
    /// Smallest share of a column that counted as independent, largest that counted as dependent.
    pub base_gap: [f64; 2],
    /// Base parameters that the data do not excite; they were held at the prior (or zero).
    #[serde(default)]
    pub not_excited: Vec<String>,
    /// Declared torques that the other parameters' torques are already, in words: their coefficients stay near the
    /// nominal values.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub coincident: Vec<String>,
    /// Joints that no training log moves above the noise of their positions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub resting_joints: Vec<String>,
    /// How well stated gains are known, one standard deviation in percent, as the bars of payloads hold it; none where
    /// they count as exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_std_percent: Option<f64>,
    /// With load-dependent friction: the base parameters, by the estimate without it, whose torque is the load.
    pub load_parameters: Option<Vec<f64>>,
}

impl MethodSummary {
    /// Whether the estimator's values had settled before its iterations were used up.
    pub fn is_settled(&self) -> bool {
        self.status != "iteration-limit"
    }
}

/// One base parameter.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct BaseParameterResult {
    /// Symbol of its own column: `Izz1`.
    pub symbol: String,
    /// What it sums: `Izz1 + 0.49 m2`.
    pub expression: String,
    /// Its unit at a revolute joint.
    pub unit: String,
    /// The estimate.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub value: f64,
    /// Its standard deviation, by the method's covariance.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub std: f64,
    /// The same if residuals were white: what a naive tool would print.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub std_white: f64,
    /// Half the width of the 95 % interval.
    #[serde(default, deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub half_width_95: f64,
    /// `100 std / |value|`.
    pub relative_std_percent: Option<f64>,
    /// By the description's own numbers.
    pub prior: Option<f64>,
    /// Of the physically consistent set in `bodies` and `joints`; none when that was not asked for.
    #[serde(default)]
    pub physical: Option<f64>,
    /// The parameters at nominal that its value hangs on, the strongest first: right only if they are. Empty for one
    /// that the logs tell on its own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub conditional_on: Vec<Condition>,
    /// Half the width of the 95 % interval with what those may be wrong by (masses by 30 %, and so on); of one that is
    /// not excited, what its nominal value may be wrong by. None where the logs tell it on their own, and where there
    /// are no nominal values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_width_95_with_nominal: Option<f64>,
    /// Standard deviation by source of error, where there is more than the noise: their squares add up to the square of
    /// the whole. Empty for a parameter that is not excited.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub error_terms: Vec<ErrorTermResult>,
    /// False when the data do not excite it; value is then the prior's and std means nothing.
    pub excited: bool,
}

impl BaseParameterResult {
    /// The largest source of error and its share of the variance; none where the noise is the only source, and for a
    /// parameter that is not excited.
    pub fn largest_error(&self) -> Option<(&ErrorTermResult, f64)> {
        let largest = self.error_terms.iter().max_by(|one, other| one.std.total_cmp(&other.std))?;
        let variance: f64 = self.error_terms.iter().map(|term| term.std * term.std).sum();
        Some((largest, largest.std * largest.std / variance))
    }

    /// `100 bar_95 / |value|`; none for a value of zero and for what the data do not excite.
    pub fn relative_half_width_percent(&self) -> Option<f64> {
        (self.excited && self.value != 0.0).then(|| 100.0 * self.bar_95() / self.value.abs())
    }

    /// Half the width of the 95 % interval that holds whatever the parameters at nominal are, as far as a description
    /// can be wrong.
    pub fn bar_95(&self) -> f64 {
        self.half_width_95_with_nominal.unwrap_or(self.half_width_95)
    }
}

/// One body of the full set.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct BodyResult {
    /// Name of its own link.
    pub name: String,
    /// All links lumped into it.
    pub links: Vec<String>,
    /// Mass.
    pub mass_kg: f64,
    /// Centre of mass in the body frame; none for a body without mass.
    pub com_m: Option<[f64; 3]>,
    /// Inertia about the body frame's origin: xx, xy, xz, yy, yz, zz.
    pub inertia_at_origin_kgm2: [f64; 6],
    /// All ten, in the project's order.
    pub parameters: [f64; 10],
    /// The description's own ten; none when unknown.
    pub prior: Option<[f64; 10]>,
    /// Smallest eigenvalue of the pseudo-inertia: positive for a consistent body.
    pub pseudo_inertia_min_eigenvalue: f64,
    /// For each of the ten whether torque told it; none in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sources: Option<[ValueSource; 10]>,
    /// Standard deviation of each of the ten, by the logs and the description together, if the description is right
    /// within 30 %: of a value that torque tells by itself that of the logs, of one that is in no torque that of the
    /// description. None for a body that is not described, and where bodies are not the physically consistent set's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub std: Option<[f64; 10]>,
}

/// Where a body's value comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum ValueSource {
    /// Torque tells it by itself.
    Measured,
    /// Torque tells sums of it with others; shared out so that it stays near the description's.
    Partly,
    /// Torque does not tell it: near the description's, as far as a consistent body allows.
    Nominal,
}

/// A parameter of a term.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TermResult {
    /// Its symbol.
    pub symbol: String,
    /// Its unit at a revolute joint.
    pub unit: String,
    /// Its value in the full set of `bodies`: the physically consistent one unless `estimator.physical` is false.
    pub value: f64,
    /// Standard deviation of the unconstrained estimate; none where it is not a base parameter by itself.
    pub std: Option<f64>,
    /// The base parameter that it stands in.
    pub base_parameter: Option<String>,
    /// What a declared torque follows, with joints by their numbers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub law: Option<String>,
}

/// Friction and drive of one joint.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointResult {
    /// The joint.
    pub name: String,
    /// Its terms.
    #[serde(rename = "laws")]
    pub terms: Vec<TermResult>,
    /// Standard deviation of its filtered residual, Nm (N).
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub residual_std_nm: f64,
    /// How strongly its residual is correlated in time: the lag-1 correlation that matters for the error bars.
    pub residual_correlation: Option<f64>,
    /// Lag of its torque behind the motion by all training logs, what was taken off included; none where they do not
    /// determine one. It matters where what is left of it does.
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
    /// What it differs from the mean over the training logs, Nm (N).
    pub deviation_nm: f64,
    /// The deviation's standard deviation.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub std_nm: f64,
}

/// Figures of the fit on its own data.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TrainingResult {
    /// The logs.
    pub logs: Vec<String>,
    /// Filtered rows of each joint.
    pub samples: usize,
    /// `100 ‖τ - τ̂‖ / ‖τ‖`, filtered, all joints stacked.
    pub relative_error_percent: Option<f64>,
    /// Joint by joint.
    pub joints: Vec<TrainingJoint>,
    /// The same of the physically consistent set, which is what is written; none without one.
    #[serde(default)]
    pub physical: Option<TrainingErrors>,
}

/// Errors of a set of parameters on the logs that were fitted to.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TrainingErrors {
    /// `100 ‖τ - τ̂‖ / ‖τ‖`, filtered, all joints stacked.
    pub relative_error_percent: Option<f64>,
    /// Joint by joint.
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
    /// What is not.
    #[serde(default)]
    pub violations: Vec<String>,
    /// What the verdict is about.
    pub note: String,
    /// The physically consistent fit behind the bodies; none when it was not asked for or failed.
    pub fit: Option<PhysicalFitResult>,
    /// Why it failed.
    pub failure: Option<String>,
    /// Bodies whose description is no consistent body, so that a rough one of ordinary mass stands in as their prior.
    #[serde(default)]
    pub impossible_priors: Vec<String>,
    /// Which sign of the torque a physically consistent set explains; none without a physically consistent set for
    /// either.
    pub sign: Option<TorqueSignCheck>,
}

/// A physically consistent fit.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PhysicalFitResult {
    /// `solved`, `stalled` or `iteration-limit`; all of them meet every constraint.
    pub status: String,
    /// Iterations of the solver.
    pub iterations: usize,
    /// Stationarity of its certificate, relative.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub stationarity: f64,
    /// Duality gap of its certificate, relative.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub duality_gap: f64,
    /// How far the base parameters moved from the estimate in all, in standard deviations of white residuals.
    #[serde(deserialize_with = "number")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<f64>"))]
    pub moved_sigma: f64,
    /// The largest move of a base parameter in units of its reported standard deviation.
    pub largest_move_std: Option<f64>,
    /// Whether the logs contradict the consistent set: the distance tested; none where it cannot be.
    #[serde(default)]
    pub difference: Option<ConsistencyTest>,
    /// Limits that hold with equality and push: friction or drive inertia at zero.
    #[serde(default)]
    pub active: Vec<String>,
    /// Body by body.
    pub bodies: Vec<PhysicalBodyResult>,
}

/// Whether a body is physically consistent, and by what margin.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PhysicalBodyResult {
    /// Its name.
    pub name: String,
    /// Smallest eigenvalue of its pseudo-inertia in units of the description's body.
    pub margin: f64,
    /// Whether the data want it outside of what is physically consistent.
    pub on_the_boundary: bool,
}

/// What is known of a log.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LogSummary {
    /// Its name.
    pub log: String,
    /// `identify` or `validate`.
    pub role: Role,
    /// The importer's report.
    pub import: ImportReport,
    /// Cut-off of the differentiator in force.
    pub motion_cutoff_hz: Option<f64>,
    /// Cut-off of the parallel filter.
    pub filter_cutoff_hz: Option<f64>,
    /// Rate of the filtered rows.
    pub filtered_rate_hz: f64,
    /// Filtered rows of each joint.
    pub filtered_rows: u64,
    /// The log against the description's own inertials.
    pub prior_agreement: Option<PriorAgreement>,
    /// Lag of torque behind motion by joint, seconds, estimated together with the model from this log alone; none where
    /// the log does not determine.
    #[serde(default)]
    pub torque_lag_s: Vec<Option<f64>>,
    /// Standard deviations of the lags.
    #[serde(default)]
    pub torque_lag_std_s: Vec<Option<f64>>,
    /// Half the widths of their 95 % intervals.
    #[serde(default)]
    pub torque_lag_half_width_95_s: Vec<Option<f64>>,
    /// How often each joint moved at which velocity, in the order of `robot.joints`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub velocities: Vec<VelocityHistogram>,
    /// What follows from both.
    #[serde(default)]
    pub model_findings: Vec<Finding>,
}

/// When it was made, and where the time went, in seconds: all that is not the same when it is made again.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Timings {
    /// When it was made, by the computer's clock, in universal time: `2026-11-22T10:30:13Z`.
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
    /// All of it.
    pub total: f64,
}

/// How the friction of one joint was chosen.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointFrictionResult {
    /// The joint.
    pub joint: String,
    /// What was chosen, or why nothing was: the study's own keys then stay in force.
    pub chosen: String,
    /// The choice as keys of `[drive.joints.NAME]`; none when nothing was chosen.
    pub drive: Option<JointDrive>,
    /// The constants of the chosen terms, estimated together with all parameters; none where they were stated.
    #[serde(default)]
    pub constants: Vec<FrictionConstant>,
    /// Blocks of time that were left out in turn.
    pub folds: usize,
    /// The candidates that were compared, each with its best constants.
    pub candidates: Vec<FrictionCandidate>,
}
