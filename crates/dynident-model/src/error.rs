//! Errors in the parts of a model.

use thiserror::Error;

/// Why a [`Model`](crate::Model) could not be built.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ModelError {
    /// Joints and bodies do not pair up.
    #[error("{joints} joints but {bodies} bodies: every joint moves exactly one body")]
    Counts {
        /// Number of joints.
        joints: usize,
        /// Number of bodies.
        bodies: usize,
    },
    /// Two joints with one name.
    #[error("joint `{joint}` is named twice: joint names must be unique")]
    DuplicateJoint {
        /// The name.
        joint: String,
    },
    /// A joint whose parent body comes after it.
    #[error("joint `{joint}` comes before its parent: order joints from base to tip")]
    ParentAfterChild {
        /// The joint.
        joint: String,
    },
    /// An axis that is not a unit vector.
    #[error("the axis of joint `{joint}` is not a unit vector: normalise it")]
    AxisNotUnit {
        /// The joint.
        joint: String,
    },
    /// Joints that follow each other in a cycle.
    #[error("joint `{joint}` follows joints that follow it: one of them has to move by itself")]
    MimicCircle {
        /// One of the joints.
        joint: String,
    },
    /// A mimic joint whose source is not in the model.
    #[error("joint `{joint}` follows `{source_joint}`, which is dropped: drop both, or neither")]
    LostSource {
        /// The joint.
        joint: String,
        /// Its source.
        source_joint: String,
    },
    /// A link that does not exist.
    #[error("there is no link `{link}`; the links are: {}", known.join(", "))]
    UnknownLink {
        /// The requested name.
        link: String,
        /// Existing names.
        known: Vec<String>,
    },
    /// A body without any link.
    #[error("a body has no link: every body needs the link that its joint moves")]
    BodyWithoutLink,
    /// A value that is not finite.
    #[error("{what} is not a finite number")]
    NotFinite {
        /// The value.
        what: String,
    },
    /// A joint that does not exist.
    #[error("there is no joint `{joint}`; the joints are: {}", known.join(", "))]
    UnknownJoint {
        /// The requested name.
        joint: String,
        /// Existing names.
        known: Vec<String>,
    },
}
