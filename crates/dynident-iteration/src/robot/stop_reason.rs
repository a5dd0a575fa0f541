use super::ways::RunPart;
use serde::{Deserialize, Serialize};

/// A violated limit of the envelope.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Breach {
    /// The joint, or the link of which a point is outside the workspace.
    pub joint: String,
    /// Limited quantity.
    pub quantity: EnvelopeQuantity,
    /// Value of the quantity, in rad, rad/s, Nm (m, m/s, N).
    pub value: f64,
    /// The limit.
    pub limit: f64,
    /// Time since the beginning of the part, s.
    pub time_s: f64,
    /// The part of the run; always the motion if there are no approach and return paths.
    #[serde(default, skip_serializing_if = "RunPart::is_motion")]
    pub part: RunPart,
}

impl core::fmt::Display for Breach {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { joint, quantity, value, limit, time_s, part } = self;
        let of = if part.is_motion() { String::new() } else { format!(" of the {}", part.name()) };
        write!(f, "{} of {joint} is {value:.4} at {time_s:.3} s{of}, limit {limit:.4}", quantity.name())
    }
}

#[derive(Debug)]
pub(super) struct SampleBreach {
    pub(super) name: String,
    pub(super) quantity: EnvelopeQuantity,
    pub(super) value: f64,
    pub(super) limit: f64,
}

impl SampleBreach {
    pub(super) fn breach(self, time_s: f64) -> Breach {
        let Self { name, quantity, value, limit } = self;
        Breach { joint: name, quantity, value, limit, time_s, part: RunPart::Motion }
    }
}

/// A joint that oscillates about its trajectory.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointOscillation {
    /// The joint.
    pub joint: String,
    /// Frequency of the oscillation, Hz.
    pub frequency_hz: f64,
    /// Amplitude of the velocity relative to the velocity of the trajectory, rad/s (m/s).
    pub amplitude: f64,
    /// Time of the detection since the beginning of the part, s.
    pub time_s: f64,
    /// The part of the run; always the motion if there are no approach and return paths.
    #[serde(default, skip_serializing_if = "RunPart::is_motion")]
    pub part: RunPart,
}

impl core::fmt::Display for JointOscillation {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { joint, frequency_hz, amplitude, time_s, part } = self;
        let of = if part.is_motion() { String::new() } else { format!(" of the {}", part.name()) };
        write!(
            f,
            "joint {joint} oscillates at {frequency_hz:.0} Hz, with {amplitude:.3} rad/s (m/s) at {time_s:.3} s{of}: its \
             loop is too fast for its inertia and its delay; give this joint a lower bandwidth_hz in [iteration] (a list \
             has one number for each joint), or lower gains where kp and kd are stated"
        )
    }
}

/// Quantity that an envelope limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum EnvelopeQuantity {
    /// Position, rad (m).
    Position,
    /// Velocity, rad/s (m/s).
    Speed,
    /// Torque, Nm (N).
    Torque,
    /// Tracking error, rad (m).
    TrackingError,
    /// Coordinate x of a point in the base frame, m.
    X,
    /// Coordinate y of a point in the base frame, m.
    Y,
    /// Coordinate z (height) of a point in the base frame, m.
    Z,
}

impl EnvelopeQuantity {
    /// Name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Speed => "speed",
            Self::Torque => "torque",
            Self::TrackingError => "tracking error",
            Self::X => "x",
            Self::Y => "y",
            Self::Z => "z",
        }
    }
}

/// Result of a stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Stopping {
    /// The robot's program confirmed that the robot is at rest, or no motion had begun.
    Confirmed,
    /// The program did not answer in time and was killed; the robot may still be moving.
    Unanswered,
    /// The program ended, or reported the end of its run, without an answer to the stop; the robot may still be moving.
    Unknown,
    /// Detected afterwards in the log; no stop was possible.
    SeenAfterwards,
}

impl Stopping {
    /// Whether the robot may still be moving.
    pub(crate) fn is_open(self) -> bool {
        matches!(self, Self::Unanswered | Self::Unknown)
    }
}

impl core::fmt::Display for Stopping {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Confirmed => write!(f, "the robot has stopped"),
            Self::Unanswered => {
                write!(
                    f,
                    "its program did not answer the stop and was killed: the robot may still be moving, check it first"
                )
            }
            Self::Unknown => {
                write!(f, "the stop was not confirmed: the robot may still be moving, check it first")
            }
            Self::SeenAfterwards => write!(
                f,
                "detected in the log after the run; if the log is wrong, correct the file and repeat the command"
            ),
        }
    }
}
