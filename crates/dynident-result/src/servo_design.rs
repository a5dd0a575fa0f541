//! Result of `design` for drives with a position controller.

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
    /// Number of simulated candidates.
    pub evaluations: usize,
    /// Expected standard deviation of the simulation's error, rad (m).
    pub expected_error: f64,
    /// Time in which these errors are alike, s.
    pub correlation_s: f64,
    /// Whether the simulated motion keeps all limits.
    pub feasible: bool,
    /// Use of each limit by the simulated motion.
    pub limits: Vec<LimitReport>,
    /// Assumed limits, in words.
    pub assumed: Vec<String>,
    /// Possible violations that no limit covers, in words.
    pub not_checked: Vec<String>,
    /// Logarithm of the determinant of information and priors.
    pub log_det: f64,
    /// The same of a chirp of all joints with the same length, range, speed and highest frequency.
    pub chirp_log_det: f64,
    /// Geometric mean over all values: expected error bar divided by that of the chirp, at a known scale.
    pub error_bars_to_chirp: f64,
    /// Expected values of the drive of each joint.
    pub drives: Vec<ServoForecast>,
    /// Expected values of each moving body.
    pub bodies: Vec<ServoForecast>,
    /// Values that the motion will not determine, in words.
    pub not_determined: Vec<String>,
    /// Remarks, in words.
    pub notes: Vec<String>,
    /// The files that the result comes from, program and command.
    pub provenance: Option<Provenance>,
    /// Computing time, s.
    pub seconds: f64,
}

/// Expected values of a joint or body.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ServoForecast {
    /// Name of the joint or body.
    pub name: String,
    /// Its values.
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
    /// The same if the scale were known.
    pub half_width_95_at_scale: f64,
    /// The same before the fit.
    pub half_width_95_before: f64,
    /// The same as `half_width_95_at_scale` for the chirp.
    pub half_width_95_chirp: f64,
    /// Whether the motion will determine it: the interval is at most half of that before the fit.
    pub determined: bool,
}
