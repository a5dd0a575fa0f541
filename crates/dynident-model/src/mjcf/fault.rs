//! Errors of the MJCF reader.

use crate::error::ModelError;
use crate::place::Located;
use thiserror::Error;

/// Why an MJCF could not be read, with line and column.
pub type MjcfError = Located<MjcfFault>;

/// A fault in an MJCF, with the fix.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe variants and fields")]
pub enum MjcfFault {
    #[error("in the included `{file}`, {line}:{column}: {fault}")]
    Included {
        file: String,
        line: u32,
        column: u32,
        #[source]
        fault: Box<MjcfFault>,
    },
    #[error("the included `{file}` cannot be read: {reason}; give its path from the folder of the main file")]
    Include { file: String, reason: String },
    #[error("`{file}` is included a second time: delete one <include>, MuJoCo takes each file once")]
    IncludedTwice { file: String },
    #[error("malformed XML: {reason}; fix the markup here (is the file complete?)")]
    Xml { reason: String },
    #[error("the document has more than {limit} {what}: give the MJCF of one robot")]
    TooLarge { limit: usize, what: &'static str },
    #[error("too many attributes in a tag, or namespaces in the document: give the MJCF of one robot")]
    Flood,
    #[error("a document type declaration is not accepted: delete the <!DOCTYPE ...> block")]
    Doctype,
    #[error("the root element is <{root}>, not <mujoco>: give an MJCF file")]
    NotMjcf { root: String },
    #[error("<{element}> has no attribute `{attribute}`: add it")]
    MissingAttribute { element: String, attribute: &'static str },
    #[error("`{attribute}` of <{element}> holds `{text}`, which is {fault}: write {fix}")]
    Number { element: String, attribute: String, text: String, fault: &'static str, fix: &'static str },
    #[error("`{attribute}` of <{element}> holds {found} numbers: write {expected}, separated by spaces")]
    Count { element: String, attribute: String, expected: usize, found: usize },
    #[error("`{attribute}` of <{element}> is `{text}`: write {expected}")]
    Word { element: String, attribute: String, text: String, expected: &'static str },
    #[error("{kind} `{name}` is defined a second time: rename or delete one")]
    DuplicateName { kind: &'static str, name: String },
    #[error("class `{class}` is not defined: add its <default class=\"{class}\"> or fix the name")]
    UnknownClass { class: String },
    #[error("<{element}> names joint `{joint}`, which is not defined: add the joint or fix the name")]
    UnknownJoint { element: String, joint: String },
    #[error("<{element}> has both `{first}` and `{second}`: keep one of them")]
    Both { element: String, first: &'static str, second: &'static str },
    #[error("`{attribute}` of <{element}> gives no direction: write a vector with a length, such as `0 0 1`")]
    NoDirection { element: String, attribute: &'static str },
    #[error("body `{body}` has a second <inertial>: keep one")]
    RepeatedInertial { body: String },
    #[error("the world has no inertia: delete this <inertial>, or put it into a <body>")]
    WorldInertial,
    #[error("{what} is not supported: {fix}")]
    Unsupported { what: String, fix: &'static str },
    #[error("a geom of type `{kind}` needs {needed} positive numbers in `size`: write all of them")]
    Size { kind: &'static str, needed: usize },
    #[error("`{attribute}` of <{element}> is negative: write a value of zero or more")]
    Negative { element: String, attribute: &'static str },
    #[error("`settotalmass` needs all masses, and that of body `{body}` {why}: give the body an <inertial>")]
    TotalMass { body: String, why: String },
    #[error("the model has no joint of type hinge or slide: give the MJCF of a robot that moves")]
    NoMovingJoint,
    #[error(
        "the model has more than {limit} joints: delete <joint> elements that the log does not contain, which fixes their bodies"
    )]
    TooManyJoints { limit: usize },
    #[error("{0}; fix the description")]
    Model(#[from] ModelError),
}
