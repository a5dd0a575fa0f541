//! Mistakes in the held-out log only.

use super::{Case, JOINTS, SAME, beside_limits, check_text, each, prepared, problems, study_of, write_noisy};
use crate::common::{Job, Motion, Truth, header, repository, write_log};
use dynident::model::{InertialParameters, Mat3, Vec3};

#[test]
fn mistakes_of_the_held_out_log_are_named_as_its_own() {
    let cases = [
        Case {
            name: "degrees",
            rows: |rows| each(rows, |row| row[1..7].iter_mut().for_each(|q| *q = q.to_degrees())),
            study: SAME,
            kind: "unit",
            named: &["in [[log]] 2 write `format = {", "unit = \"deg\""],
        },
        Case {
            name: "the lift's torque",
            rows: |rows| each(rows, |row| row[8] = -row[8]),
            study: SAME,
            kind: "sign",
            named: &["sign = [1.0, -1.0, 1.0, 1.0, 1.0, 1.0]"],
        },
        Case {
            name: "the last wrist's torque",
            rows: |rows| each(rows, |row| row[12] = -row[12]),
            study: SAME,
            kind: "sign",
            named: &[JOINTS[5]],
        },
        Case {
            name: "two torques exchanged",
            rows: |rows| each(rows, |row| row.swap(8, 9)),
            study: SAME,
            kind: "order",
            named: &[JOINTS[1]],
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
        let (folder, study) = prepared(case, &["test.csv"]);
        let check = check_text(folder.path(), &study);
        let found = problems(&check);
        let first = found.first();
        let is_right = |(kind, text): &(String, String)| {
            kind == case.kind && text.starts_with("in log `test`") && case.named.iter().any(|name| text.contains(name))
        };
        if !first.is_some_and(is_right) {
            missed.push(format!("{}: {found:?}", case.name));
            continue;
        }
        // The line can be written as it is printed, and helps.
        let mut corrected: toml::Table = study.parse().unwrap();
        let log = corrected["log"][1].as_table_mut().unwrap();
        check.findings.iter().flat_map(|finding| &finding.write).for_each(|change| {
            assert_eq!(change.table, "[[log]] 2", "{}", case.name);
            log.extend(change.line.parse::<toml::Table>().unwrap());
        });
        let again = problems(&check_text(folder.path(), &corrected.to_string()));
        if !again.is_empty() {
            missed.push(format!("{} after the correction: {again:?}", case.name));
        }
    }
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// Two torque columns of the held-out log are exchanged. A payload was once named, although the exchange leaves a
/// fraction of its residual.
#[test]
fn exchanged_torques_are_no_payload() {
    let description = repository("robots/ur10.urdf");
    for [a, b] in [[0, 1], [1, 2], [2, 4], [3, 5]] {
        let folder = tempfile::tempdir().unwrap();
        let truth = Truth::near(&description, 0.1, false);
        write_noisy(&folder.path().join("train.csv"), &truth, 1);
        write_noisy(&folder.path().join("test.csv"), &truth, 2);
        let study = study_of(&description, 6, &["train.csv", "test.csv"]);
        let mut names: Vec<String> = (1..=6).map(|joint| format!("tau{joint}")).collect();
        names.swap(a, b);
        let test = format!(
            "format = {{ time = {{ column = \"t\" }}, position = {{ columns = \"q{{1..6}}\" }}, torque = {{ columns = {names:?} }} }}\n"
        );
        let found = beside_limits(&check_text(folder.path(), &(study + &test)));
        let first = found.first().expect("a problem");
        assert!(first.0 == "order" && first.1.contains("in log `test`"), "{a} {b}: {found:?}");
    }
}

/// One training log carries a payload that the study declares; the hypotheses are those of the bare arm.
#[test]
fn a_declared_payload_of_a_training_log_is_no_mistake() {
    let description = repository("robots/ur10.urdf");
    let folder = tempfile::tempdir().unwrap();
    let mut truth = Truth::near(&description, 0.1, false);
    write_noisy(&folder.path().join("bare.csv"), &truth, 1);
    write_noisy(&folder.path().join("test.csv"), &truth, 2);
    let mut bodies = truth.model.inertials().to_vec();
    let inertia = Mat3([[0.02, 0.0, 0.0], [0.0, 0.02, 0.0], [0.0, 0.0, 0.02]]);
    let payload = InertialParameters::from_centre_of_mass(8.0, Vec3([0.02, 0.03, 0.1]), &inertia);
    *bodies.last_mut().unwrap() = bodies.last().unwrap().plus(&payload);
    truth.model = truth.model.with_inertials(&bodies).unwrap();
    write_noisy(&folder.path().join("loaded.csv"), &truth, 3);
    let study = study_of(&description, 6, &["bare.csv", "test.csv"])
        + "[[log]]\nfile = \"loaded.csv\"\npayload = \"box\"\n[[payload]]\nname = \"box\"\n";
    let link = truth.model.bodies().last().unwrap().name();
    let known = "mass_kg = 8.0\ncom_m = [0.02, 0.03, 0.1]\ninertia_at_com_kgm2 = [0.02, 0, 0, 0.02, 0, 0.02]\n";
    let found = check_text(folder.path(), &format!("{study}link = {link:?}\n{known}"));
    assert_eq!(beside_limits(&found), []);
    assert!(found.as_written.unwrap().left_percent.iter().all(|left| *left < 20.0));
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
