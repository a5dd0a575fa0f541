//! Triangle meshes.

use crate::spatial::Vec3;

/// A triangle mesh with shared vertices. A file without faces gives vertices only.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// Unique vertices, in an order that depends only on the coordinates.
    pub vertices: Vec<Vec3>,
    /// Vertex indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

impl TriangleMesh {
    pub(super) fn merged(vertices: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let bits: Vec<[u64; 3]> = vertices.iter().map(|v| v.0.map(|x| (x + 0.0).to_bits())).collect();
        let mut ordered = bits.clone();
        ordered.sort_unstable();
        ordered.dedup();
        let place = |corner: u32| ordered.binary_search(&bits[corner as usize]).map_or(0, |place| place as u32);
        let is_triangle = |[a, b, c]: &[u32; 3]| a != b && b != c && a != c;
        Self {
            triangles: triangles.iter().map(|corners| corners.map(place)).filter(is_triangle).collect(),
            vertices: ordered.into_iter().map(|bits| Vec3(bits.map(f64::from_bits))).collect(),
        }
    }

    pub(super) fn of_corners(corners: &[Vec3]) -> Self {
        let triangles: Vec<[u32; 3]> = (0..corners.len() as u32 / 3).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        Self::merged(corners, &triangles)
    }
}
