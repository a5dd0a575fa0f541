//! Text meshes: STL (`vertex x y z`) and Wavefront OBJ (`v x y z`, `f i j k`).

use super::MeshFault;
use super::mesh::TriangleMesh;
use crate::spatial::Vec3;

pub(super) fn stl(text: &str) -> Result<TriangleMesh, MeshFault> {
    let mut corners = Vec::new();
    for line in text.lines() {
        let mut words = line.split_ascii_whitespace();
        if words.next() == Some("vertex") {
            corners.push(vertex(&mut words)?);
        }
    }
    Ok(TriangleMesh::of_corners(&corners))
}

/// Selection of the objects and groups (`o`, `g`) of an OBJ whose faces are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shapes {
    All,
    /// The first object or group with faces, as in MuJoCo; vertices are always read.
    First,
}

/// Vertices and faces of an OBJ as in the file. A quadrilateral is split at its shorter diagonal, a face with more
/// corners becomes a fan. `None` if no line begins with `v`.
pub(super) fn obj(text: &str, shapes: Shapes) -> Result<Option<TriangleMesh>, MeshFault> {
    let (mut vertices, mut triangles, mut is_complete) = (Vec::new(), Vec::new(), false);
    for line in text.lines() {
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => vertices.push(vertex(&mut words)?),
            Some("o" | "g") => is_complete |= shapes == Shapes::First && !triangles.is_empty(),
            Some("f") if !is_complete => {
                let corners = words.map(|word| corner(word, vertices.len())).collect::<Option<Vec<u32>>>();
                let mut corners = corners.ok_or(MeshFault::Face)?;
                let square = |one: u32, other: u32| {
                    let edge = vertices[other as usize] - vertices[one as usize];
                    edge.dot(edge)
                };
                if let [a, b, c, d] = corners[..]
                    && square(b, d) <= square(a, c)
                {
                    corners.rotate_left(1);
                }
                for pair in corners.windows(2).skip(1) {
                    triangles.push([corners[0], pair[0], pair[1]]);
                }
            }
            _ => {}
        }
    }
    Ok((!vertices.is_empty()).then_some(TriangleMesh { vertices, triangles }))
}

fn vertex<'t>(words: &mut impl Iterator<Item = &'t str>) -> Result<Vec3, MeshFault> {
    let mut number = || words.next().and_then(|word| word.parse::<f64>().ok()).ok_or(MeshFault::Vertex);
    Ok(Vec3([number()?, number()?, number()?]))
}

/// Vertex index of a face's corner in the form `i`, `i/t`, `i//n` or `i/t/n`: 1-based, or relative to the last vertex
/// if negative.
fn corner(word: &str, count: usize) -> Option<u32> {
    let index: i64 = word.split('/').next()?.parse().ok()?;
    let count = i64::try_from(count).ok()?;
    let place = if index < 0 { count.checked_add(index)? } else { index.checked_sub(1)? };
    if (0..count).contains(&place) { u32::try_from(place).ok() } else { None }
}
