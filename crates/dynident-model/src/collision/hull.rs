//! Convex hull of points in space.
//!
//! Incremental algorithm: each point outside the hull replaces the faces that are visible from it by triangles to the
//! rim of these faces (Preparata and Hong, Comm. ACM 20(2), 1977).

use crate::spatial::Vec3;
use std::collections::HashMap;

/// Distance from a face, relative to the extent of the points, below which a point is treated as on the face. The
/// rounding error of a distance is about 1e-15; the volume changes by less than this share.
const RELATIVE_TOLERANCE: f64 = 1e-13;

struct Face {
    corners: [u32; 3],
    normal: Vec3,
    offset: f64,
    is_alive: bool,
}

struct Hull<'p> {
    points: &'p [Vec3],
    faces: Vec<Face>,
    /// The face to the left of each directed edge.
    faces_of_edges: HashMap<[u32; 2], usize>,
    tolerance: f64,
}

/// Triangles of the convex hull with outward normals, as indices of points. `None` if the points are in a plane, or if
/// rounding errors prevent a closed surface.
pub(super) fn convex_hull(points: &[Vec3]) -> Option<Vec<[u32; 3]>> {
    let first = points.first()?;
    let extent = points.iter().map(|point| (*point - *first).norm()).fold(0.0, f64::max);
    let tolerance = RELATIVE_TOLERANCE * extent;
    let corners = simplex(points, 1e-9 * extent)?;
    let mut hull = Hull { points, faces: Vec::new(), faces_of_edges: HashMap::new(), tolerance };
    let [a, b, c, d] = corners;
    for triangle in [[a, c, b], [a, b, d], [b, c, d], [c, a, d]] {
        hull.add(triangle)?;
    }
    // Points far from the start come first: afterwards most other points are inside.
    let centre = corners.iter().fold(Vec3::ZERO, |sum, &corner| sum + points[corner as usize]).scale(0.25);
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    let distance = |index: u32| (points[index as usize] - centre).norm();
    order.sort_by(|&one, &other| distance(other).total_cmp(&distance(one)));
    for point in order {
        hull.include(point)?;
    }
    Some(hull.faces.into_iter().filter(|face| face.is_alive).map(|face| face.corners).collect())
}

/// Four points of a tetrahedron with positive volume; each is farther than `least` from the plane of the others.
fn simplex(points: &[Vec3], least: f64) -> Option<[u32; 4]> {
    let farthest = |distance: &dyn Fn(Vec3) -> f64| -> Option<u32> {
        let (mut best, mut index) = (least, None);
        for (at, point) in points.iter().enumerate() {
            let found = distance(*point).abs();
            if found > best {
                (best, index) = (found, Some(at as u32));
            }
        }
        index
    };
    let a = 0;
    let at = |index: u32| points[index as usize];
    let b = farthest(&|point| (point - at(a)).norm())?;
    let along = at(b) - at(a);
    let along = along.scale(1.0 / along.norm());
    let c = farthest(&|point| (point - at(a)).cross(along).norm())?;
    let normal = (at(b) - at(a)).cross(at(c) - at(a));
    let normal = normal.scale(1.0 / normal.norm());
    let d = farthest(&|point| (point - at(a)).dot(normal))?;
    Some(if (at(d) - at(a)).dot(normal) > 0.0 { [a, b, c, d] } else { [a, c, b, d] })
}

impl Hull<'_> {
    fn add(&mut self, corners: [u32; 3]) -> Option<()> {
        let [a, b, c] = corners.map(|corner| self.points[corner as usize]);
        let normal = (b - a).cross(c - a);
        let length = normal.norm();
        let normal = if length > 0.0 { normal.scale(1.0 / length) } else { Vec3::ZERO };
        let index = self.faces.len();
        let [a_index, b_index, c_index] = corners;
        for edge in [[a_index, b_index], [b_index, c_index], [c_index, a_index]] {
            if self.faces_of_edges.insert(edge, index).is_some() {
                return None;
            }
        }
        self.faces.push(Face { corners, normal, offset: normal.dot(a), is_alive: true });
        Some(())
    }

    fn sees(&self, point: u32, face: usize) -> bool {
        let face = &self.faces[face];
        face.normal.dot(self.points[point as usize]) - face.offset > self.tolerance
    }

    fn include(&mut self, point: u32) -> Option<()> {
        let seen = |face: usize| self.faces[face].is_alive && self.sees(point, face);
        let Some(first) = (0..self.faces.len()).find(|&face| seen(face)) else { return Some(()) };
        let (mut visible, mut rim) = (vec![first], Vec::new());
        self.faces[first].is_alive = false;
        let mut next = 0;
        while next < visible.len() {
            let [a, b, c] = self.faces[visible[next]].corners;
            next += 1;
            for [from, to] in [[a, b], [b, c], [c, a]] {
                let other = *self.faces_of_edges.get(&[to, from])?;
                if !self.faces[other].is_alive {
                    continue;
                }
                if self.sees(point, other) {
                    self.faces[other].is_alive = false;
                    visible.push(other);
                } else {
                    rim.push([from, to]);
                }
            }
        }
        for face in visible {
            let [a, b, c] = self.faces[face].corners;
            for edge in [[a, b], [b, c], [c, a]] {
                self.faces_of_edges.remove(&edge);
            }
        }
        if self.faces.len() > 64 && self.faces.len() > 4 * self.faces_of_edges.len() / 3 {
            self.compact();
        }
        for [from, to] in rim {
            self.add([from, to, point])?;
        }
        Some(())
    }

    /// Removes deleted faces.
    fn compact(&mut self) {
        self.faces.retain(|face| face.is_alive);
        for (index, face) in self.faces.iter().enumerate() {
            let [a, b, c] = face.corners;
            for edge in [[a, b], [b, c], [c, a]] {
                self.faces_of_edges.insert(edge, index);
            }
        }
    }
}
