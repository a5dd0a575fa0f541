//! Output of `identify`: errors of the fit, and physical consistency.

use super::numbers::number;
use dynident_estimation::consistent::ConsistencyTest;
use dynident_identification::examination::TorqueSignCheck;
use serde::{Deserialize, Serialize};

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
