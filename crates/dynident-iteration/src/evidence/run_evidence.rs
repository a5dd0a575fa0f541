//! Evidence in a run's log in addition to the parameters, for the assessment of an iteration.

use crate::estimation::lengths::OtherLength;
use crate::signals::oscillation::Oscillation;
use serde::{Deserialize, Serialize};

/// Evidence of one joint in the log of one run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointEvidence {
    /// Root mean square of the logged torque, Nm (N).
    pub torque_rms: f64,
    /// Standard deviation of the noise of a logged torque sample, Nm (N), without the jumps of friction at reversals:
    /// the lower quartile over short windows, octave by octave above the frequencies of the motion.
    pub torque_noise: f64,
    /// Standard deviation of the same noise in a (filtered) row of the fit, Nm (N), from its spectral density just
    /// above the frequencies of the motion.
    pub row_noise: f64,
    /// Samples at the drive's limit; `None` without saturation.
    pub clipping: Option<Clipping>,
    /// Torque oscillation far above the frequencies of the motion; `None` if there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub oscillation: Option<Oscillation>,
    /// Prediction of this run by the model of the earlier runs, before the run was fitted; `None` for the first run.
    pub prediction: Option<Prediction>,
    /// Tracking error that noise of the log, friction, lag and feedback delay explain, rad (m). It is the largest
    /// error in a simulation of the estimated robot with the same controller, whose model is the estimated robot.
    /// `None` if tracking is within the tolerance, or without a physically consistent model.
    pub tracking_floor_rad: Option<f64>,
}

/// Torque at the drive's limit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Clipping {
    /// Share of the samples, 0 to 1.
    pub share: f64,
    /// Clipped torque, Nm (N).
    pub torque: f64,
    /// Whether the torque is a given limit; otherwise it follows from constant peak torque in the log.
    pub stated: bool,
}

/// How well a model predicts a run that was not used for its fit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Prediction {
    /// Number of rows.
    pub rows: usize,
    /// Share of the rows inside the 95 % band `w θ ± 1.96 √(w V wᵀ + σ²)`, 0 to 1: w is a regressor row, V the
    /// covariance of the parameters θ, σ the noise.
    pub inside: f64,
    /// Root mean square error, Nm (N).
    pub rms_error: f64,
    /// Mean half width of the band, Nm (N).
    pub half_width: f64,
}

/// Evidence in the log of one run, joint by joint.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RunEvidence {
    /// Sampling rate of the log of each trajectory by the log's clock, Hz.
    pub log_rates_hz: Vec<f64>,
    /// Evidence of each joint.
    pub joints: Vec<JointEvidence>,
    /// Feedback delay of the controller, s, if a delay explains more than half of the tracking error. `None` if it
    /// does not, or if tracking is within the tolerance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub feedback_delay_s: Option<f64>,
    /// A link length that explains the torque of all good runs significantly better than that of the robot description;
    /// `None` otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other_length: Option<OtherLength>,
}
