//! Output of `identify`: the schema of `result.json`.

use super::check::StudyCheck;
use super::comparison::DescriptionComparison;
use super::fit::{PhysicalVerdict, TrainingResult};
use super::forms::{FormResult, StoredModel};
use super::method::{LogSummary, MethodSummary, RobotSummary, Timings};
use super::numbers::rows;
use super::parameters::{BaseParameterResult, BodyResult, JointFrictionResult, JointResult, LogOffset, TermResult};
use super::provenance::Provenance;
use dynident_estimation::{CorrelatedPair, EssentialReport};
use dynident_identification::DriveInertiaChoice;
use dynident_identification::consistent::ParameterInterval;
use dynident_identification::estimators::{
    GrossErrors, NoiseInRegressor, PeriodicFit, SeriesFit, SimulatedFit, SplineFit,
};
use dynident_identification::examination::{LogValidation, TorqueBand};
use dynident_identification::payload::{DriveGain, PayloadResult};
use dynident_study::ReportThresholds;
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
