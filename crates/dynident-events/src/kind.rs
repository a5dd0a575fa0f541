//! Kinds of events, and the data of one event.

use serde::{Deserialize, Serialize};

/// Kind of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum EventKind {
    /// The robot is at rest, and the measured torque is much smaller than the torque that carries its weight: drives
    /// off, brakes closed, emergency stop.
    DrivesOff,
    /// One joint rests at the end of its range in the log with a torque that its motion does not require.
    JointStop,
    /// A force or a moment on one link explains the additional torque: push, collision, hand guiding.
    Contact,
    /// Other masses at the last link explain the additional torque, from the start or to the end of the log: a tool was
    /// changed, or a part was picked up.
    LoadChange,
    /// The torque of one joint has another constant offset, from the start or to the end of the log.
    OffsetChange,
    /// The torque jumps by a constant amount from one end of its range to the other: overflow of the number format.
    Overflow,
    /// All torques follow exact straight lines: a hole in the log was filled.
    Interpolated,
    /// The offset of a torque changes slowly during the log: drift of a sensor.
    Drift,
    /// Friction changes slowly during the log: the joint warms up.
    WarmUp,
    /// Unexplained torque without the shape of any other kind.
    Unexplained,
}

impl EventKind {
    /// Name of the kind in sentences.
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

    /// Whether normal operation cannot cause such torque: drives off, a stop, a filled hole. The other kinds can also
    /// result from errors of the model, as recordings of real robots show.
    pub fn is_unmistakable(self) -> bool {
        matches!(self, Self::DrivesOff | Self::JointStop | Self::Interpolated)
    }

    /// Whether the event changes the torque during the complete log, so that no interval can be excluded.
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
    /// A second kind that explains the torque equally well.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub alternative: Option<EventKind>,
    /// Whether the evidence is clear. Only clear events are excluded from the fit.
    pub clear: bool,
    /// Whether the torque of the joints in `affected` is excluded from the fit; for a held-out log, from its second
    /// error figure.
    pub set_aside: bool,
    /// Names of the joints whose torque the event can change, base to tip. The torque of other joints remains in the
    /// fit.
    pub affected: Vec<String>,
    /// Root mean square of the unexplained torque in the interval, Nm or N, for the joint with the strongest evidence.
    pub unexplained_nm: f64,
    /// Root mean square residual of the same joint outside the interval, Nm or N.
    pub usual_nm: f64,
    /// Duration of the event divided by the duration of the log, from 0 to 1.
    pub share: f64,
}
