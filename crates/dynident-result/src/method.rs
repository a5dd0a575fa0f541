//! Output of `identify`: robot, method, logs and computing times.

use super::numbers::number;
use dynident_identification::examination::{LagChoice, PriorAgreement};
use dynident_identification::rows::VelocityHistogram;
use dynident_identification::{CutoffByError, LogEvent, LogVariation, Role};
use dynident_recording::{Finding, ImportReport, MotionSettings};
use serde::{Deserialize, Serialize};

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
