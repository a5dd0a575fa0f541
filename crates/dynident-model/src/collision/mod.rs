//! The shapes of links, as the description gives them for collision checking, and points that span them.
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
mod mesh;
mod mesh_file;
mod mesh_text;
mod solid;
mod stl;

pub use mesh::TriangleMesh;
pub use mesh_file::{MeshError, MeshFault, find_mesh, read_mesh};
pub use solid::Solid;

use crate::spatial::Transform;

/// One `<collision>` of a link.
#[derive(Clone, Debug, PartialEq)]
pub struct CollisionShape {
    /// `link_from_shape`.
    pub placement: Transform,
    /// What stands there.
    pub geometry: CollisionGeometry,
}

/// A shape about its own frame's origin, m.
#[derive(Clone, Debug, PartialEq)]
pub enum CollisionGeometry {
    /// A box with these edges along x, y, z.
    Box {
        /// Lengths of the edges, m.
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
    /// A cylinder along z with half spheres beyond its ends.
    Capsule {
        /// Radius, m.
        radius_m: f64,
        /// Length of the straight part, m.
        length_m: f64,
    },
    /// A mesh in a file.
    Mesh {
        /// The file as the description names it: `package://..`, `file://..` or a path.
        file: String,
        /// Factors along x, y, z.
        scale: [f64; 3],
    },
    /// A shape of the description that its reader does not support: an unknown element, or one with invalid sizes.
    Unsupported {
        /// The element and what is wrong with it.
        what: String,
    },
}
