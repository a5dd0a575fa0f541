//! Errors of the MJCF reader.

use crate::error::ModelError;
use crate::place::Located;
use thiserror::Error;

/// Why an MJCF could not be read, with line and column.
pub type MjcfError = Located<MjcfFault>;

/// A fault in an MJCF, with the fix.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe the fields")]
pub enum MjcfFault {
    /// A file that the MJCF includes by `<include>` has the error that follows.
    #[error("in the included `{file}`, {line}:{column}: {fault}")]
    Included {
        file: String,
        line: u32,
        column: u32,
        #[source]
        fault: Box<MjcfFault>,
    },
    /// The file of an `<include>` does not exist or cannot be read. Dynident searches it relative to the main file.
    #[error("the included `{file}` cannot be read: {reason}; give its path from the folder of the main file")]
    Include { file: String, reason: String },
    /// MuJoCo permits each file only once, because its names would be defined twice.
    #[error("`{file}` is included a second time: delete one <include>, MuJoCo takes each file once")]
    IncludedTwice { file: String },
    /// The file does not follow the rules of XML: for example, a tag is not closed, a quote is missing, or the end of
    /// the file is missing.
    #[error("malformed XML: {reason}; fix the markup here (is the file complete?)")]
    Xml { reason: String },
    /// The file has far more elements than one robot needs. It is probably a scene with many objects; give the file of
    /// the robot alone.
    #[error("the document has more than {limit} {what}: give the MJCF of one robot")]
    TooLarge { limit: usize, what: &'static str },
    /// One tag has too many attributes, or the document has too many XML namespaces. No usual MJCF reaches these
    /// limits: check that the file is an MJCF.
    #[error("too many attributes in a tag, or namespaces in the document: give the MJCF of one robot")]
    Flood,
    /// `<!DOCTYPE>` can define entities that expand without limit, so Dynident rejects it. An MJCF does not need it.
    #[error("a document type declaration is not accepted: delete the <!DOCTYPE ...> block")]
    Doctype,
    /// The file is XML but not an MJCF. Give the file whose root element is `<mujoco>`.
    #[error("the root element is <{root}>, not <mujoco>: give an MJCF file")]
    NotMjcf { root: String },
    /// MJCF requires this attribute. It is missing or misspelt.
    #[error("<{element}> has no attribute `{attribute}`: add it")]
    MissingAttribute { element: String, attribute: &'static str },
    /// The text is not a valid number for this attribute. The message states which values are valid.
    #[error("`{attribute}` of <{element}> holds `{text}`, which is {fault}: write {fix}")]
    Number { element: String, attribute: String, text: String, fault: &'static str, fix: &'static str },
    /// The attribute is a list of numbers, such as `pos="0 0 0.1"`, and a number is missing or extra.
    #[error("`{attribute}` of <{element}> holds {found} numbers: write {expected}, separated by spaces")]
    Count { element: String, attribute: String, expected: usize, found: usize },
    /// The attribute permits only certain words, and this word is unknown. It may be misspelt.
    #[error("`{attribute}` of <{element}> is `{text}`: write {expected}")]
    Word { element: String, attribute: String, text: String, expected: &'static str },
    /// Two elements of one kind have the same name, often after two files were merged.
    #[error("{kind} `{name}` is defined a second time: rename or delete one")]
    DuplicateName { kind: &'static str, name: String },
    /// A `class` or `childclass` names defaults that the file does not define.
    #[error("class `{class}` is not defined: add its <default class=\"{class}\"> or fix the name")]
    UnknownClass { class: String },
    /// An actuator, an equality or a tendon names a joint that the file does not contain.
    #[error("<{element}> names joint `{joint}`, which is not defined: add the joint or fix the name")]
    UnknownJoint { element: String, joint: String },
    /// The two attributes state the same quantity in two ways.
    #[error("<{element}> has both `{first}` and `{second}`: keep one of them")]
    Both { element: String, first: &'static str, second: &'static str },
    /// The vector has the length zero, so that the direction or orientation is unknown.
    #[error("`{attribute}` of <{element}> gives no direction: write a vector with a length, such as `0 0 1`")]
    NoDirection { element: String, attribute: &'static str },
    /// A body has one mass and one inertia. Add the two inertials to one, or delete the wrong one.
    #[error("body `{body}` has a second <inertial>: keep one")]
    RepeatedInertial { body: String },
    /// The world (`<worldbody>`) does not move, so a mass there has no meaning.
    #[error("the world has no inertia: delete this <inertial>, or put it into a <body>")]
    WorldInertial,
    /// MuJoCo can read this part of the file, but Dynident cannot. Change the file as the message states.
    #[error("{what} is not supported: {fix}")]
    Unsupported { what: String, fix: &'static str },
    /// Dynident computes the mass of a geom from its size, and a number is missing, zero or negative.
    #[error("a geom of type `{kind}` needs {needed} positive numbers in `size`: write all of them")]
    Size { kind: &'static str, needed: usize },
    /// This quantity, such as a mass or an armature, cannot be negative physically. The sign is wrong.
    #[error("`{attribute}` of <{element}> is negative: write a value of zero or more")]
    Negative { element: String, attribute: &'static str },
    /// `settotalmass` scales all masses to a given sum, which is impossible while one mass is unknown. Add the
    /// `<inertial>`, or delete `settotalmass`.
    #[error("`settotalmass` needs all masses, and that of body `{body}` {why}: give the body an <inertial>")]
    TotalMass { body: String, why: String },
    /// The file is a scene or an object without joints, or its robot is in another file.
    #[error("the model has no joint of type hinge or slide: give the MJCF of a robot that moves")]
    NoMovingJoint,
    /// The model contains more joints than Dynident can identify at once, such as those of hands or of a second robot.
    #[error(
        "the model has more than {limit} joints: delete <joint> elements that the log does not contain, which fixes their bodies"
    )]
    TooManyJoints { limit: usize },
    /// The file is valid MJCF, but its joints and bodies are not a valid robot model. The text has the cause.
    #[error("{0}; fix the description")]
    Model(#[from] ModelError),
}
