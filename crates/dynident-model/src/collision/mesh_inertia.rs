//! Volume, centre and inertia of a triangle mesh, computed as MuJoCo computes them.

use super::hull::convex_hull;
use super::mesh::TriangleMesh;
use crate::spatial::{Mat3, Vec3};
use thiserror::Error;

/// Areas, volumes and lengths of normals below this are treated as zero, as in MuJoCo (`mjMINVAL`).
const SMALLEST: f64 = 1e-15;

/// Which body a mesh represents: the attribute `inertia` of an MJCF mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MeshInertiaMode {
    /// Pyramids between the surface and its centroid, all with positive volume: MuJoCo's default. It exceeds the real
    /// volume of shapes that are not star-shaped.
    #[default]
    Legacy,
    /// The solid inside the surface, which must be closed with outward normals.
    Exact,
    /// The convex hull of all vertices.
    Convex,
    /// The surface with a constant mass per area.
    Shell,
}

/// Mass properties of a mesh with the density 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshInertia {
    /// Volume, m³; for [`MeshInertiaMode::Shell`] the area, m².
    pub size: f64,
    /// Centre in the mesh frame, m.
    pub centre_m: Vec3,
    /// Inertia about the centre in the axes of the mesh frame, m⁵; for [`MeshInertiaMode::Shell`] m⁴.
    pub inertia_at_centre: Mat3,
}

/// Why a mesh has no mass properties.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe the fields")]
pub enum MeshInertiaFault {
    /// All triangles of the mesh have no area, so MuJoCo cannot compute a mass from it. Repair the mesh, or give the
    /// body an `<inertial>`.
    #[error("its surface area is zero")]
    NoArea,
    /// The mesh is flat or not closed, so that it has no volume for a mass. Write `inertia="shell"`, or give the body
    /// an `<inertial>`.
    #[error("its volume is zero; use inertia=\"shell\" if it is a surface")]
    NoVolume,
    /// The triangles of the mesh have the reverse order of corners. Recalculate the normals in a mesh editor, or give
    /// the body an `<inertial>`.
    #[error("its volume is negative: its triangles are oriented inward")]
    Negative,
    /// Some triangles of the mesh face inward and others outward. Repair the mesh, write another `inertia`, or give the
    /// body an `<inertial>`.
    #[error("its triangles have inconsistent orientations, with which inertia=\"exact\" is undefined")]
    Orientation,
    /// The points of the mesh are on one plane or line, so that their convex hull has no volume. Repair the mesh, or
    /// give the body an `<inertial>`.
    #[error("its vertices have no convex hull with a volume")]
    NoHull,
}

/// Computes the mass properties of a mesh. A mesh without triangles is the convex hull of its vertices.
///
/// A surface triangle with corners `D, E, F`, centre `c`, area `A` and unit normal `n` spans a pyramid from the
/// origin with the volume `V = n·c A/3`. Its products of inertia are `V/20 Σ (2 D Dᵀ + .. + D Eᵀ + ..)`. `Legacy`
/// uses `|V|`: pyramids from the centroid of the surface for the centre, then pyramids from that centre for volume
/// and inertia.
///
/// # Errors
/// An area or volume that is zero or negative, orientations that contradict each other, or vertices without a hull.
/// Source: MuJoCo, `mjCMesh::Process`.
pub fn mesh_inertia(mesh: &TriangleMesh, mode: MeshInertiaMode) -> Result<MeshInertia, MeshInertiaFault> {
    let hull = if mode == MeshInertiaMode::Convex || mesh.triangles.is_empty() {
        convex_hull(&mesh.vertices).ok_or(MeshInertiaFault::NoHull)?
    } else {
        Vec::new()
    };
    let surface = if mesh.triangles.is_empty() { &hull } else { &mesh.triangles };
    let solid = if mode == MeshInertiaMode::Convex { &hull } else { surface };
    if mode == MeshInertiaMode::Exact && !is_oriented(&mesh.vertices, surface) {
        return Err(MeshInertiaFault::Orientation);
    }
    let corners = |triangle: &[u32; 3]| triangle.map(|corner| mesh.vertices[corner as usize]);
    let (mut area, mut centroid) = (0.0, Vec3::ZERO);
    for face in surface.iter().map(|triangle| Face::new(corners(triangle))) {
        area += face.area;
        centroid += face.centre.scale(face.area);
    }
    if area < SMALLEST {
        return Err(MeshInertiaFault::NoArea);
    }
    let centroid = centroid.scale(1.0 / area);
    let (mut size, mut centre_m) = (0.0, Vec3::ZERO);
    for face in solid.iter().map(|triangle| Face::new(corners(triangle))) {
        let part = face.part(centroid, mode);
        size += part;
        centre_m += (face.centre.scale(0.75) + centroid.scale(0.25)).scale(part);
    }
    if size < SMALLEST {
        return Err(if size < 0.0 { MeshInertiaFault::Negative } else { MeshInertiaFault::NoVolume });
    }
    let centre_m = centre_m.scale(1.0 / size);
    let divisor = if mode == MeshInertiaMode::Shell { 12.0 } else { 20.0 };
    let (mut size, mut products): (f64, Mat3) = (0.0, Mat3::ZERO);
    for triangle in solid {
        let [d, e, f] = corners(triangle).map(|corner| corner - centre_m);
        let part = Face::new([d, e, f]).part(Vec3::ZERO, mode);
        size += part;
        for (row, column) in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)] {
            let of = |one: Vec3, other: Vec3| one[row] * other[column] + one[column] * other[row];
            let sum = of(d, d) + of(e, e) + of(f, f) + of(d, e) + of(d, f) + of(e, f);
            products.0[row][column] += part / divisor * sum;
        }
    }
    let p = products.0;
    let inertia_at_centre = Mat3([
        [p[1][1] + p[2][2], -p[0][1], -p[0][2]],
        [-p[0][1], p[0][0] + p[2][2], -p[1][2]],
        [-p[0][2], -p[1][2], p[0][0] + p[1][1]],
    ]);
    Ok(MeshInertia { size, centre_m, inertia_at_centre })
}

struct Face {
    area: f64,
    /// Unit normal; zero for a face without area.
    normal: Vec3,
    centre: Vec3,
}

impl Face {
    fn new([a, b, c]: [Vec3; 3]) -> Self {
        let centre = (a + b + c).scale(1.0 / 3.0);
        let normal = (b - a).cross(c - a);
        let length = normal.norm();
        if length < SMALLEST {
            return Self { area: 0.0, normal: Vec3::ZERO, centre };
        }
        Self { area: 0.5 * length, normal: normal.scale(1.0 / length), centre }
    }

    /// Volume of the pyramid from `apex` to the face; for a shell the area.
    fn part(&self, apex: Vec3, mode: MeshInertiaMode) -> f64 {
        let volume = (self.centre - apex).dot(self.normal) * self.area / 3.0;
        match mode {
            MeshInertiaMode::Shell => self.area,
            MeshInertiaMode::Legacy => volume.abs(),
            MeshInertiaMode::Exact | MeshInertiaMode::Convex => volume,
        }
    }
}

/// Whether no two faces run along an edge in the same direction (consistent orientation). Faces smaller than 3e-8 m²
/// are ignored, as in MuJoCo.
fn is_oriented(vertices: &[Vec3], triangles: &[[u32; 3]]) -> bool {
    let is_large =
        |triangle: &&[u32; 3]| Face::new(triangle.map(|corner| vertices[corner as usize])).area > SMALLEST.sqrt();
    let mut edges: Vec<[u32; 2]> =
        triangles.iter().filter(is_large).flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
    edges.sort_unstable();
    edges.windows(2).all(|pair| pair[0] != pair[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box with edges along the axes; the order of corners gives outward normals.
    fn cuboid(from: [f64; 3], size: [f64; 3]) -> TriangleMesh {
        let corner =
            |index: usize| Vec3(core::array::from_fn(|k| from[k] + if index >> k & 1 == 1 { size[k] } else { 0.0 }));
        let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let triangles: Vec<[u32; 3]> = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        TriangleMesh::merged(&(0..8).map(corner).collect::<Vec<_>>(), &triangles)
    }

    fn is_near(found: &MeshInertia, size: f64, centre: [f64; 3], moments: [f64; 3]) -> bool {
        let near = |a: f64, b: f64| (a - b).abs() < 1e-14;
        near(found.size, size)
            && (0..3).all(|k| near(found.centre_m[k], centre[k]) && near(found.inertia_at_centre.0[k][k], moments[k]))
            && [(0, 1), (0, 2), (1, 2)].iter().all(|&(a, b)| near(found.inertia_at_centre.0[a][b], 0.0))
    }

    #[test]
    fn all_solid_modes_give_the_inertia_of_a_box_and_a_shell_that_of_its_surface() {
        let (mesh, [a, b, c]) = (cuboid([0.3, -0.1, 0.2], [0.4, 0.6, 0.2]), [0.4, 0.6, 0.2]);
        let volume: f64 = a * b * c;
        let moments = [b * b + c * c, a * a + c * c, a * a + b * b].map(|sum| volume * sum / 12.0);
        for mode in [MeshInertiaMode::Legacy, MeshInertiaMode::Exact, MeshInertiaMode::Convex] {
            let found = mesh_inertia(&mesh, mode).unwrap();
            assert!(is_near(&found, volume, [0.5, 0.2, 0.3], moments), "{mode:?}: {found:?}");
        }
        let hull = TriangleMesh { triangles: Vec::new(), ..mesh.clone() };
        assert!(is_near(&mesh_inertia(&hull, MeshInertiaMode::Exact).unwrap(), volume, [0.5, 0.2, 0.3], moments));
        // Six plates: those across an axis at half the edge, the others as rectangles.
        let square = |k: usize| {
            let s = [a, b, c];
            let faces = [b * c, a * c, a * b];
            (0..3).map(|n| 2.0 * faces[n] * if n == k { s[k] * s[k] / 4.0 } else { s[k] * s[k] / 12.0 }).sum::<f64>()
        };
        let [x, y, z] = [square(0), square(1), square(2)];
        let area = 2.0 * (a * b + b * c + a * c);
        let found = mesh_inertia(&mesh, MeshInertiaMode::Shell).unwrap();
        assert!(is_near(&found, area, [0.5, 0.2, 0.3], [y + z, x + z, x + y]), "{found:?}");
    }

    #[test]
    fn invalid_meshes_are_refused() {
        let mesh = cuboid([0.0; 3], [1.0; 3]);
        let inward =
            TriangleMesh { triangles: mesh.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect(), ..mesh.clone() };
        assert_eq!(mesh_inertia(&inward, MeshInertiaMode::Exact), Err(MeshInertiaFault::Negative));
        assert!(mesh_inertia(&inward, MeshInertiaMode::Legacy).is_ok());
        let mut mixed = mesh.clone();
        mixed.triangles[0].swap(0, 1);
        assert_eq!(mesh_inertia(&mixed, MeshInertiaMode::Exact), Err(MeshInertiaFault::Orientation));
        let flat = cuboid([0.0; 3], [1.0, 1.0, 0.0]);
        assert_eq!(mesh_inertia(&flat, MeshInertiaMode::Legacy), Err(MeshInertiaFault::NoVolume));
        assert_eq!(mesh_inertia(&flat, MeshInertiaMode::Convex), Err(MeshInertiaFault::NoHull));
        let point = TriangleMesh { triangles: vec![[0, 0, 0]], ..mesh };
        assert_eq!(mesh_inertia(&point, MeshInertiaMode::Shell), Err(MeshInertiaFault::NoArea));
    }
}
