//! Content of `truth.json`, an output of `simulate`.

use super::provenance::Provenance;
use dynident_iteration::RobotStatus;
use serde::{Deserialize, Serialize};

/// Name and version of the schema of `truth.json`.
pub const SIMULATION_SCHEMA: &str = "dynident/simulation/1";

/// Content of `truth.json`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SimulationFile {
    /// [`SIMULATION_SCHEMA`].
    pub schema: String,
    /// Name of the study.
    pub name: String,
    /// Provenance; null in files of earlier versions.
    #[serde(default)]
    pub provenance: Option<Provenance>,
    /// The controller.
    pub controller: String,
    /// Outcome of the run.
    pub status: RobotStatus,
    /// Whether the run reached the end of the trajectory.
    pub done: bool,
    /// Names of the joints, in the order of the log's columns.
    pub joints: Vec<String>,
    /// Samples of the log.
    pub samples: usize,
    /// Sample rate of the log, Hz.
    pub rate_hz: f64,
    /// Largest true tracking error of each joint, rad (m).
    pub max_tracking_error_rad: Vec<f64>,
    /// Number of samples with saturated torque, per joint.
    pub saturated_samples: Vec<usize>,
    /// True bodies: ten parameters each.
    pub bodies: Vec<BodyTruth>,
    /// True parameters of the friction and drive terms.
    #[serde(rename = "laws")]
    pub terms: Vec<ParameterTruth>,
    /// True base parameters.
    pub base_parameters: Vec<ParameterTruth>,
}

/// True parameters of a body.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct BodyTruth {
    /// Name.
    pub name: String,
    /// m, m·rx, m·ry, m·rz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the link frame's origin; kg, kg m, kg m².
    pub parameters: Vec<f64>,
}

/// A true parameter.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ParameterTruth {
    /// Expression.
    pub expression: String,
    /// Value.
    pub value: f64,
    /// Unit.
    pub unit: String,
}
