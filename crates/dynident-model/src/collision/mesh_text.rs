//! Vertices of meshes written as text: STL (`vertex x y z`) and Wavefront OBJ (`v x y z`).

use crate::spatial::Vec3;

/// The vertices of all lines that begin with `word`; none where one of them is no vertex.
pub(super) fn vertices(text: &str, word: &str) -> Option<Vec<Vec3>> {
    let mut found = Vec::new();
    for line in text.lines() {
        let mut words = line.split_ascii_whitespace();
        if words.next() != Some(word) {
            continue;
        }
        let mut number = || words.next()?.parse::<f64>().ok();
        found.push(Vec3([number()?, number()?, number()?]));
    }
    Some(found)
}
