//! What `simulate` writes as `truth.json`.

use super::provenance::Provenance;
use dynident_iteration::RobotStatus;
use serde::{Deserialize, Serialize};

/// Schema of `truth.json`.
pub const SIMULATION_SCHEMA: &str = "dynident/simulation/1";

/// What `truth.json` holds.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SimulationFile {
    /// [`SIMULATION_SCHEMA`].
    pub schema: String,
    /// Name of the study.
    pub name: String,
    /// Where it comes from; none in files of before it was written.
    #[serde(default)]
    pub provenance: Option<Provenance>,
    /// The controller.
    pub controller: String,
    /// How the run ended.
    pub status: RobotStatus,
    /// Whether it reached the trajectory's end.
    pub done: bool,
    /// Names of the joints, in the order of the log's columns.
    pub joints: Vec<String>,
    /// Samples of the log.
    pub samples: usize,
    /// Samples a second of the log.
    pub rate_hz: f64,
    /// For each joint the largest true distance from the trajectory, rad (m).
    pub max_tracking_error_rad: Vec<f64>,
    /// For each joint how many samples had their torque cut to its limit.
    pub saturated_samples: Vec<usize>,
    /// True bodies: ten parameters each.
    pub bodies: Vec<BodyTruth>,
    /// True parameters of the terms.
    #[serde(rename = "laws")]
    pub terms: Vec<ParameterTruth>,
    /// True base parameters.
    pub base_parameters: Vec<ParameterTruth>,
}

/// A body as it truly is.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct BodyTruth {
    /// Its name.
    pub name: String,
    /// m, m·rx, m·ry, m·rz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the link frame's origin; kg, kg m, kg m².
    pub parameters: Vec<f64>,
}

/// A parameter as it truly is.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ParameterTruth {
    /// What it is.
    pub expression: String,
    /// Value.
    pub value: f64,
    /// Unit.
    pub unit: String,
}
