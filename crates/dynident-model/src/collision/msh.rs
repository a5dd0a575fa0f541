//! MuJoCo's binary mesh format `.msh`: four counts (vertices, normals, texture coordinates, faces), then their values.

use super::MeshFault;
use super::mesh::TriangleMesh;
use crate::spatial::Vec3;

const HEADER_BYTES: usize = 16;

pub(super) fn read(bytes: &[u8]) -> Result<TriangleMesh, MeshFault> {
    let counts: Vec<usize> = words(bytes.get(..HEADER_BYTES).ok_or(MeshFault::Format)?)
        .map(|word| usize::try_from(i32::from_le_bytes(word)).map_err(|_| MeshFault::Format))
        .collect::<Result<_, _>>()?;
    let [vertices, normals, texture, faces] = counts[..] else { return Err(MeshFault::Format) };
    let numbers = [(vertices, 3), (normals, 3), (texture, 2), (faces, 3)];
    let needed = numbers.iter().try_fold(0_usize, |sum, &(count, each)| sum.checked_add(count.checked_mul(each)?));
    if needed.and_then(|numbers| numbers.checked_mul(4)?.checked_add(HEADER_BYTES)) != Some(bytes.len()) {
        return Err(MeshFault::Format);
    }
    let from = |number: usize| &bytes[HEADER_BYTES + 4 * number..];
    let coordinates: Vec<f64> =
        words(from(0)).take(3 * vertices).map(|word| f64::from(f32::from_le_bytes(word))).collect();
    let points: Vec<Vec3> = coordinates.chunks_exact(3).map(|point| Vec3([point[0], point[1], point[2]])).collect();
    let corner = |word| u32::try_from(i32::from_le_bytes(word)).ok().filter(|corner| (*corner as usize) < vertices);
    let corners: Option<Vec<u32>> = words(from(3 * (vertices + normals) + 2 * texture)).map(corner).collect();
    let corners = corners.ok_or(MeshFault::Face)?;
    let triangles: Vec<[u32; 3]> =
        corners.chunks_exact(3).map(|corners| [corners[0], corners[1], corners[2]]).collect();
    Ok(TriangleMesh { vertices: points, triangles })
}

fn words(bytes: &[u8]) -> impl Iterator<Item = [u8; 4]> {
    bytes.chunks_exact(4).map(|word| [word[0], word[1], word[2], word[3]])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(counts: [i32; 4], numbers: &[f32], corners: &[i32]) -> Vec<u8> {
        let mut bytes: Vec<u8> = counts.iter().flat_map(|count| count.to_le_bytes()).collect();
        bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
        bytes.extend(corners.iter().flat_map(|corner| corner.to_le_bytes()));
        bytes
    }

    #[test]
    fn vertices_and_faces_are_read_and_false_counts_are_refused() {
        let vertices = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.5, 0.0];
        let numbers = [&vertices[..], &[0.0; 6]].concat();
        let mesh = read(&file([3, 0, 3, 1], &numbers, &[0, 1, 2])).unwrap();
        assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (3, 1));
        assert_eq!(mesh.vertices[2], Vec3([0.0, 1.5, 0.0]));
        for counts in [[3, 0, 3, 2], [-3, 0, 3, 1], [i32::MAX; 4], [2, 0, 3, 1]] {
            assert_eq!(read(&file(counts, &numbers, &[0, 1, 2])), Err(MeshFault::Format), "{counts:?}");
        }
        assert_eq!(read(&file([3, 0, 3, 1], &numbers, &[0, 1, 3])), Err(MeshFault::Face));
        assert_eq!(read(&[1, 2]), Err(MeshFault::Format));
    }
}
