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
#[allow(missing_docs, reason = "the messages describe variants and fields")]
pub enum SdfFault {
    #[error("malformed XML: {reason}; fix the markup here (is the file complete?)")]
    Xml { reason: String },
    #[error("the document has more than {limit} nodes: give the SDF of one robot")]
    TooLarge { limit: u32 },
    #[error("too many attributes in a tag, or namespaces in the document: give the SDF of one robot")]
    Flood,
    #[error("a document type declaration is not accepted: delete the <!DOCTYPE ...> block")]
    Doctype,
    #[error("the root element is <{root}>, not <sdf>: give an SDF file")]
    NotSdf { root: String },
    #[error("`version` of <sdf> is `{text}`: write a version such as 1.9, which determines the meaning of frames")]
    Version { text: String },
    #[error("there is no <model> here: give the SDF of one robot{hint}")]
    NoModel { hint: &'static str },
    #[error("there are several {what}: keep that of the robot")]
    Several { what: &'static str },
    #[error("the model has more than {limit} links, joints and frames: give the SDF of one robot")]
    TooMany { limit: usize },
    #[error("models are nested more than {limit} deep: give the SDF of one robot")]
    TooDeep { limit: usize },
    #[error("<{element}> has no {kind} `{name}`: add it")]
    Missing { element: String, kind: &'static str, name: &'static str },
    #[error("<{element}> holds `{text}`, which is {fault}: write {fix}")]
    Number { element: String, text: String, fault: &'static str, fix: &'static str },
    #[error("<{element}> holds {found} numbers: write {expected}, separated by spaces")]
    Count { element: String, expected: usize, found: usize },
    #[error("`{text}` of <{element}> is unknown: write {expected}")]
    Word { element: String, text: String, expected: &'static str },
    #[error("`{name}` is defined a second time: rename or delete one")]
    DuplicateName { name: String },
    #[error(
        "{of} refers to `{name}`, but there is no link, joint, frame or nested model of this name: add it or fix the name"
    )]
    UnknownFrame { name: String, of: String },
    #[error("the pose of `{name}` refers back to itself: give one of these frames another `relative_to`")]
    FrameLoop { name: String },
    #[error("link `{link}` is the child of joints `{first}` and `{second}`: delete one, closed chains are not read")]
    TwoParents { link: String, first: String, second: String },
    #[error(
        "links `{first}` and `{second}` both have no parent joint: connect one of them to the other, or to `world`, by a fixed joint"
    )]
    SeveralRoots { first: String, second: String },
    #[error("link `{link}` is its own ancestor through its joints: delete one joint of the loop")]
    Loop { link: String },
    #[error("joint `{joint}` joins `{link}` with itself: fix <parent> or <child>")]
    SameLink { joint: String, link: String },
    #[error("the axis of joint `{joint}` has no direction: write a vector with a length, such as `0 0 1`")]
    ZeroAxis { joint: String },
    #[error("{what} is not supported: {fix}")]
    Unsupported { what: String, fix: &'static str },
    #[error("the mass of link `{link}` is negative: write a value of zero or more")]
    NegativeMass { link: String },
    #[error("the model has no joint of type revolute, continuous or prismatic: give the SDF of a robot that moves")]
    NoMovingJoint,
    #[error("the model has more than {limit} joints: write type=\"fixed\" for joints that the log does not contain")]
    TooManyJoints { limit: usize },
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
