//! URDF, the Unified Robot Description Format: reading and writing back.
//!
//! Supported are links with `<inertial>`, and joints of type revolute, continuous, prismatic and fixed on a fixed
//! base. Links connected by fixed joints are merged: [`Body::links`](crate::Body) keeps every link with its frame. A
//! link without `<inertial>` has unknown mass; it is not massless. A joint with `mimic` is not a degree of freedom.
//! Joints are ordered depth first, in the order of the document under each link. The rotation of `<origin>` is `rpy`
//! or (URDF 1.1) `quat_xyzw`.
//!
//! ```
//! let text = r#"<robot name="pendulum">
//!   <link name="base"/>
//!   <joint name="swing" type="continuous">
//!     <parent link="base"/> <child link="rod"/> <axis xyz="0 1 0"/>
//!   </joint>
//!   <link name="rod"><inertial>
//!     <origin xyz="0 0 -0.5"/> <mass value="2"/>
//!     <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.001"/>
//!   </inertial></link>
//! </robot>"#;
//! let model = dynident_model::read_urdf(text)?.model;
//! assert_eq!(model.dof(), 1);
//! // Inertia about the frame's origin: 0.1 + 2 · 0.5².
//! assert!((model.inertials()[0].0[4] - 0.6).abs() < 1e-15);
//! # Ok::<(), dynident_model::UrdfError>(())
//! ```

mod assemble;
mod collision;
mod elements;
mod from_model;
mod origin;
mod prefixes;
mod stated;
mod values;
mod write;

pub use from_model::write_urdf;
pub use stated::{MOMENT_NAMES, StatedInertial, rewrite_inertials, stated_inertials};
pub use write::{JointChange, LinkChange, UrdfWriteError, link_changes, rewrite_urdf};

use crate::error::ModelError;
use crate::place::{Located, line_and_column};
use crate::tree::Model;
use crate::xml::{MAX_NODES, Malformed, first_excess, malformed};
use roxmltree::{Document, Node, ParsingOptions};
use thiserror::Error;

/// Maximum number of moving joints.
pub const MAX_MOVING_JOINTS: usize = 1000;

pub use crate::inertial::MAX_MAGNITUDE;

/// Result of reading a URDF.
#[derive(Clone, Debug, PartialEq)]
pub struct UrdfRobot {
    /// The robot on a fixed base, gravity along -z.
    pub model: Model,
    /// Elements inside links, inertials and joints that were ignored, because URDF does not define them (often a
    /// misspelling) or because they repeat an earlier one. At most [`UrdfRobot::MAX_UNREAD`] are kept.
    pub unread: Vec<UnreadElement>,
    /// Violations of the XML or URDF rules that do not make the robot ambiguous, in the order of the document.
    pub irregularities: Vec<UrdfIrregularity>,
}

impl UrdfRobot {
    /// Maximum number of ignored elements in the list.
    pub const MAX_UNREAD: usize = 20;
}

/// An ignored element.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnreadElement {
    /// Line, from 1.
    pub line: u32,
    /// Column, from 1, in characters.
    pub column: u32,
    /// Name of the element.
    pub element: String,
    /// Name of the parent element.
    pub parent: String,
}

/// A violation of the rules that does not make the robot ambiguous; other URDF readers ignore it.
#[derive(Clone, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the messages describe the fields")]
pub enum UrdfIrregularity {
    /// Names with an undeclared namespace prefix.
    UndeclaredPrefix {
        /// Line of the first one, from 1.
        line: u32,
        prefix: String,
    },
    /// A mimic joint whose source is not in the document; it is treated as independent.
    UnknownMimic {
        /// Line of the joint, from 1.
        line: u32,
        joint: String,
        source_joint: String,
    },
}

/// Why a URDF could not be read, with line and column.
pub type UrdfError = Located<UrdfFault>;

/// A fault in a URDF, with the fix.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe the fields")]
pub enum UrdfFault {
    /// The file does not follow the rules of XML: for example, a tag is not closed, a quote is missing, or the end of
    /// the file is missing.
    #[error("malformed XML: {reason}; fix the markup here (is the file complete?)")]
    Xml { reason: String },
    /// The file has far more elements than one robot needs. It is probably another file, or several robots in one.
    #[error("the document has more than {limit} nodes: name the URDF of one robot")]
    TooLarge { limit: u32 },
    /// One tag has too many attributes, or the document has too many XML namespaces. No usual URDF reaches these
    /// limits: check that the file is a URDF.
    #[error("too many attributes in a tag, or namespaces in the document: name the URDF of one robot")]
    Flood,
    /// `<!DOCTYPE>` can define entities that expand without limit, so Dynident rejects it. A URDF does not need it.
    #[error("a document type declaration is not accepted: delete the <!DOCTYPE ...> block")]
    Doctype,
    /// The file is XML but not a URDF. Give the file whose root element is `<robot>`.
    #[error("the root element is <{root}>, not <robot>: give a URDF file{hint}")]
    NotUrdf { root: String, hint: &'static str },
    /// The file still contains xacro expressions or macros, which only the program `xacro` expands.
    #[error("`{what}` is xacro: expand the file first (`xacro robot.urdf.xacro > robot.urdf`)")]
    Xacro { what: String },
    /// URDF requires this element. Without it, the link or joint is incomplete.
    #[error("<{parent}> of `{owner}` has no <{element}>: add it{hint}")]
    MissingElement { parent: &'static str, owner: String, element: &'static str, hint: &'static str },
    /// A link has one mass and one inertia. Add the two inertials to one, or delete the wrong one.
    #[error("link `{link}` has a second <inertial>: keep one")]
    RepeatedInertial { link: String },
    /// URDF requires this attribute. It is missing or misspelt.
    #[error("<{element}> has no attribute `{attribute}`: add it")]
    MissingAttribute { element: String, attribute: &'static str },
    /// Names of links and joints must not be empty. The study and the logs refer to these names.
    #[error("<{element}> has an empty `{attribute}`: fill it in")]
    EmptyName { element: String, attribute: &'static str },
    /// The text is not a valid number for this attribute. The message states which values are valid.
    #[error("`{attribute}` of <{element}> holds `{text}`, which is {fault}: write {fix}")]
    Number { element: String, attribute: String, text: String, fault: &'static str, fix: &'static str },
    /// The attribute is a list of numbers, such as `xyz="0 0 0.1"`, and a number is missing or extra.
    #[error("`{attribute}` of <{element}> holds {found} numbers: write {expected}, separated by spaces")]
    Count { element: String, attribute: String, expected: usize, found: usize },
    /// Two links or two joints have the same name, often after two files were merged.
    #[error("{kind} `{name}` is defined a second time (first in line {first_line}): rename or delete one")]
    DuplicateName { kind: &'static str, name: String, first_line: u32 },
    /// The `<parent>` or `<child>` of a joint names a link that the file does not contain.
    #[error("joint `{joint}` names link `{link}`, which is not defined: add the link or fix the name")]
    UnknownLink { joint: String, link: String },
    /// A `<mimic>` names the joint that it follows, and this must be another joint.
    #[error("joint `{joint}` mimics itself: fix the name or delete <mimic>")]
    OwnMimic { joint: String },
    /// The two attributes could state different orientations.
    #[error("<origin> of {owner} has both `rpy` and `quat_xyzw`: keep one of them")]
    TwoRotations { owner: String },
    /// Four numbers are an orientation only if the sum of their squares is 1. Zeros or numbers far from this give none.
    #[error(
        "`quat_xyzw` of <origin> of {owner} has length {norm:.3e}: give a unit quaternion x y z w, such as `0 0 0 1`"
    )]
    NoRotation { owner: String, norm: f64 },
    /// Two joints have the same `<child>`, which closes a loop. Dynident reads trees: delete one joint. If the chain is
    /// a parallelogram, state it by `[[robot.loop]]` of the study.
    #[error(
        "link `{link}` is the child of joint `{first}` and of joint `{second}`: a link has one parent, delete one joint"
    )]
    TwoParents { link: String, first: String, second: String },
    /// Dynident reads joints with at most one degree of freedom. Replace a planar or floating joint by a chain of other
    /// joints, or by `fixed`.
    #[error("joint `{joint}` is of type `{kind}`: use revolute, continuous, prismatic or fixed{hint}")]
    JointType { joint: String, kind: String, hint: &'static str },
    /// The `xyz` of `<axis>` is `0 0 0`, so that the direction of motion is unknown.
    #[error("the axis of joint `{joint}` has length zero: give its direction, such as `0 0 1`")]
    ZeroAxis { joint: String },
    /// The file has a `<robot>` element without links. It is probably a fragment that another file includes.
    #[error("the robot has no <link>: add its links and joints")]
    NoLinks,
    /// All joints are fixed, so that there is nothing to identify. Often the export replaced moving joints by `fixed`.
    #[error("the robot has no moving joint: give at least one of type revolute, continuous or prismatic")]
    NoMovingJoint,
    /// The joints form a ring. Dynident reads trees: delete one of these joints. If the chain is a parallelogram, state
    /// it by `[[robot.loop]]` of the study.
    #[error("link `{link}` is its own ancestor: the joints form a loop; cut it at one joint")]
    Loop { link: String },
    /// Two links have no parent joint, so the file contains two separate robots. Connect them by a fixed joint, or
    /// delete one.
    #[error("links `{first}` and `{second}` both have no parent: join them, a robot has one base")]
    SeveralRoots { first: String, second: String },
    /// The description contains more moving joints than Dynident can identify at once, such as those of hands or of a
    /// second robot.
    #[error(
        "the robot has more than {limit} moving joints: write type=\"fixed\" for joints that the log does not contain"
    )]
    TooManyJoints { limit: usize },
    /// The file is valid URDF, but its joints and links are not a valid robot model. The text has the cause.
    #[error("{0}; fix the description")]
    Model(#[from] ModelError),
}

/// Reads a URDF.
///
/// # Errors
/// Malformed XML, not a URDF, or no tree of links on one fixed base; with line and column.
pub fn read_urdf(text: &str) -> Result<UrdfRobot, UrdfError> {
    let (regular, undeclared) = prefixes::without_undeclared(text);
    let document = parse(&regular)?;
    let root = document.root_element();
    let mut unread = Vec::new();
    let links = elements::links(root, &mut unread)?;
    let joints = elements::joints(root, &mut unread)?;
    let name = root.attribute("name").unwrap_or("robot");
    let model = assemble::model(name, &links, &joints)?;
    let mut irregularities: Vec<UrdfIrregularity> = undeclared
        .into_iter()
        .map(|found| UrdfIrregularity::UndeclaredPrefix {
            line: line_and_column(text, found.at).0,
            prefix: found.prefix.to_owned(),
        })
        .collect();
    irregularities.extend(assemble::unknown_mimics(&joints));
    let unread = unread
        .iter()
        .map(|node| {
            let at = document.text_pos_at(node.range().start);
            let parent = node.parent_element().map_or("", |parent| parent.tag_name().name());
            UnreadElement {
                line: at.row,
                column: at.col,
                element: node.tag_name().name().to_owned(),
                parent: parent.to_owned(),
            }
        })
        .collect();
    Ok(UrdfRobot { model, unread, irregularities })
}

fn parse(text: &str) -> Result<Document<'_>, UrdfError> {
    if let Some(at) = first_excess(text) {
        return Err(Located::at(text, at, UrdfFault::Flood));
    }
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options).map_err(|error| xml_error(text, &error))?;
    let root = document.root_element();
    if let Some(node) =
        root.descendants().find(|node| node.tag_name().namespace().is_some_and(|ns| ns.contains("xacro")))
    {
        let what = format!("<xacro:{}>", node.tag_name().name());
        return Err(fault_at(node, UrdfFault::Xacro { what }));
    }
    match root.tag_name().name() {
        "robot" => Ok(document),
        other => {
            let hint = match other {
                "sdf" => " (this is SDF, which is read as such from a file, or by `read_sdf`)",
                "mujoco" => " (this is MJCF, which is read as such from a file, or by `read_mjcf`)",
                "COLLADA" => " (this is a mesh)",
                _ => "",
            };
            Err(fault_at(root, UrdfFault::NotUrdf { root: other.to_owned(), hint }))
        }
    }
}

fn xml_error(text: &str, error: &roxmltree::Error) -> UrdfError {
    if let roxmltree::Error::UnknownNamespace(prefix, at) = error
        && prefix == "xacro"
    {
        return Located { line: at.row, column: at.col, fault: UrdfFault::Xacro { what: "xacro:".to_owned() } };
    }
    let (at, why) = malformed(text, error);
    let fault = match why {
        Malformed::Doctype => UrdfFault::Doctype,
        Malformed::TooLarge => UrdfFault::TooLarge { limit: MAX_NODES },
        Malformed::Markup { reason } => UrdfFault::Xml { reason },
    };
    Located::at(text, at, fault)
}

fn fault_at(node: Node<'_, '_>, fault: UrdfFault) -> UrdfError {
    let at = node.document().text_pos_at(node.range().start);
    Located { line: at.row, column: at.col, fault }
}
