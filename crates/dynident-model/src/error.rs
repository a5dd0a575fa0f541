//! Errors in the parts of a model.

use thiserror::Error;

/// Why a [`Model`](crate::Model) could not be built.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe the fields")]
pub enum ModelError {
    /// A program built the model with lists of different length. Each joint moves exactly one body.
    #[error("{joints} joints but {bodies} bodies: give one body per joint")]
    Counts { joints: usize, bodies: usize },
    /// Two joints have the same name, so that a column of the log could belong to either. Rename one.
    #[error("joint `{joint}` is named twice: joint names must be unique")]
    DuplicateJoint { joint: String },
    /// A program built the model with a joint in front of the joint that carries it. Correct the call.
    #[error("joint `{joint}` comes before its parent: order joints from base to tip")]
    ParentAfterChild { joint: String },
    /// A program built the model with an axis whose length is not 1. Correct the call.
    #[error("the axis of joint `{joint}` is not a unit vector: normalise it")]
    AxisNotUnit { joint: String },
    /// Each of these joints follows another one (`<mimic>`, or `[[robot.follow]]` of the study), so that none of them
    /// moves independently.
    #[error("joint `{joint}` is in a cycle of mimic joints: make one of them independent")]
    MimicCircle { joint: String },
    /// `drop` under `[robot]` removes a joint that another joint follows. Remove both joints, or neither.
    #[error("joint `{joint}` follows `{source_joint}`, which is removed: remove both, or neither")]
    LostSource { joint: String, source_joint: String },
    /// `drop` under `[robot]`, or a program, names a link that the robot does not have. Use one of the listed names.
    #[error("there is no link `{link}`; the links are: {}", known.join(", "))]
    UnknownLink { link: String, known: Vec<String> },
    /// A program built the model with a body that has no link. Correct the call.
    #[error("a body has no link: every body needs the link that its joint moves")]
    BodyWithoutLink,
    /// A value of the robot description or of `[robot]` is NaN or infinite. Correct the value that the message names.
    #[error("{what} is not a finite number")]
    NotFinite { what: String },
    /// A threshold of the audit by `inspect` is zero, negative or not finite. Give a positive number.
    #[error("setting `{setting}` is {value}: give a positive number")]
    NotPositive { setting: &'static str, value: f64 },
    /// The study or the command names a joint that the robot does not have, for example in `joints` or `lock` under
    /// `[robot]`. Use one of the listed names.
    #[error("there is no joint `{joint}`; the joints are: {}", known.join(", "))]
    UnknownJoint { joint: String, known: Vec<String> },
}
