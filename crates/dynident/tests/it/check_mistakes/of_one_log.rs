//! Mistakes in the held-out log only.

use super::{Case, JOINTS, SAME, check_text, checked_in, each, problems, study_of, write_noisy};
use crate::common::{Job, Motion, Truth, header, repository, write_log};

#[test]
fn mistakes_of_the_held_out_log_are_named_as_its_own() {
    let cases = [
        Case {
            name: "degrees",
            rows: |rows| each(rows, |row| row[1..7].iter_mut().for_each(|q| *q = q.to_degrees())),
            study: SAME,
            kind: "unit",
            named: &["[[log]] 2: format.position write `unit = \"deg\"`"],
        },
        Case {
            name: "the lift's torque",
            rows: |rows| each(rows, |row| row[8] = -row[8]),
            study: SAME,
            kind: "sign",
            named: &["[[log]] 2: format.torque write `sign = [1, -1, 1, 1, 1, 1]`"],
        },
        Case {
            name: "the last wrist's torque",
            rows: |rows| each(rows, |row| row[12] = -row[12]),
            study: SAME,
            kind: "sign",
            named: &[JOINTS[5]],
        },
        Case {
            name: "the lift's zero",
            rows: |rows| each(rows, |row| row[2] += 0.5),
            study: SAME,
            kind: "offset",
            // 0.5 rad within 0.03.
            named: &[
                "offset = [0.0, -0.5, ",
                "offset = [0.0, -0.49",
                "offset = [0.0, -0.50",
                "offset = [0.0, -0.48",
                "offset = [0.0, -0.51",
            ],
        },
    ];
    let mut missed = Vec::new();
    for case in &cases {
        let found = problems(&checked_in(case, &["test.csv"]));
        let first = found.first();
        let is_right = |(kind, text): &(String, String)| {
            kind == case.kind && text.starts_with("in log `test`") && case.named.iter().any(|name| text.contains(name))
        };
        if !first.is_some_and(is_right) {
            missed.push(format!("{}: {found:?}", case.name));
        }
    }
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// Friction of another day explains no reversed sign, and is no mistake.
#[test]
fn a_reversed_torque_is_named_despite_other_friction() {
    let description = repository("robots/ur10.urdf");
    for sign in [1.0, -1.0] {
        let folder = tempfile::tempdir().unwrap();
        let mut truth = Truth::near(&description, 0.1, false);
        write_noisy(&folder.path().join("train.csv"), &truth, 1);
        for [_, viscous, coulomb, _] in &mut truth.drive {
            (*viscous, *coulomb) = (1.4 * *viscous, 1.4 * *coulomb);
        }
        write_log(
            &folder.path().join("test.csv"),
            &truth,
            &Motion::new(6, 102),
            (200.0, 20.0),
            &header(6),
            |q, tau| {
                let mut tau = tau.to_vec();
                tau[2] *= sign;
                [q, &tau[..]].concat()
            },
        );
        let found = problems(&check_text(folder.path(), &study_of(&description, 6, &["train.csv", "test.csv"])));
        let is_named = found.iter().any(|(kind, text)| kind == "sign" && text.contains(JOINTS[2]));
        assert_eq!(is_named, sign < 0.0, "{found:?}");
    }
}

/// The torque of a model as effort.
#[test]
fn torques_of_the_description_are_named() {
    let description = repository("robots/ur10.urdf");
    let is_named = |friction: f64| {
        let folder = tempfile::tempdir().unwrap();
        let mut truth = Truth::near(&description, 0.0, false);
        truth.drive.iter_mut().for_each(|drive| *drive = drive.map(|value| friction * value));
        write_noisy(&folder.path().join("test.csv"), &truth, 2);
        write_log(
            &folder.path().join("train.csv"),
            &truth,
            &Motion::new(6, 101),
            (200.0, 20.0),
            &header(6),
            |q, tau| [q, tau].concat(),
        );
        let check = check_text(folder.path(), &study_of(&description, 6, &["train.csv", "test.csv"]));
        check.findings.iter().any(|finding| finding.what.starts_with("the torques are those of the robot description"))
    };
    assert_eq!([0.0, 1.0].map(is_named), [true, false]);
}

/// Exchanged torques of two runs with equal length: no hypothesis explains them.
#[test]
fn torques_of_another_run_make_no_model() {
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str| std::fs::read_to_string(repository(&format!("examples/ur10_simulated/{name}"))).unwrap();
    let texts = [read("train.csv"), read("test.csv")];
    let exchanged = |one: &str, other: &str| -> String {
        let half = |line: &str, torque: bool| {
            let at = line.match_indices(',').nth(6).unwrap().0;
            if torque { line[at..].to_owned() } else { line[..at].to_owned() }
        };
        one.lines().zip(other.lines()).map(|(one, other)| half(one, false) + &half(other, true) + "\n").collect()
    };
    std::fs::write(folder.path().join("train.csv"), exchanged(&texts[0], &texts[1])).unwrap();
    std::fs::write(folder.path().join("test.csv"), exchanged(&texts[1], &texts[0])).unwrap();
    let study = std::fs::read_to_string(repository("examples/ur10_simulated.toml"))
        .unwrap()
        .replace("../robots/", &format!("{}/", repository("robots").display()))
        .replace("ur10_simulated/", "");
    let problems = Job::new(folder.path(), &study).identify().result.problems;
    assert!(!problems.is_empty());
}
