//! Errors of the SDF reader.

use crate::error::ModelError;
use crate::place::Located;
use crate::xml::{MAX_NODES, Malformed, malformed};
use roxmltree::Node;
use thiserror::Error;

/// Why an SDF could not be read, with line and column.
pub type SdfError = Located<SdfFault>;

/// A fault in an SDF, with the fix.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe the fields")]
pub enum SdfFault {
    /// The file does not follow the rules of XML: for example, a tag is not closed, a quote is missing, or the end of
    /// the file is missing.
    #[error("malformed XML: {reason}; fix the markup here (is the file complete?)")]
    Xml { reason: String },
    /// The file has far more elements than one robot needs. It is probably a world with many models; give the file of
    /// the robot alone.
    #[error("the document has more than {limit} nodes: give the SDF of one robot")]
    TooLarge { limit: u32 },
    /// One tag has too many attributes, or the document has too many XML namespaces. No usual SDF reaches these limits:
    /// check that the file is an SDF.
    #[error("too many attributes in a tag, or namespaces in the document: give the SDF of one robot")]
    Flood,
    /// `<!DOCTYPE>` can define entities that expand without limit, so Dynident rejects it. An SDF does not need it.
    #[error("a document type declaration is not accepted: delete the <!DOCTYPE ...> block")]
    Doctype,
    /// The file is XML but not an SDF. Give the file whose root element is `<sdf>`.
    #[error("the root element is <{root}>, not <sdf>: give an SDF file")]
    NotSdf { root: String },
    /// The version is missing or not a number. The rules for poses and frames depend on it.
    #[error("`version` of <sdf> is `{text}`: write a version such as 1.9, which determines the meaning of frames")]
    Version { text: String },
    /// The file has no robot, or only refers to one by `<include>`. Give the file of the model, or expand it with `gz
    /// sdf -p`.
    #[error("there is no <model> here: give the SDF of one robot{hint}")]
    NoModel { hint: &'static str },
    /// The file has several worlds, several models with moving joints, or several models without any, and Dynident
    /// cannot know which one is the robot. Delete the others.
    #[error("there are several {what}: keep that of the robot")]
    Several { what: &'static str },
    /// The model has more parts than any robot. It is probably a scene; give the file of the robot alone.
    #[error("the model has more than {limit} links, joints and frames: give the SDF of one robot")]
    TooMany { limit: usize },
    /// Models contain models that contain models, and so on. The file was probably generated wrongly.
    #[error("models are nested more than {limit} deep: give the SDF of one robot")]
    TooDeep { limit: usize },
    /// SDF requires this element or attribute. It is missing or misspelt.
    #[error("<{element}> has no {kind} `{name}`: add it")]
    Missing { element: String, kind: &'static str, name: &'static str },
    /// The text is not a valid number for this element. The message states which values are valid.
    #[error("<{element}> holds `{text}`, which is {fault}: write {fix}")]
    Number { element: String, text: String, fault: &'static str, fix: &'static str },
    /// The element is a list of numbers, such as `<xyz>0 0 1</xyz>`, and a number is missing or extra.
    #[error("<{element}> holds {found} numbers: write {expected}, separated by spaces")]
    Count { element: String, expected: usize, found: usize },
    /// The element permits only certain words, and this word is unknown. It may be misspelt.
    #[error("`{text}` of <{element}> is unknown: write {expected}")]
    Word { element: String, text: String, expected: &'static str },
    /// Two links, joints, frames or nested models have the same name, often after two files were merged.
    #[error("`{name}` is defined a second time: rename or delete one")]
    DuplicateName { name: String },
    /// A `<parent>`, a `<child>` or a `relative_to` has a name that the model does not contain.
    #[error(
        "{of} refers to `{name}`, but there is no link, joint, frame or nested model of this name: add it or fix the name"
    )]
    UnknownFrame { name: String, of: String },
    /// The frames refer to each other by `relative_to` in a circle, so that no pose is determined.
    #[error("the pose of `{name}` refers back to itself: give one of these frames another `relative_to`")]
    FrameLoop { name: String },
    /// Two joints have the same `<child>`, which closes a loop. Dynident reads trees: delete one joint. If the chain is
    /// a parallelogram, state it by `[[robot.loop]]` of the study.
    #[error("link `{link}` is the child of joints `{first}` and `{second}`: delete one, closed chains are not read")]
    TwoParents { link: String, first: String, second: String },
    /// Two links have no parent joint, so the model has two separate parts.
    #[error(
        "links `{first}` and `{second}` both have no parent joint: connect one of them to the other, or to `world`, by a fixed joint"
    )]
    SeveralRoots { first: String, second: String },
    /// The joints form a ring. Dynident reads trees: delete one of these joints. If the chain is a parallelogram, state
    /// it by `[[robot.loop]]` of the study.
    #[error("link `{link}` is its own ancestor through its joints: delete one joint of the loop")]
    Loop { link: String },
    /// The `<parent>` and the `<child>` of a joint are the same link. One of them is misspelt.
    #[error("joint `{joint}` joins `{link}` with itself: fix <parent> or <child>")]
    SameLink { joint: String, link: String },
    /// The `<xyz>` of `<axis>` is zero, so that the direction of motion is unknown.
    #[error("the axis of joint `{joint}` has no direction: write a vector with a length, such as `0 0 1`")]
    ZeroAxis { joint: String },
    /// Gazebo can read this part of the file, but Dynident cannot. Change the file as the message states.
    #[error("{what} is not supported: {fix}")]
    Unsupported { what: String, fix: &'static str },
    /// A mass below zero does not exist physically. The sign is wrong.
    #[error("the mass of link `{link}` is negative: write a value of zero or more")]
    NegativeMass { link: String },
    /// All joints are fixed, so that there is nothing to identify. Often the file is that of an object or a scene.
    #[error("the model has no joint of type revolute, continuous or prismatic: give the SDF of a robot that moves")]
    NoMovingJoint,
    /// The model contains more moving joints than Dynident can identify at once, such as those of hands or of a second
    /// robot.
    #[error("the model has more than {limit} joints: write type=\"fixed\" for joints that the log does not contain")]
    TooManyJoints { limit: usize },
    /// The file is valid SDF, but its joints and links are not a valid robot model. The text has the cause.
    #[error("{0}; fix the description")]
    Model(#[from] ModelError),
}

pub(super) fn fault_at(node: Node<'_, '_>, fault: SdfFault) -> SdfError {
    let at = node.document().text_pos_at(node.range().start);
    Located { line: at.row, column: at.col, fault }
}

pub(super) fn of_xml(text: &str, error: &roxmltree::Error) -> SdfError {
    let (at, why) = malformed(text, error);
    let fault = match why {
        Malformed::Doctype => SdfFault::Doctype,
        Malformed::TooLarge => SdfFault::TooLarge { limit: MAX_NODES },
        Malformed::Markup { reason } => SdfFault::Xml { reason },
    };
    Located::at(text, at, fault)
}
