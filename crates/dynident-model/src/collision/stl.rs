//! Triangles of a binary STL file.
//!
//! This is a separate implementation, because only the corners are needed, and the triangle count in the header must
//! not determine the allocated memory.

use crate::spatial::Vec3;

/// Header of a binary file: 80 arbitrary bytes and the number of triangles.
const HEADER_BYTES: usize = 84;
/// Bytes of a triangle: normal, three corners, attribute.
const TRIANGLE_BYTES: usize = 50;

/// Whether the file length matches the triangle count of a binary STL; a text file can have any header bytes.
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    let Some(count) = bytes.get(80..HEADER_BYTES) else { return false };
    let count = u32::from_le_bytes([count[0], count[1], count[2], count[3]]) as usize;
    let needed = count.checked_mul(TRIANGLE_BYTES).and_then(|length| length.checked_add(HEADER_BYTES));
    // Some programs append bytes to a binary file.
    let text = bytes.starts_with(b"solid") && bytes.windows(8).take(4096).any(|window| window == b"endfacet");
    needed.is_some_and(|needed| count > 0 && bytes.len() >= needed && !text)
}

pub(super) fn binary(bytes: &[u8]) -> Vec<Vec3> {
    let count =
        bytes.get(80..HEADER_BYTES).map_or(0, |count| u32::from_le_bytes([count[0], count[1], count[2], count[3]]));
    let number = |bytes: &[u8]| f64::from(f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]));
    bytes[HEADER_BYTES.min(bytes.len())..]
        .chunks_exact(TRIANGLE_BYTES)
        .take(count as usize)
        .flat_map(|triangle| triangle[12..48].chunks_exact(12))
        .map(|corner| Vec3([number(&corner[..4]), number(&corner[4..8]), number(&corner[8..12])]))
        .collect()
}
