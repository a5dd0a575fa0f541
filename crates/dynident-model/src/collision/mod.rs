//! Collision shapes of links, and convex solids around them.
//!
//! ```
//! use dynident_model::collision::{CollisionGeometry, CollisionShape};
//! let text = r#"<robot name="r"><link name="base"/>
//!   <link name="rod"><collision><origin xyz="0 0 0.5"/><geometry><box size="0.1 0.1 1"/></geometry></collision></link>
//!   <joint name="j" type="continuous"><parent link="base"/><child link="rod"/></joint></robot>"#;
//! let model = dynident_model::read_urdf(text)?.model;
//! let CollisionShape { geometry, placement } = &model.bodies()[0].links[0].collision[0];
//! assert_eq!(*geometry, CollisionGeometry::Box { size_m: [0.1, 0.1, 1.0] });
//! assert_eq!(placement.translation.0, [0.0, 0.0, 0.5]);
//! # Ok::<(), dynident_model::UrdfError>(())
//! ```

mod collada;
mod hull;
mod mesh;
mod mesh_file;
mod mesh_inertia;
mod mesh_text;
mod msh;
mod solid;
mod stl;

pub use mesh::TriangleMesh;
pub(crate) use mesh_file::read_mujoco_mesh;
pub use mesh_file::{MeshError, MeshFault, find_mesh, read_mesh};
pub use mesh_inertia::{MeshInertia, MeshInertiaFault, MeshInertiaMode, mesh_inertia};
pub use solid::Solid;

use crate::spatial::Transform;

/// One `<collision>` of a link.
#[derive(Clone, Debug, PartialEq)]
pub struct CollisionShape {
    /// `link_from_shape`.
    pub placement: Transform,
    /// The shape.
    pub geometry: CollisionGeometry,
}

/// A shape centred at its own frame, m.
#[derive(Clone, Debug, PartialEq)]
pub enum CollisionGeometry {
    /// A box.
    Box {
        /// Edge lengths along x, y, z, m.
        size_m: [f64; 3],
    },
    /// A cylinder along z with flat ends.
    Cylinder {
        /// Radius, m.
        radius_m: f64,
        /// Length, m.
        length_m: f64,
    },
    /// A sphere.
    Sphere {
        /// Radius, m.
        radius_m: f64,
    },
    /// A cylinder along z with hemispheres at its ends.
    Capsule {
        /// Radius, m.
        radius_m: f64,
        /// Length of the straight part, m.
        length_m: f64,
    },
    /// A mesh in a file.
    Mesh {
        /// File as named in the description: `package://..`, `file://..` or a path.
        file: String,
        /// Scale factors along x, y, z.
        scale: [f64; 3],
    },
    /// A shape that the reader does not support: an unknown element or invalid sizes.
    Unsupported {
        /// The element and its fault.
        what: String,
    },
}
