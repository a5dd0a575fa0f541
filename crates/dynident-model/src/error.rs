//! Errors in the parts of a model.

use thiserror::Error;

/// Why a [`Model`](crate::Model) could not be built.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe variants and fields")]
pub enum ModelError {
    #[error("{joints} joints but {bodies} bodies: give one body per joint")]
    Counts { joints: usize, bodies: usize },
    #[error("joint `{joint}` is named twice: joint names must be unique")]
    DuplicateJoint { joint: String },
    #[error("joint `{joint}` comes before its parent: order joints from base to tip")]
    ParentAfterChild { joint: String },
    #[error("the axis of joint `{joint}` is not a unit vector: normalise it")]
    AxisNotUnit { joint: String },
    #[error("joint `{joint}` is in a cycle of mimic joints: make one of them independent")]
    MimicCircle { joint: String },
    #[error("joint `{joint}` follows `{source_joint}`, which is removed: remove both, or neither")]
    LostSource { joint: String, source_joint: String },
    #[error("there is no link `{link}`; the links are: {}", known.join(", "))]
    UnknownLink { link: String, known: Vec<String> },
    #[error("a body has no link: every body needs the link that its joint moves")]
    BodyWithoutLink,
    #[error("{what} is not a finite number")]
    NotFinite { what: String },
    #[error("setting `{setting}` is {value}: give a positive number")]
    NotPositive { setting: &'static str, value: f64 },
    #[error("there is no joint `{joint}`; the joints are: {}", known.join(", "))]
    UnknownJoint { joint: String, known: Vec<String> },
}
