//! MJCF, MuJoCo's model format: reading and writing back.
//!
//! Supported are nested bodies with `<inertial>` or geoms (simple solids, meshes) and joints of type hinge and slide,
//! on a fixed base. Also supported are `<compiler>`, `<default>` classes, `<frame>` and `<include>`, `armature`,
//! `damping` and `frictionloss`, effort limits of joints and actuators, and gravity. A body without joint is merged
//! into its parent. A body whose mass depends on a missing mesh has unknown mass; it is not massless. A robot with a
//! free joint is read as fixed. Other bodies with a free joint are objects of the scene and are not read. Both cases
//! give a notice.
//!
//! A joint's anchor can differ from the origin of its body. The frame of a link that moves with a joint has the axes
//! of its MJCF body, and its origin is the anchor of the body's last hinge. Several joints in one body become a chain
//! with massless bodies between them, called `BODY/JOINT`.
//!
//! ```
//! let text = r#"<mujoco model="pendulum"><compiler angle="radian"/>
//!   <worldbody><body name="rod">
//!     <joint name="swing" axis="0 1 0" pos="0 0 0.5" armature="0.01" damping="0.2"/>
//!     <inertial pos="0 0 0" mass="2" diaginertia="0.1 0.1 0.001"/>
//!   </body></worldbody></mujoco>"#;
//! let robot = dynident_model::read_mjcf(text)?;
//! assert_eq!((robot.model.dof(), robot.model.joints()[0].drive_inertia), (1, Some(0.01)));
//! // Inertia about the hinge: 0.1 + 2 · 0.5².
//! assert!((robot.model.inertials()[0].0[4] - 0.6).abs() < 1e-15);
//! # Ok::<(), dynident_model::MjcfError>(())
//! ```

mod bodies;
mod chains;
mod classes;
mod compiler;
mod drives;
mod expanded;
mod fault;
mod files;
mod floating;
mod geoms;
mod inertials;
mod joints;
mod meshes;
mod notices;
mod orientation;
mod tree;
mod values;
mod write;
mod write_servos;

pub use expanded::Include;
pub(crate) use expanded::is_mjcf;
pub use fault::{MjcfError, MjcfFault};
pub use files::included_from;
pub use notices::{MjcfLoss, MjcfNotice};
pub use write::{MjcfWriteError, rewrite_mjcf};
pub use write_servos::{ServoChange, rewrite_servos};

use crate::collision::read_mujoco_mesh;
use crate::tree::Model;
use bodies::Reader;
use chains::ChainContext;
use classes::Classes;
use compiler::Compiler;
use expanded::{Expanded, Place};
use meshes::{Meshes, ReadMesh};
use notices::Notices;
use std::collections::HashSet;
use std::path::Path;
use tree::{LinkPlace, Tree};

/// Result of reading an MJCF.
#[derive(Clone, Debug, PartialEq)]
pub struct MjcfRobot {
    /// The robot on a fixed base.
    pub model: Model,
    /// Contents that the model cannot represent, in the order of reading; at most 200 are kept.
    pub notices: Vec<MjcfNotice>,
}

/// Reads an MJCF without `<include>`.
///
/// # Errors
/// Malformed XML, not an MJCF, an `<include>`, or no tree of bodies on one fixed base; with line and column.
#[doc(alias("mujoco"))]
pub fn read_mjcf(text: &str) -> Result<MjcfRobot, MjcfError> {
    read_mjcf_with(text, |_| Err("files are included only where the MJCF is read from a file".to_owned()))
}

/// Reads an MJCF; `include` returns the text of a file named by an `<include>`, or the reason why it cannot be read.
///
/// # Errors
/// Those of [`read_mjcf`] and of `include`; a fault in an included file names the file.
pub fn read_mjcf_with(
    text: &str,
    mut include: impl FnMut(&str) -> Result<String, String>,
) -> Result<MjcfRobot, MjcfError> {
    let document = Expanded::new(text, &mut include)?;
    let mut no_mesh = |_: &str| Err("meshes are read only where the MJCF is read from a file".to_owned());
    let found = read(&document, &mut no_mesh)?;
    Ok(MjcfRobot { model: found.model, notices: found.notices })
}

/// Reads an MJCF in `folder`, with its included files and with the meshes on which masses depend.
///
/// # Errors
/// Those of [`read_mjcf`], and an included file that cannot be read. A mesh that cannot be read gives a notice.
pub fn read_mjcf_in(text: &str, folder: &Path) -> Result<MjcfRobot, MjcfError> {
    let document = Expanded::new(text, &mut included_from(folder))?;
    let mut mesh = |file: &str| read_mujoco_mesh(folder, file).map_err(|error| error.to_string());
    let found = read(&document, &mut mesh)?;
    Ok(MjcfRobot { model: found.model, notices: found.notices })
}

struct Found {
    model: Model,
    notices: Vec<MjcfNotice>,
    compiler: Compiler,
    links: Vec<LinkPlace>,
    joint_places: Vec<Place>,
    unknown: HashSet<String>,
}

fn read(document: &Expanded, read_mesh: &mut ReadMesh<'_>) -> Result<Found, MjcfError> {
    let compiler = Compiler::new(document)?;
    let classes = Classes::new(document)?;
    let mut meshes = Meshes::new(document, &classes, &compiler, read_mesh)?;
    let mut notices = Notices::default();
    let mut tree = Reader::new(document, &classes, &compiler, &mut meshes, &mut notices).tree()?;
    let driven = drives::efforts(document, &classes, &mut tree, &mut notices)?;
    let connects = drives::couplings(document, &mut tree, &mut notices)?;
    drives::tendons(document, &mut notices)?;
    let gravity = drives::gravity(document, &mut notices)?;
    let root = document.root();
    if tree.joints.is_empty() {
        return Err(document.fault(root.place, MjcfFault::NoMovingJoint));
    }
    let name = root.attribute("model").map_or("robot", |name| &name.value);
    let Tree { joints, bodies, base, links, joint_places, unknown, references, .. } = tree;
    let model = Model::new(name, base, joints, bodies).and_then(|model| model.with_gravity(gravity));
    let model = model.map_err(|error| document.fault(root.place, MjcfFault::Model(error)))?;
    let around = ChainContext { document, links: &links, references: &references, driven: &driven };
    let model = chains::closed(model, &connects, &around, &mut notices)?;
    Ok(Found { model, notices: notices.list, compiler, links, joint_places, unknown })
}
