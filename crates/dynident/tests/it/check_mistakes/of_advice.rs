//! The advice of `check`: the study with its keys is accepted, and the unexplained torque falls as announced.

use super::{Case, JOINTS, SAME, check_text, each, prepared, problems};
use core::f64::consts::PI;
use dynident::result::{StudyChange, StudyCheck};

/// Writes a key into a table of a study.
fn apply(study: &str, change: &StudyChange) -> String {
    let mut document: toml::Table = study.parse().unwrap();
    let key: toml::Table = change.line.parse().unwrap();
    let mut table = &mut document;
    for name in change.table.split('.') {
        let next = table.entry(name.to_owned()).or_insert_with(|| toml::Value::Table(toml::Table::new()));
        table = next.as_table_mut().unwrap_or_else(|| panic!("{name} is not a table"));
    }
    table.extend(key);
    toml::to_string(&document).unwrap()
}

fn largest(percent: &[f64]) -> f64 {
    percent.iter().copied().fold(0.0, f64::max)
}

#[test]
fn followed_advice_explains_the_torque_as_announced() {
    let cases = [
        Case {
            name: "degrees",
            rows: |rows| each(rows, |row| row[1..7].iter_mut().for_each(|q| *q *= 180.0 / PI)),
            study: SAME,
            kind: "unit",
            named: &[],
        },
        Case {
            name: "reversed torque",
            rows: |rows| each(rows, |row| row[9] = -row[9]),
            study: SAME,
            kind: "sign",
            named: &[],
        },
        Case {
            name: "exchanged torques",
            rows: |rows| each(rows, |row| row.swap(8, 9)),
            study: SAME,
            kind: "order",
            named: &[],
        },
        // The line of the second correction must contain the first one.
        Case {
            name: "two reversed torques",
            rows: |rows| {
                each(rows, |row| {
                    row[8] = -row[8];
                    row[10] = -row[10];
                });
            },
            study: SAME,
            kind: "sign",
            named: &[],
        },
        Case {
            name: "zero of the elbow",
            rows: |rows| each(rows, |row| row[3] += 0.5),
            study: SAME,
            kind: "offset",
            named: &[],
        },
    ];
    for case in cases {
        let (folder, study) = prepared(&case, &["train.csv", "test.csv"]);
        let found = check_text(folder.path(), &study);
        let announced = found.best.as_ref().unwrap_or_else(|| panic!("{}: {:?}", case.name, problems(&found)));
        let changes = found.findings.iter().flat_map(|finding| &finding.write);
        let corrected = changes.fold(study, |study, change| apply(&study, change));
        let again = check_text(folder.path(), &corrected);
        assert_eq!(problems(&again), [], "{}: {corrected}", case.name);
        let left = largest(&again.as_written.unwrap().left_percent);
        // Printed numbers are rounded to a hundredth of a degree or three digits.
        assert!(left < 1.1 * largest(&announced.left_percent) + 0.5, "{}: {left} %", case.name);
    }
}

/// Torques in motor currents: joints whose factor is unknown keep their scale.
#[test]
fn the_scale_of_a_joint_without_an_estimate_is_not_invented() {
    let case = Case {
        name: "motor currents",
        rows: |rows| {
            each(rows, |row| {
                for (joint, constant) in [13.0, 13.0, 13.0, 7.0, 7.0, 7.0].into_iter().enumerate() {
                    row[7 + joint] /= constant;
                }
            });
        },
        study: SAME,
        kind: "unit",
        named: &[],
    };
    let (folder, study) = prepared(&case, &["train.csv", "test.csv"]);
    let found = check_text(folder.path(), &study);
    let unit = found.findings.iter().find(|finding| finding.kind == "unit").unwrap();
    let (change, estimated) = (&unit.write[0], |joint: &str| unit.evidence.contains(&format!("{joint} ")));
    let table: toml::Table = change.line.parse().unwrap();
    let scales: Vec<f64> = table["scale"].as_array().unwrap().iter().map(|value| value.as_float().unwrap()).collect();
    assert_eq!(scales.len(), JOINTS.len());
    for (scale, joint) in scales.iter().zip(JOINTS) {
        assert_eq!(*scale != 1.0, estimated(joint), "{joint}: {}; {}", change.line, unit.evidence);
    }
    check_text(folder.path(), &apply(&study, change));
}

/// The torque of every row belongs to twice its time: a recorder at half the rate, paired row by row.
#[test]
fn mostly_unexplained_torque_is_named() {
    let case = Case {
        name: "torque of another rate",
        rows: |rows| {
            let torques: Vec<[f64; 6]> = rows.iter().map(|row| core::array::from_fn(|joint| row[7 + joint])).collect();
            rows.truncate(torques.len() / 2);
            for (place, row) in rows.iter_mut().enumerate() {
                row[7..].copy_from_slice(&torques[2 * place]);
            }
        },
        study: SAME,
        kind: "torque",
        named: &[],
    };
    let (folder, study) = prepared(&case, &["train.csv", "test.csv"]);
    let found: StudyCheck = check_text(folder.path(), &study);
    let unexplained = found.unexplained_percent.unwrap();
    assert!(unexplained > 60.0, "{unexplained} %");
    assert!(found.noise_of_all_percent.unwrap() < 30.0, "{:?}", found.noise_of_all_percent);
    assert!(found.findings.iter().any(|finding| finding.kind == "torque"), "{:?}", found.findings);
    assert!(!found.mostly_unexplained().is_empty());
}
