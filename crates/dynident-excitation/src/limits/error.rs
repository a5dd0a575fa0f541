//! Errors in limits that are found before a motion is searched for.

use super::kind::LimitKind;
use thiserror::Error;

/// Reason why limits cannot be used.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum LimitError {
    /// Unknown joint.
    #[error("unknown joint `{joint}` in the limits; the robot's joints are: {}", known.join(", "))]
    UnknownJoint {
        /// Name in the limits.
        joint: String,
        /// Names of the robot's joints.
        known: Vec<String>,
    },
    /// Known torque of a joint that the robot does not have.
    #[error("known torque {term} acts on a missing joint; the robot has {joints} joints")]
    TorqueOfNoJoint {
        /// Symbol of the term.
        term: String,
        /// Number of joints of the robot.
        joints: usize,
    },
    /// Two entries for one joint.
    #[error("duplicate limits of joint `{joint}`: merge the entries")]
    DuplicateJoint {
        /// Name of the joint.
        joint: String,
    },
    /// Unknown link.
    #[error("unknown link `{link}` in {what}; the robot's links are: {}", known.join(", "))]
    UnknownLink {
        /// The limit.
        what: String,
        /// Name in the limits.
        link: String,
        /// Names of the robot's links.
        known: Vec<String>,
    },
    /// A value that is not finite.
    #[error("{what} is {value}: give a finite number, or omit the limit")]
    NotFinite {
        /// The limit.
        what: String,
        /// The value.
        value: f64,
    },
    /// A limit that is not positive.
    #[error("{what} is {value}: it must be above 0 (omit it for no limit; lock a joint that must not move)")]
    NotPositive {
        /// The limit.
        what: String,
        /// The value.
        value: f64,
    },
    /// A factor that would raise limits.
    #[error("{what} is {value}: it must be at most 1 (state higher limits in `joints`)")]
    AboveOne {
        /// The factor.
        what: String,
        /// The value.
        value: f64,
    },
    /// A value outside its range.
    #[error("{what} is {value}: it must be at least {at_least} and below {below}")]
    OutOfRange {
        /// The quantity.
        what: String,
        /// Its value.
        value: f64,
        /// Minimum value.
        at_least: f64,
        /// First value above the range.
        below: f64,
    },
    /// A range whose ends are exchanged.
    #[error("{what}: the lower end {lower} exceeds the upper end {upper}: exchange them")]
    LowerAboveUpper {
        /// The range.
        what: String,
        /// Its lower end.
        lower: f64,
        /// Its upper end.
        upper: f64,
    },
    /// A position range of zero width.
    #[error("joint `{joint}` cannot leave position {position}: widen its position range, or lock the joint")]
    ZeroRange {
        /// Name of the joint.
        joint: String,
        /// Its only position, rad or m.
        position: f64,
    },
    /// A box that is too small for a point with its radius.
    #[error("{what}: the range {lower} to {upper} m is too small for a point of radius {radius_m} m")]
    NoRoom {
        /// Box, axis and point.
        what: String,
        /// Lower end, m.
        lower: f64,
        /// Upper end, m.
        upper: f64,
        /// Radius of the point, m.
        radius_m: f64,
    },
    /// An empty list of points.
    #[error("{what} has no points: list the links that it limits")]
    NoPoints {
        /// The limit.
        what: String,
    },
    /// A torque or power limit without the inertial parameters to compute torque.
    #[error(
        "joint `{joint}` has a {kind} limit, but the inertial parameters of {} are unknown: add them to the robot description (rough values with a torque margin are sufficient), or remove the limit",
        bodies.join(", ")
    )]
    MissingPrior {
        /// Name of the joint.
        joint: String,
        /// Torque or power.
        kind: LimitKind,
        /// Bodies without a prior that the joint carries.
        bodies: Vec<String>,
    },
    /// A vector of the wrong length.
    #[error("{what}: expected {expected} numbers, found {found}")]
    Length {
        /// The vector.
        what: &'static str,
        /// Required length.
        expected: usize,
        /// Given length.
        found: usize,
    },
    /// A start posture that violates a limit at rest.
    #[error("the start violates the {kind} limit of `{subject}`: {amount}; move the start or widen the limit")]
    StartOutside {
        /// Kind of the limit.
        kind: LimitKind,
        /// Joint, point or pair of links.
        subject: String,
        /// Description of the violation.
        amount: String,
    },
    /// A duration too short for a motion with rest at both ends.
    #[error(
        "a duration of {duration_s} s is too short: joint `{joint}` needs at least {shortest_s:.4} s to move {displacement} from rest to rest within its limits; lengthen the motion or raise the limits"
    )]
    TooShort {
        /// The slowest joint.
        joint: String,
        /// Requested duration, s.
        duration_s: f64,
        /// Displacement that each joint must be able to make, rad or m.
        displacement: f64,
        /// Shortest possible duration, s.
        shortest_s: f64,
    },
}
