//! Errors in limits that are found before the search for a motion.

use super::kind::LimitKind;
use thiserror::Error;

/// Reason why limits cannot be used.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum LimitError {
    /// `joints` under `[design.limits]` names a joint that the robot does not have. Use one of the listed names.
    #[error("unknown joint `{joint}` in the limits; the robot's joints are: {}", known.join(", "))]
    UnknownJoint {
        /// Name in the limits.
        joint: String,
        /// Names of the robot's joints.
        known: Vec<String>,
    },
    /// A program passed the known torque of a joint number that the robot does not have. Correct the call.
    #[error("known torque {term} acts on a missing joint; the robot has {joints} joints")]
    TorqueOfNoJoint {
        /// Symbol of the term.
        term: String,
        /// Number of joints of the robot.
        joints: usize,
    },
    /// `joints` under `[design.limits]` has two entries for one joint. Write all limits of the joint in one entry.
    #[error("duplicate limits of joint `{joint}`: merge the entries")]
    DuplicateJoint {
        /// Name of the joint.
        joint: String,
    },
    /// A limit of the workspace or of distances under `[design.limits]` names a link that the robot does not have. Use
    /// one of the listed names.
    #[error("unknown link `{link}` in {what}; the robot's links are: {}", known.join(", "))]
    UnknownLink {
        /// The limit.
        what: String,
        /// Name in the limits.
        link: String,
        /// Names of the robot's links.
        known: Vec<String>,
    },
    /// A limit is NaN or infinite. To have no limit, delete the key.
    #[error("{what} is {value}: give a finite number, or omit the limit")]
    NotFinite {
        /// The limit.
        what: String,
        /// The value.
        value: f64,
    },
    /// A limit of zero or less would forbid all motion. Delete the key for no limit, or add a joint that must not move
    /// to `lock` under `[robot]`.
    #[error("{what} is {value}: it must be above 0 (omit it for no limit; lock a joint that must not move)")]
    NotPositive {
        /// The limit.
        what: String,
        /// The value.
        value: f64,
    },
    /// The factors in `scale` under `[design.limits]` reduce the limits of the robot, so they cannot be above 1. Write
    /// higher limits for each joint in `joints`.
    #[error("{what} is {value}: it must be at most 1 (state higher limits in `joints`)")]
    AboveOne {
        /// The factor.
        what: String,
        /// The value.
        value: f64,
    },
    /// The value of this limit is outside its valid range. Write a value within the range that the message names.
    #[error("{what} is {value}: it must be at least {at_least} and below {below}")]
    OutOfRange {
        /// The quantity.
        what: String,
        /// Value of the quantity.
        value: f64,
        /// Minimum value.
        at_least: f64,
        /// First value above the range.
        below: f64,
    },
    /// The two numbers of a range are in the wrong order. Write the lower one first.
    #[error("{what}: the lower end {lower} exceeds the upper end {upper}: exchange them")]
    LowerAboveUpper {
        /// The range.
        what: String,
        /// Lower end of the range.
        lower: f64,
        /// Upper end of the range.
        upper: f64,
    },
    /// The lower and the upper position limit of the joint are equal, also after margins. Widen the range, or lock the
    /// joint.
    #[error("joint `{joint}` cannot leave position {position}: widen its position range, or lock the joint")]
    ZeroRange {
        /// Name of the joint.
        joint: String,
        /// The only allowed position, rad or m.
        position: f64,
    },
    /// The box of the workspace is smaller than the sphere around a point that must stay in it. Enlarge the box, or
    /// reduce the radius.
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
    /// A limit of the workspace lists no link. List the links that must stay inside, or delete the limit.
    #[error("{what} has no points: list the links that it limits")]
    NoPoints {
        /// The limit.
        what: String,
    },
    /// A limit of torque or power can be checked only with mass and inertia of the links, and the robot description has
    /// none for these. Rough values are sufficient.
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
    /// A list of limits must have one number for each joint. Add or remove numbers.
    #[error("{what}: expected {expected} numbers, found {found}")]
    Length {
        /// The vector.
        what: &'static str,
        /// Required length.
        expected: usize,
        /// Given length.
        found: usize,
    },
    /// The motion begins at rest at a posture that is outside a limit. Change the start posture, or widen the limit.
    #[error("the start violates the {kind} limit of `{subject}`: {amount}; move the start or widen the limit")]
    StartOutside {
        /// Kind of the limit.
        kind: LimitKind,
        /// Joint, point or pair of links.
        subject: String,
        /// Description of the size of the violation.
        amount: String,
    },
    /// The motion must begin and end at rest, and the joint cannot do so in this time. Increase `duration_s`, or raise
    /// its limits.
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
