//! Result of `design` for servo drives with a position controller.

use crate::provenance::Provenance;
use dynident_excitation::check::LimitReport;
use serde::{Deserialize, Serialize};

/// Name and version of the schema of [`ServoDesignFile`].
pub const SERVO_DESIGN_SCHEMA: &str = "dynident/servo-design/1";

/// Commands that determine drives and bodies, with the expected error bars.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ServoDesignFile {
    /// [`SERVO_DESIGN_SCHEMA`].
    pub schema: String,
    /// Name of the study.
    pub study: String,
    /// Name of the robot.
    pub robot: String,
    /// Names of the joints, in the order of the columns.
    pub joints: Vec<String>,
    /// Duration of the commands, s.
    pub duration_s: f64,
    /// Rate of the commands, Hz.
    pub rate_hz: f64,
    /// Seed of the random candidates.
    pub seed: u64,
    /// Number of simulated candidate motions.
    pub evaluations: usize,
    /// Expected standard deviation of the difference between simulated and measured position, rad (m).
    pub expected_error: f64,
    /// Time over which errors of the simulation are correlated, s.
    pub correlation_s: f64,
    /// Whether the simulated motion satisfies all limits.
    pub feasible: bool,
    /// Every limit, with the largest value of the simulated motion relative to it.
    pub limits: Vec<LimitReport>,
    /// Assumed limits that the study does not state, in words.
    pub assumed: Vec<String>,
    /// Possible violations that no limit covers, in words.
    pub not_checked: Vec<String>,
    /// Logarithm of the determinant of the information matrix, including priors.
    pub log_det: f64,
    /// `log_det` for a chirp (sine of rising frequency) of all joints with the same length, range, speed and highest
    /// frequency.
    pub chirp_log_det: f64,
    /// Expected error bar divided by the expected error bar of the chirp, geometric mean over all values; the common
    /// factor of torques, inertias and masses is assumed known.
    pub error_bars_to_chirp: f64,
    /// Expected values of the drive of each joint.
    pub drives: Vec<ServoForecast>,
    /// Expected values of each moving body.
    pub bodies: Vec<ServoForecast>,
    /// Values that the motion will not determine, in words.
    pub not_determined: Vec<String>,
    /// Remarks, in words.
    pub notes: Vec<String>,
    /// Input files, program version and command of the result.
    pub provenance: Option<Provenance>,
    /// Computing time, s.
    pub seconds: f64,
}

/// Expected error bars of a joint or body.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ServoForecast {
    /// Name of the joint or body.
    pub name: String,
    /// Values of the joint or body with expected error bars.
    pub values: Vec<ServoForecastValue>,
}

/// A value with its expected error bar.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ServoForecastValue {
    /// Name in words.
    pub name: String,
    /// Unit; empty for a number without unit.
    pub unit: String,
    /// The assumed value.
    pub value: f64,
    /// Expected half-width of the 95 % interval.
    pub half_width_95: f64,
    /// Expected half-width of the 95 % interval if the common factor of torques, inertias and masses were known.
    pub half_width_95_at_scale: f64,
    /// Half-width of the 95 % interval before the fit.
    pub half_width_95_before: f64,
    /// Expected half-width of the 95 % interval for the chirp instead of the designed motion, if the common factor were
    /// known.
    pub half_width_95_chirp: f64,
    /// Whether the motion will determine the value: the expected interval is at most half as wide as before the fit.
    pub determined: bool,
}
