//! What can be wrong with limits before any motion is looked for.

use super::kind::LimitKind;
use thiserror::Error;

/// Why limits cannot be used.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum LimitError {
    /// A joint that the robot does not have.
    #[error("limits name joint `{joint}`, which the robot does not have; its joints are: {}", known.join(", "))]
    UnknownJoint {
        /// The name.
        joint: String,
        /// The names that exist.
        known: Vec<String>,
    },
    /// Known torque of a joint that the robot does not have.
    #[error("known torque {term} acts on a joint that the robot of {joints} joints does not have")]
    TorqueOfNoJoint {
        /// The term's symbol.
        term: String,
        /// Joints of the robot.
        joints: usize,
    },
    /// Two entries for one joint.
    #[error("limits name joint `{joint}` twice: join the entries into one")]
    DuplicateJoint {
        /// The name.
        joint: String,
    },
    /// A link that the robot does not have.
    #[error("{what} names link `{link}`, which the robot does not have; its links are: {}", known.join(", "))]
    UnknownLink {
        /// Which limit.
        what: String,
        /// The name.
        link: String,
        /// The names that exist.
        known: Vec<String>,
    },
    /// A NaN or an infinite number.
    #[error("{what} is {value}: give a finite number, or leave the limit out for none")]
    NotFinite {
        /// Which limit.
        what: String,
        /// The number.
        value: f64,
    },
    /// A limit at or below zero, which nothing that moves can keep.
    #[error("{what} is {value}: it must be above 0 (leave it out for no limit; lock a joint that must not move)")]
    NotPositive {
        /// Which limit.
        what: String,
        /// The number.
        value: f64,
    },
    /// A number outside its meaningful range.
    #[error("{what} is {value}: it must be at least {at_least} and below {below}")]
    OutOfRange {
        /// Which number.
        what: String,
        /// Its value.
        value: f64,
        /// Lowest value allowed.
        at_least: f64,
        /// First value not allowed.
        below: f64,
    },
    /// A range upside down.
    #[error("{what}: the lower end {lower} is above the upper end {upper}: exchange them")]
    LowerAboveUpper {
        /// Which range.
        what: String,
        /// Its lower end.
        lower: f64,
        /// Its upper end.
        upper: f64,
    },
    /// A joint that may not move at all.
    #[error("joint `{joint}` may only stand at {position}: widen its position range, or lock the joint")]
    ZeroRange {
        /// The joint.
        joint: String,
        /// The only position.
        position: f64,
    },
    /// A box without room for the point (with its radius).
    #[error("{what}: the range {lower} to {upper} m leaves no room for a point of radius {radius_m} m")]
    NoRoom {
        /// Which box, axis and point.
        what: String,
        /// Lower end.
        lower: f64,
        /// Upper end.
        upper: f64,
        /// Radius of the point.
        radius_m: f64,
    },
    /// A list that must not be empty.
    #[error("{what} has no points: name the links that it limits")]
    NoPoints {
        /// Which limit.
        what: String,
    },
    /// Torque or power limits without the inertial parameters to compute torque from.
    #[error(
        "joint `{joint}` has a {kind} limit, but the inertial parameters of {} are unknown: give them (rough values and a torque margin will do) or leave the limit out",
        bodies.join(", ")
    )]
    MissingPrior {
        /// The joint.
        joint: String,
        /// Torque or power.
        kind: LimitKind,
        /// Bodies that the joint carries without a prior.
        bodies: Vec<String>,
    },
    /// A vector of the wrong length.
    #[error("{what}: expected {expected} numbers, found {found}")]
    Length {
        /// What it was.
        what: &'static str,
        /// How many are needed.
        expected: usize,
        /// How many were given.
        found: usize,
    },
    /// The start posture, at rest, already breaks a limit.
    #[error("the start breaks the {kind} limit of `{subject}`: {amount}; move the start or widen the limit")]
    StartOutside {
        /// What is limited.
        kind: LimitKind,
        /// Where.
        subject: String,
        /// By how much, in words.
        amount: String,
    },
    /// No motion with rest at both ends fits into the time.
    #[error(
        "{duration_s} s is too short: joint `{joint}`, from rest to rest over {displacement} within its limits, takes at least {shortest_s:.4} s; lengthen the motion or raise the limits"
    )]
    TooShort {
        /// The slowest joint.
        joint: String,
        /// The duration asked for.
        duration_s: f64,
        /// The displacement that each joint must be able to make, rad or m.
        displacement: f64,
        /// The least time it takes.
        shortest_s: f64,
    },
}
