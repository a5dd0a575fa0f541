//! Kinds of events, and one event.

use serde::{Deserialize, Serialize};

/// Kind of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum EventKind {
    /// The robot is at rest, and the measured torque is much smaller than the torque that carries its weight: drives
    /// off, brakes closed, emergency stop.
    DrivesOff,
    /// One joint rests at the end of its travel in the log with a torque that the motion does not need.
    JointStop,
    /// The additional torque is that of a force or a moment on one link: push, collision, hand guiding.
    Contact,
    /// The additional torque is that of other masses at the last link, to the start or the end of the log: a tool was
    /// changed, or a part was picked up.
    LoadChange,
    /// The torque of one joint has another constant offset, to the start or the end of the log.
    OffsetChange,
    /// The torque differs by a constant jump from one end of its range to the other: overflow of a number.
    Overflow,
    /// All torques follow exact straight lines: a hole in the log was filled.
    Interpolated,
    /// The offset of a torque changes slowly during the log: drift of a sensor.
    Drift,
    /// Friction changes slowly during the log: the joint warms up.
    WarmUp,
    /// No signature of the other kinds.
    Unexplained,
}

impl EventKind {
    /// Name in sentences.
    pub fn text(self) -> &'static str {
        match self {
            Self::DrivesOff => "drives off or brakes closed",
            Self::JointStop => "joint on its mechanical stop",
            Self::Contact => "contact with a link (push, collision, hand guiding)",
            Self::LoadChange => "change of the load at the last link",
            Self::OffsetChange => "change of the torque offset",
            Self::Overflow => "overflow of the logged torque",
            Self::Interpolated => "samples filled by straight lines",
            Self::Drift => "drift of the torque offset",
            Self::WarmUp => "friction that changes with time (warming up)",
            Self::Unexplained => "torque of unknown origin",
        }
    }

    /// Whether no normal operation has this signature: drives off, a stop, a filled hole. On recorded
    /// robots, errors of the model can have the signatures of the other kinds.
    pub fn is_unmistakable(self) -> bool {
        matches!(self, Self::DrivesOff | Self::JointStop | Self::Interpolated)
    }

    /// Whether the event changes the torque during the complete log, so that no interval can be left out.
    pub fn is_trend(self) -> bool {
        matches!(self, Self::Drift | Self::WarmUp)
    }
}

/// An interval of a log that the model of the rest of the log does not explain.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LogEvent {
    /// Start, s after the first data row of the file.
    pub from_s: f64,
    /// End, s after the first data row of the file.
    pub to_s: f64,
    /// Names of the joints with unexplained torque, base to tip.
    pub joints: Vec<String>,
    /// Most probable kind.
    pub kind: EventKind,
    /// A second kind with the same signature.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub alternative: Option<EventKind>,
    /// Whether the evidence is clear. Only clear events are set aside.
    pub clear: bool,
    /// Whether the torque of the joints in `affected` is left out of the fit; for a held-out log, of the second error
    /// figure.
    pub set_aside: bool,
    /// Names of the joints whose torque the event can change, base to tip. The rows of other joints remain in the fit.
    pub affected: Vec<String>,
    /// Unexplained torque in the interval (root mean square) of the joint with the strongest evidence, Nm or N.
    pub unexplained_nm: f64,
    /// Usual residual torque of the same joint outside of the interval (root mean square), Nm or N.
    pub usual_nm: f64,
    /// Share of the log's duration, from 0 to 1.
    pub share: f64,
}
