//! A convex solid around a shape: the hull of a few corners, enlarged by a radius.

use super::{CollisionGeometry, CollisionShape, MeshError, TriangleMesh, read_mesh};
use crate::spatial::{Transform, Vec3};
use std::path::Path;

/// All points within `radius_m` of the convex hull of `corners_m`, in the caller's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    /// Corners of the hull, m; at least one.
    pub corners_m: Vec<Vec3>,
    /// Radius around the hull, m.
    pub radius_m: f64,
    /// Surface triangles of a mesh, as indices of corners; otherwise empty.
    pub triangles: Vec<[u32; 3]>,
}

/// Number of sides of the prism that contains a cylinder; its corners extend 2 % beyond the cylinder.
const PRISM_SIDES: usize = 16;

impl CollisionShape {
    /// A solid in the link's frame that contains the shape: exact for boxes, spheres and capsules, a prism with 16
    /// sides for a cylinder, and all vertices for a mesh (simulators also use the hull). `folder` is the folder of the
    /// description.
    ///
    /// # Errors
    /// A mesh that is missing or unreadable, or an unsupported shape.
    pub fn solid(&self, folder: &Path) -> Result<Solid, MeshError> {
        let mut triangles = Vec::new();
        let (mut corners_m, radius_m) = match &self.geometry {
            CollisionGeometry::Box { size_m } => {
                let corner = |index: usize| {
                    Vec3(core::array::from_fn(|axis| if index >> axis & 1 == 0 { -0.5 } else { 0.5 } * size_m[axis]))
                };
                ((0..8).map(corner).collect(), 0.0)
            }
            CollisionGeometry::Cylinder { radius_m, length_m } => {
                let outer = radius_m / (core::f64::consts::PI / PRISM_SIDES as f64).cos();
                let corner = |side: usize, z: f64| {
                    let (sin, cos) = (core::f64::consts::TAU * side as f64 / PRISM_SIDES as f64).sin_cos();
                    Vec3([outer * cos, outer * sin, z])
                };
                let ends = [-0.5 * length_m, 0.5 * length_m];
                (
                    ends.into_iter()
                        .flat_map(|z| (0..PRISM_SIDES).map(move |side| corner(side, z)))
                        .collect::<Vec<_>>(),
                    0.0,
                )
            }
            CollisionGeometry::Sphere { radius_m } => (vec![Vec3::ZERO], *radius_m),
            CollisionGeometry::Capsule { radius_m, length_m } => {
                ([-0.5, 0.5].map(|share| Vec3([0.0, 0.0, share * length_m])).to_vec(), *radius_m)
            }
            CollisionGeometry::Mesh { file, scale } => {
                let scaled = |v: Vec3| Vec3(core::array::from_fn(|axis| scale[axis] * v.0[axis]));
                let mesh: TriangleMesh = read_mesh(folder, file)?;
                triangles = mesh.triangles;
                (mesh.vertices.into_iter().map(scaled).collect(), 0.0)
            }
            CollisionGeometry::Unsupported { what } => return Err(MeshError::Unsupported { what: what.clone() }),
        };
        for corner in &mut corners_m {
            *corner = self.placement.point(*corner);
        }
        Ok(Solid { corners_m, radius_m, triangles })
    }
}

impl Solid {
    /// Returns the solid in another frame.
    #[must_use]
    pub fn placed(&self, to_from_here: &Transform) -> Self {
        Self {
            corners_m: self.corners_m.iter().map(|corner| to_from_here.point(*corner)).collect(),
            radius_m: self.radius_m,
            triangles: self.triangles.clone(),
        }
    }
}
