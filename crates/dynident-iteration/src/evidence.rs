//! What a run's log shows beside parameters: what the verdict on an iteration rests on.

use crate::lengths::OtherLength;
use crate::oscillation::Oscillation;
use serde::{Deserialize, Serialize};

/// What the log of one run shows of one joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointEvidence {
    /// Root mean square of the logged torque, Nm (N).
    pub torque_rms: f64,
    /// Standard deviation of the noise that one logged torque has, Nm (N), without steps of friction: the lower
    /// quartile over short windows, octave by octave above the motion.
    pub torque_noise: f64,
    /// Standard deviation of the same noise in a row of the fit, Nm (N), by its density just above the motion.
    pub row_noise: f64,
    /// Samples at the drive's limit; none where no torque stands still at its largest.
    pub clipping: Option<Clipping>,
    /// Torque that oscillates far above the motion's frequencies; none where it does not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub oscillation: Option<Oscillation>,
    /// What the model of the runs before says of this run, before it was fitted to; none for the first.
    pub prediction: Option<Prediction>,
    /// The distance from the trajectory that the noise of the log, the friction found, the measured lag and the
    /// feedback's delay explain, rad (m): the largest of a run that is simulated with the robot found and the same
    /// controller with that robot as its model. None where tracking is inside the tolerance, and where there is no
    /// physically consistent robot.
    pub tracking_floor_rad: Option<f64>,
}

/// Torque that stands at the drive's limit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Clipping {
    /// Share of the samples, 0 to 1.
    pub share: f64,
    /// The torque, Nm (N).
    pub torque: f64,
    /// Whether it is a stated limit; otherwise the log alone shows it: its largest torques are all the same.
    pub stated: bool,
}

/// How well a model predicts a run that it was not fitted to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Prediction {
    /// Rows that count.
    pub rows: usize,
    /// Share of them inside the 95 % band `W θ ± 1.96 √(w V wᵀ + σ²)`, 0 to 1.
    pub inside: f64,
    /// Root mean square error, Nm (N).
    pub rms_error: f64,
    /// Mean half width of the band, Nm (N).
    pub half_width: f64,
}

/// What the log of one run shows, joint by joint.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RunEvidence {
    /// Samples a second of each leg's log, by its own clock.
    pub log_rates_hz: Vec<f64>,
    /// The joints.
    pub joints: Vec<JointEvidence>,
    /// How late the controller saw positions, s: the delay that explains more than half of the tracking error. None
    /// where no delay does, and where tracking is inside the tolerance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub feedback_delay_s: Option<f64>,
    /// A length that is not the description's, by the torque of all good runs so far; none where no length explains
    /// clearly more.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other_length: Option<OtherLength>,
}
