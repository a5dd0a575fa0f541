//! A valid study with random byte changes: each is parsed or rejected with its place, without a panic.
use crate::common::repository;
use dynident::{Expected, Folders, Study, StudyError, StudyFileError, StudyRobot};
use proptest::prelude::*;
use std::path::Path;

/// A study with most keys.
const STUDY: &str = r#"
name = "all keys"
[robot]
file = "robots/ur10.urdf"
joints = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint"]
lock = { wrist_3_joint = 0.5 }
gravity_m_s2 = [0.0, 0.1, -9.8]
base_rpy_deg = [0.0, 90.0, 0.0]
[drive]
drive_inertia = true
coulomb = "sign"
coulomb_dead_band = 1e-3
[drive.joints.elbow_joint]
viscous = false
coulomb_width = 0.05
[[coupling]]
name = "wrist"
joints = ["wrist_1_joint", "wrist_2_joint"]
ratios = [1.0, -2.0]
[format]
time = { column = "t", unit = "ms", scale = 1.0 }
position = { columns = "q{1..5}", unit = "deg", sign = [1, 1, -1, 1, 1] }
torque = { columns = [6, 7, 8, 9, "i5"], unit = "A", scale = 12.5 }
[motion]
differentiator = { method = "butterworth", order = 4, cutoff_hz = 8.0 }
[parallel_filter]
factor = 5
[estimator]
method = "noise-weighted"
covariance = "segments"
noise_levels = { window_rows = 21, pooled_share = 0.01 }
periods = { period_s = 5.0, skip_s = 1.0 }
simulated = { start = "description", max_iterations = 9 }
[estimator.physical]
prior = "euclidean"
total_mass_kg = [10.0, 40.0]
bodies.forearm_link = { mass_kg = [1.0, 9.0], inside = { centre_m = [0.0, 0.0, 0.2], semi_axes_m = [0.2, 0.2, 0.5] } }
[[log]]
file = "one.csv"
rows = [10, 900]
[[log]]
file = "two.csv"
fraction = [0.25, 1.0]
role = "validate"
"#;

/// Parses the study and builds its robot; both may fail with a message that names the file.
fn try_whole(text: &str) {
    let path = repository("study.toml");
    match Study::parse(text, &path) {
        Ok(study) => {
            for index in 0..study.log.len() {
                assert!(!study.log_name(index).is_empty());
                let _ = study.format_of(index).validate(&["a".to_owned()]);
            }
            let folders = Folders::new(&study, &path, None);
            if let Ok(robot) = StudyRobot::new(&study, &path, &folders) {
                assert!(robot.base().count() <= robot.model().inertial_count() + robot.terms().len());
                assert!(robot.nominal_base().is_none_or(|prior| prior.iter().all(|value| value.is_finite())));
            }
        }
        Err(error) => assert!(error.to_string().contains("study.toml"), "{error}"),
    }
}

#[test]
fn the_study_itself_is_good() {
    let study = Study::parse(STUDY, Path::new("study.toml")).unwrap();
    let robot =
        StudyRobot::new(&study, Path::new("study.toml"), &Folders::new(&study, &repository("study.toml"), None));
    assert_eq!(robot.unwrap().model().dof(), 5);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn changed_bytes(changes in prop::collection::vec((0..STUDY.len(), any::<u8>()), 1..8)) {
        let mut bytes = STUDY.as_bytes().to_vec();
        for (at, byte) in changes {
            bytes[at] = byte;
        }
        try_whole(&String::from_utf8_lossy(&bytes));
    }

    #[test]
    fn lines_lost_swapped_and_doubled(moves in prop::collection::vec((any::<prop::sample::Index>(), any::<prop::sample::Index>(), 0..3_u8), 1..5)) {
        let mut lines: Vec<&str> = STUDY.lines().collect();
        for (first, second, kind) in moves {
            let (first, second) = (first.index(lines.len()), second.index(lines.len()));
            match kind {
                0 => { lines.remove(first); }
                1 => lines.swap(first, second),
                _ => lines.insert(first, lines[second]),
            }
        }
        try_whole(&lines.join("\n"));
    }

    #[test]
    fn numbers_replaced(which in any::<prop::sample::Index>(), number in prop_oneof![
        any::<f64>().prop_map(|x| format!("{x:?}").to_lowercase()), any::<i64>().prop_map(|x| x.to_string()), Just("nan".to_owned()), Just("-inf".to_owned()),
        Just("1e308".to_owned()), Just("\"\"".to_owned()), Just("[]".to_owned())
    ]) {
        // A number follows `= `, `[` or a comma, up to the next comma, bracket or line end.
        let places: Vec<(usize, usize)> = STUDY
            .match_indices(|c: char| c.is_ascii_digit())
            .filter(|(at, _)| STUDY[..*at].ends_with([' ', '[', '-']))
            .map(|(at, _)| (at, at + STUDY[at..].find([',', ']', '\n', ' ']).unwrap_or(1)))
            .collect();
        let (from, to) = places[which.index(places.len())];
        try_whole(&format!("{}{number}{}", &STUDY[..from], &STUDY[to..]));
    }
}

#[test]
fn a_refused_number_is_there_as_data() {
    let text = "[robot]\nfile = \"arm.urdf\"\n[drive]\nlaws = [{ law = \"stribeck\", speed = -1.0, exponent = 2.0 }]\n";
    let StudyFileError::Study { source, .. } = Study::parse(text, Path::new("study.toml")).unwrap_err() else {
        panic!()
    };
    let StudyError::At { place, source } = *source else { panic!() };
    let StudyError::Number { key, value, expected: Expected::Range(least, greatest) } = *source else { panic!() };
    assert_eq!((&place[..], &key[..], value), ("drive.laws number 1", "speed", -1.0));
    assert!(least > 0.0 && greatest > least);
}
