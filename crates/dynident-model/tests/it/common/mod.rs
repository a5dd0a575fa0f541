//! Robot descriptions for tests, and a small arm.

use dynident_model::{InertialParameters, Model};
use dynident_testing::{recordings, repository};
use proptest::prelude::*;
use std::path::PathBuf;

/// All available URDF files: in the repository, and next to the recordings.
pub(crate) fn foreign_urdfs() -> Vec<PathBuf> {
    let mut directories = vec![repository("robots")];
    if let Some(data) = recordings() {
        let entries = std::fs::read_dir(data).expect("data directory").filter_map(Result::ok);
        directories.extend(entries.map(|entry| entry.path()).filter(|path| path.is_dir()));
    }
    let mut files: Vec<PathBuf> = directories
        .iter()
        .flat_map(|directory| std::fs::read_dir(directory).expect("directory"))
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|extension| extension == "urdf"))
        .collect();
    files.sort();
    files
}

/// A correct arm of three joints (one prismatic); two tool links are fixed to the last link, one of them without
/// inertial.
pub(crate) const ARM: &str = include_str!("arm.urdf");

/// One mutation of a text: place, kind, value.
pub(crate) type Mutation = (prop::sample::Index, u8, u8);

pub(crate) fn mutations() -> impl Strategy<Value = Vec<Mutation>> {
    prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), any::<u8>()), 1..6)
}

/// The text with bytes set, flipped, removed or doubled, and with `pieces` inserted.
pub(crate) fn mutate(text: &str, mutations: &[Mutation], pieces: &[&str]) -> String {
    let mut bytes = text.as_bytes().to_vec();
    for (index, what, value) in mutations {
        if bytes.is_empty() {
            break;
        }
        let at = index.index(bytes.len());
        match what % 5 {
            0 => bytes[at] = *value,
            1 => bytes[at] ^= 1 << (value % 8),
            2 => drop(bytes.drain(at..(at + usize::from(*value)).min(bytes.len()))),
            3 => drop(bytes.splice(at..at, pieces[usize::from(*value) % pieces.len()].bytes())),
            _ => {
                let copy = bytes[at..(at + usize::from(*value)).min(bytes.len())].to_vec();
                drop(bytes.splice(at..at, copy));
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Tolerance relative to the largest parameter of a body: about ten roundings of the transform to the centre of mass
/// and back.
pub(crate) fn assert_same_inertials(model: &Model, expected: &[InertialParameters], what: &str) {
    for (found, expected) in model.inertials().iter().zip(expected) {
        let scale = expected.0.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        for k in 0..10 {
            assert!((found.0[k] - expected.0[k]).abs() <= 1e-12 * scale, "{what}: {found:?} {expected:?}");
        }
    }
}

/// Every truncation of `text` within its root element is refused.
pub(crate) fn assert_truncations_are_refused(text: &str, is_refused: impl Fn(&str) -> bool) {
    for end in (0..text.trim_end().len()).filter(|&end| text.is_char_boundary(end)) {
        assert!(is_refused(&text[..end]), "{}", &text[..end]);
    }
}
