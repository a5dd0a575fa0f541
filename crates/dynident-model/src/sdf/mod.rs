//! SDF, the format of Gazebo: reading, and writing identified values back.
//!
//! Supported is one model (in `<sdf>` or in its single `<world>`) with nested models, next to static models without
//! joints, such as a ground plane, which are left out: links with `<inertial>`, joints
//! of type revolute, continuous, prismatic and fixed, poses and axes relative to any link, joint, frame or nested
//! model, and gravity of the `<world>`. The frame semantics of files before version 1.7 are also supported. Links
//! connected by fixed joints are merged into one body.
//!
//! A joint's frame can differ from the frame of its child link. The frame of a link that moves with a joint has the
//! axes of the SDF link, and its origin is at the joint. The base has the frame of the model; gravity is rotated into
//! it by the model's pose. The mass of a link without `<inertial>` is unknown (SDF's default is 1 kg).
//!
//! Source: the specification at <http://sdformat.org/spec> and its page on the semantics of poses.
//!
//! ```
//! let text = r#"<sdf version="1.9"><model name="pendulum">
//!   <link name="base"/>
//!   <link name="rod"><pose>0 0 1 0 0 0</pose>
//!     <inertial><pose>0 0 -0.5 0 0 0</pose><mass>2</mass>
//!       <inertia><ixx>0.1</ixx><iyy>0.1</iyy><izz>0.001</izz></inertia></inertial></link>
//!   <joint name="mount" type="fixed"><parent>world</parent><child>base</child></joint>
//!   <joint name="swing" type="revolute"><parent>base</parent><child>rod</child>
//!     <axis><xyz>0 1 0</xyz><dynamics><damping>0.2</damping></dynamics></axis></joint>
//! </model></sdf>"#;
//! let model = dynident_model::read_sdf(text)?.model;
//! assert_eq!((model.dof(), model.joints()[0].damping), (1, Some(0.2)));
//! // Inertia about the joint: 0.1 + 2 · 0.5².
//! assert!((model.inertials()[0].0[4] - 0.6).abs() < 1e-15);
//! # Ok::<(), dynident_model::SdfError>(())
//! ```

mod axes;
mod elements;
mod fault;
mod frames;
mod notices;
mod scopes;
mod tree;
mod values;
mod write;

pub use fault::{SdfError, SdfFault};
pub use notices::{SdfLoss, SdfNotice};
pub use write::{SdfWriteError, rewrite_sdf};

use crate::place::line_and_column;
use crate::spatial::Vec3;
use crate::tree::{Model, STANDARD_GRAVITY};
use crate::xml::{MAX_NODES, first_excess, root_name};
use fault::fault_at;
use frames::Frames;
use roxmltree::{Document, Node, ParsingOptions};
use scopes::scopes;
use values::{children, numbers_in, placement, word_of};

/// Result of reading an SDF.
#[derive(Clone, Debug, PartialEq)]
pub struct SdfRobot {
    /// The robot on a fixed base.
    pub model: Model,
    /// Contents that the model cannot represent, in the order of reading; at most 200 are kept.
    pub notices: Vec<SdfNotice>,
}

pub(crate) fn is_sdf(text: &str) -> bool {
    root_name(text) == Some("sdf")
}

/// Version of the file, which determines the semantics of frames.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub(super) struct Version(pub(super) [u32; 2]);

/// Reads an SDF.
///
/// # Errors
/// Malformed XML, not an SDF, or no tree of links on one fixed base; with line and column.
#[doc(alias("gazebo"))]
pub fn read_sdf(text: &str) -> Result<SdfRobot, SdfError> {
    if let Some(at) = first_excess(text) {
        return Err(SdfError::at(text, at, SdfFault::Flood));
    }
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options).map_err(|error| fault::of_xml(text, &error))?;
    let root = document.root_element();
    if !root.has_tag_name("sdf") {
        let root_name = root.tag_name().name().to_owned();
        return Err(fault_at(root, SdfFault::NotSdf { root: root_name }));
    }
    let version = version(root)?;
    let (around, model) = model_of(root)?;

    let found = scopes(model, version)?;
    let frames = Frames::new(&found)?;
    let mut notices = notices::Notices::default();
    for object in children(around, "model").filter(|other| *other != model) {
        notices.note(object, SdfLoss::Object { model: word_of(object, "name")?.to_owned() });
    }
    let tree = tree::tree(&found, &frames, &mut notices)?;

    // World gravity in the model's frame.
    let gravity = match children(around, "gravity").next().filter(|_| around.has_tag_name("world")) {
        Some(node) => Vec3(numbers_in::<3>(node)?),
        None => STANDARD_GRAVITY,
    };
    let mut world_from_model = placement(model)?;
    if let Some(frame) = model.attribute("placement_frame").filter(|frame| !frame.is_empty()) {
        let model_from_frame = frames.of(frame).ok_or_else(|| {
            fault_at(model, SdfFault::UnknownFrame { name: frame.to_owned(), of: "model".to_owned() })
        })?;
        world_from_model = world_from_model.then(&model_from_frame.inverse());
    }
    let gravity = world_from_model.rotation.transpose_mul_vec(gravity);
    let name = word_of(model, "name")?;
    let model = Model::new(name, tree.base, tree.joints, tree.bodies)
        .and_then(|model| model.with_gravity(gravity))
        .map_err(|error| fault_at(root, SdfFault::Model(error)))?;
    Ok(SdfRobot { model, notices: notices.list })
}

/// The only model, or the only model with moving joints, and its parent element: the document or its world.
fn model_of<'a, 'input>(root: Node<'a, 'input>) -> Result<(Node<'a, 'input>, Node<'a, 'input>), SdfError> {
    let worlds: Vec<Node<'_, '_>> = children(root, "world").collect();
    let around = match worlds[..] {
        [] => root,
        [only] => only,
        [_, second, ..] => return Err(fault_at(second, SdfFault::Several { what: "worlds" })),
    };
    let models: Vec<Node<'_, '_>> = children(around, "model").collect();
    match models[..] {
        [only] => Ok((around, only)),
        [] => Err(fault_at(around, SdfFault::NoModel { hint: include_hint(around) })),
        [_, second, ..] => {
            let moving: Vec<_> = models.iter().filter(|model| has_moving_joint(**model)).collect();
            match moving[..] {
                [only] => Ok((around, *only)),
                [] => Err(fault_at(second, SdfFault::Several { what: "models" })),
                [_, second, ..] => Err(fault_at(*second, SdfFault::Several { what: "models" })),
            }
        }
    }
}

/// Whether a model has a joint that is not fixed; the models of a scene, such as a ground plane, have none.
fn has_moving_joint(model: Node<'_, '_>) -> bool {
    model.descendants().any(|node| node.has_tag_name("joint") && node.attribute("type") != Some("fixed"))
}

fn include_hint(around: Node<'_, '_>) -> &'static str {
    match children(around, "include").next() {
        Some(_) => "; <include> is not supported: expand the file with `gz sdf -p`",
        None => "",
    }
}

fn version(root: Node<'_, '_>) -> Result<Version, SdfError> {
    let text = word_of(root, "version")?;
    let numbers: Option<Vec<u32>> = text.trim().split('.').map(|part| part.parse().ok()).collect();
    match numbers.as_deref() {
        Some([major, minor, ..]) => Ok(Version([*major, *minor])),
        _ => Err(fault_at(root, SdfFault::Version { text: crate::xml::shortened(text) })),
    }
}

fn line(node: Node<'_, '_>) -> u32 {
    line_and_column(node.document().input_text(), node.range().start).0
}
