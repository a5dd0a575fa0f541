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
#[allow(missing_docs, reason = "fields are named as in the messages")]
pub enum SdfFault {
    /// The XML is malformed.
    #[error("malformed XML: {reason}; fix the markup here (is the file complete?)")]
    Xml { reason: String },
    /// More elements than a robot has.
    #[error("the document has more than {limit} nodes: give the SDF of one robot")]
    TooLarge { limit: u32 },
    /// Thousands of attributes in one tag, or of namespaces.
    #[error("too many attributes in a tag, or namespaces in the document: give the SDF of one robot")]
    Flood,
    /// A document type declaration, by which entities could be defined.
    #[error("a document type declaration is not accepted: delete the <!DOCTYPE ...> block")]
    Doctype,
    /// The root element is not `<sdf>`.
    #[error("the root element is <{root}>, not <sdf>: give an SDF file")]
    NotSdf { root: String },
    /// An invalid `version`.
    #[error("`version` of <sdf> is `{text}`: write a version such as 1.9, which determines the meaning of frames")]
    Version { text: String },
    /// No model.
    #[error("there is no <model> here: give the SDF of one robot{hint}")]
    NoModel { hint: &'static str },
    /// Several worlds or models.
    #[error("there are several {what}: keep that of the robot")]
    Several { what: &'static str },
    /// More links, joints and frames than allowed.
    #[error("the model has more than {limit} links, joints and frames: give the SDF of one robot")]
    TooMany { limit: usize },
    /// Models nested too deep.
    #[error("models are nested more than {limit} deep: give the SDF of one robot")]
    TooDeep { limit: usize },
    /// An attribute or element is missing.
    #[error("<{element}> has no {kind} `{name}`: add it")]
    Missing { element: String, kind: &'static str, name: &'static str },
    /// An invalid number.
    #[error("<{element}> holds `{text}`, which is {fault}: write {fix}")]
    Number { element: String, text: String, fault: &'static str, fix: &'static str },
    /// Too many or too few numbers.
    #[error("<{element}> holds {found} numbers: write {expected}, separated by spaces")]
    Count { element: String, expected: usize, found: usize },
    /// An invalid keyword.
    #[error("`{text}` of <{element}> is unknown: write {expected}")]
    Word { element: String, text: String, expected: &'static str },
    /// A repeated name in one scope.
    #[error("`{name}` is defined a second time: rename or delete one")]
    DuplicateName { name: String },
    /// An unknown frame.
    #[error("{of} refers to `{name}`, which is no link, joint, frame or nested model here: add it or fix the name")]
    UnknownFrame { name: String, of: String },
    /// Frames whose poses refer to each other.
    #[error("the pose of `{name}` refers back to itself: give one of these frames another `relative_to`")]
    FrameLoop { name: String },
    /// A link with two parent joints.
    #[error("link `{link}` is the child of joints `{first}` and `{second}`: delete one, closed chains are not read")]
    TwoParents { link: String, first: String, second: String },
    /// Links that are not connected by a joint.
    #[error("links `{first}` and `{second}` both have no parent joint: fix one of them to the other, or to `world`")]
    SeveralRoots { first: String, second: String },
    /// Links that carry each other.
    #[error("link `{link}` is its own ancestor through its joints: delete one joint of the loop")]
    Loop { link: String },
    /// A joint that joins a link with itself.
    #[error("joint `{joint}` joins `{link}` with itself: fix <parent> or <child>")]
    SameLink { joint: String, link: String },
    /// An axis without direction.
    #[error("the axis of joint `{joint}` has no direction: write a vector with a length, such as `0 0 1`")]
    ZeroAxis { joint: String },
    /// An unsupported element, such as a joint that is impossible for a robot on a fixed base.
    #[error("{what} is not supported: {fix}")]
    Unsupported { what: String, fix: &'static str },
    /// A negative mass.
    #[error("the mass of link `{link}` is negative: write a value of zero or more")]
    NegativeMass { link: String },
    /// No moving joint.
    #[error("the model has no joint of type revolute, continuous or prismatic: give the SDF of a robot that moves")]
    NoMovingJoint,
    /// More moving joints than allowed.
    #[error("the model has more than {limit} joints: fix those that the log does not contain")]
    TooManyJoints { limit: usize },
    /// The parts do not form a valid model.
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
