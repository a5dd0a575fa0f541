//! Generated studies: positions in units that degrees must not be mistaken for.

use crate::new_study_files::file;
use crate::new_study_mapping::{doubts, robot, written_of};
use dynident::Study;
use dynident::result::NewStudyFile;
use std::path::Path;

/// Limits that the positions of `rows` nearly reach, rad; not symmetric, so that normalised positions have an offset.
const LIMITS: [[f64; 2]; 2] = [[-1.2, 1.4], [-1.6, 1.8]];

/// A study of a robot with [`LIMITS`] and a log with these names, whose positions are those of `position`.
fn written(folder: &Path, names: [&str; 4], position: impl Fn(usize, f64) -> f64) -> (NewStudyFile, Study) {
    let path = robot(folder, ["joint1", "joint2"]);
    let text = std::fs::read_to_string(&path).unwrap();
    let text = text.replace("lower=\"-3.0\" upper=\"3.0\"", "lower=\"-1.2\" upper=\"1.4\"");
    std::fs::write(&path, text.replace("lower=\"-2.8\" upper=\"2.8\"", "lower=\"-1.6\" upper=\"1.8\"")).unwrap();
    let log = file(folder, "log.csv", &format!("t,{}\n", names.join(",")), |_, [t, q1, q2, tau1, tau2]| {
        format!("{t},{},{},{tau1},{tau2}\n", position(0, q1), position(1, q2))
    });
    written_of(&path, &[log]).unwrap()
}

const LEROBOT: [&str; 4] = [
    "observation.state[joint1.pos]",
    "observation.state[joint2.pos]",
    "observation.effort[joint1.effort]",
    "observation.effort[joint2.effort]",
];

/// Normalised positions exceed the limits in degrees: the note has the scale and the offset that give radians.
#[test]
fn normalised_positions_are_not_taken_for_degrees() {
    let folder = tempfile::tempdir().unwrap();
    let normalised = |joint: usize, q: f64| {
        let [lower, upper] = LIMITS[joint];
        (q - lower) / (upper - lower) * 200.0 - 100.0
    };
    let (found, _) = written(folder.path(), LEROBOT, normalised);
    let doubt = found.unsure.iter().find(|unsure| unsure.reason.contains("use_degrees")).unwrap();
    assert!(doubt.line.as_ref().unwrap().line.starts_with("unit"), "{doubt:?}");
    let list = |key: &str| -> Vec<f64> {
        let (_, rest) = doubt.reason.split_once(&format!("{key} = [")).unwrap();
        rest.split_once(']').unwrap().0.split(", ").map(|value| value.parse().unwrap()).collect()
    };
    let (scale, offset) = (list("scale"), list("offset"));
    for joint in 0..2 {
        for q in [-0.7, 0.0, 1.1] {
            let read = scale[joint] * normalised(joint, q) + offset[joint];
            // Rounded to five digits.
            assert!((read - q).abs() < 2e-3, "{read} {q}");
        }
    }
    // A correction of degrees would mislead.
    assert!(found.unsure.iter().all(|unsure| unsure.proposed.is_empty()), "{}", doubts(&found));

    // Degrees within the limits, and other recorders.
    let degrees = |_: usize, q: f64| q.to_degrees();
    let (found, _) = written(folder.path(), LEROBOT, degrees);
    assert!(!doubts(&found).contains("normalised") && found.check.is_some(), "{}", doubts(&found));
    let (found, _) = written(folder.path(), ["q1", "q2", "tau1", "tau2"], normalised);
    assert!(!doubts(&found).contains("normalised"), "{}", doubts(&found));
}

#[test]
fn thousandths_of_a_degree_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let (found, study) = written(folder.path(), LEROBOT, |_, q| 1000.0 * q.to_degrees());
    let position = &study.format.as_ref().unwrap().position;
    assert_eq!(position.scale.as_ref().and_then(|scale| scale.at(0)), Some(0.001), "{}", found.text);
    assert!(doubts(&found).contains("0.001 degree"), "{}", doubts(&found));
    assert!(!doubts(&found).contains("exceeds its limit"), "{}", doubts(&found));
}
