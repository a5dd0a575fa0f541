//! Errors in the parts of a model.

use thiserror::Error;

/// Why a [`Model`](crate::Model) could not be built.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "fields are named as in the messages")]
pub enum ModelError {
    /// Joints and bodies do not pair up.
    #[error("{joints} joints but {bodies} bodies: give one body per joint")]
    Counts { joints: usize, bodies: usize },
    /// Two joints with one name.
    #[error("joint `{joint}` is named twice: joint names must be unique")]
    DuplicateJoint { joint: String },
    /// A joint whose parent body comes after it.
    #[error("joint `{joint}` comes before its parent: order joints from base to tip")]
    ParentAfterChild { joint: String },
    /// An axis that is not a unit vector.
    #[error("the axis of joint `{joint}` is not a unit vector: normalise it")]
    AxisNotUnit { joint: String },
    /// Joints that follow each other in a cycle.
    #[error("joint `{joint}` is in a cycle of mimic joints: make one of them independent")]
    MimicCircle { joint: String },
    /// A mimic joint whose source is not in the model.
    #[error("joint `{joint}` follows `{source_joint}`, which is removed: remove both, or neither")]
    LostSource { joint: String, source_joint: String },
    /// A link that does not exist.
    #[error("there is no link `{link}`; the links are: {}", known.join(", "))]
    UnknownLink { link: String, known: Vec<String> },
    /// A body without any link.
    #[error("a body has no link: every body needs the link that its joint moves")]
    BodyWithoutLink,
    /// A value that is not finite.
    #[error("{what} is not a finite number")]
    NotFinite { what: String },
    /// A setting that is not positive.
    #[error("setting `{setting}` is {value}: give a positive number")]
    NotPositive { setting: &'static str, value: f64 },
    /// A joint that does not exist.
    #[error("there is no joint `{joint}`; the joints are: {}", known.join(", "))]
    UnknownJoint { joint: String, known: Vec<String> },
}
