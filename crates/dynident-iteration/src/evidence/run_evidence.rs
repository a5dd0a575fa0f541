//! Evidence in a run's log in addition to the parameters, for the verdict on an iteration.

use crate::estimation::lengths::OtherLength;
use crate::signals::oscillation::Oscillation;
use serde::{Deserialize, Serialize};

/// Evidence of one joint in the log of one run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointEvidence {
    /// Root mean square of the logged torque, Nm (N).
    pub torque_rms: f64,
    /// Standard deviation of the noise of a logged torque sample, Nm (N), without friction steps: the lower quartile
    /// over short windows, octave by octave above the motion.
    pub torque_noise: f64,
    /// Standard deviation of the same noise in a row of the fit, Nm (N), from its density just above the motion.
    pub row_noise: f64,
    /// Samples at the drive's limit; `None` without saturation.
    pub clipping: Option<Clipping>,
    /// Torque oscillation far above the frequencies of the motion; `None` otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub oscillation: Option<Oscillation>,
    /// Prediction of this run by the model of the earlier runs, before the run was fitted; `None` for the first.
    pub prediction: Option<Prediction>,
    /// Tracking error that the noise of the log, the friction, the lag and the feedback delay explain, rad (m): the
    /// largest error of a simulated run with the estimated robot and the same controller with that robot as its model.
    /// `None` if tracking is within the tolerance, or without a physically consistent model.
    pub tracking_floor_rad: Option<f64>,
}

/// Torque at the drive's limit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Clipping {
    /// Share of the samples, 0 to 1.
    pub share: f64,
    /// The torque, Nm (N).
    pub torque: f64,
    /// Whether it is a stated limit; otherwise it follows from constant peak torque in the log.
    pub stated: bool,
}

/// How well a model predicts a run that was not used for its fit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Prediction {
    /// Number of rows.
    pub rows: usize,
    /// Share of them inside the 95 % band `W θ ± 1.96 √(w V wᵀ + σ²)`, 0 to 1.
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
    /// Sample rate of each leg's log by its own clock, Hz.
    pub log_rates_hz: Vec<f64>,
    /// The joints.
    pub joints: Vec<JointEvidence>,
    /// Feedback delay of the controller, s, if a delay explains more than half of the tracking error; `None` otherwise,
    /// or if tracking is within the tolerance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub feedback_delay_s: Option<f64>,
    /// A link length that explains the torque of all good runs significantly better than that of the robot description;
    /// `None` otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other_length: Option<OtherLength>,
}
