//! Corrupt samples, alone or with another mistake: spikes, rounded or repeated stamps, noise as torque; a body with ten
//! times its mass.

use super::{
    Case, JOINTS, Row, SAME, WITH_DRIVES, all_are_named, check_text, checked, checked_in, each, problems, read,
};
use crate::common::{Random, repository};
use dynident::recording::Level;
use dynident::{RunOptions, Silent, Study, identify};
use std::fmt::Write;

fn spike(rows: &mut [Row], column: usize, value: f64) {
    let middle = rows.len() / 2;
    rows[middle][column] = value;
}

/// A spike is repaired or removed, and does not hide another mistake.
#[test]
fn lone_samples_hide_no_mistake() {
    all_are_named(&[
        Case {
            name: "a spike of the position, all in degrees",
            rows: |rows| {
                each(rows, |row| row[1..7].iter_mut().for_each(|q| *q = q.to_degrees()));
                spike(rows, 3, -999.0);
            },
            study: SAME,
            kind: "unit",
            named: &["\"deg\""],
        },
        Case {
            name: "a spike of the torque, the lift reversed",
            rows: |rows| {
                each(rows, |row| row[8] = -row[8]);
                spike(rows, 10, 1e9);
            },
            study: SAME,
            kind: "sign",
            named: &["sign = [1, -1, 1"],
        },
    ]);
    for (column, value) in [(2, -999.0), (9, 300.0)] {
        let mut found = Vec::new();
        let case = Case {
            name: "a spike alone",
            rows: if column == 2 { |rows| spike(rows, 2, -999.0) } else { |rows| spike(rows, 9, 300.0) },
            study: SAME,
            kind: "",
            named: &[],
        };
        let check = checked(&case);
        found.extend(problems(&check));
        assert!(found.is_empty() && check.tried > 100, "{column} {value}: {found:?}, {} tried", check.tried);
    }
}

/// Pure noise as torque is reported as unrelated to the motion.
#[test]
fn torques_of_nothing_are_named() {
    let case = Case {
        name: "noise",
        rows: |rows| {
            let mut random = Random(7);
            each_with(rows, &mut random);
        },
        study: SAME,
        kind: "torque",
        named: &["unrelated to the motion"],
    };
    all_are_named(&[case]);
}

fn each_with(rows: &mut [Row], random: &mut Random) {
    for row in rows {
        row[7..].iter_mut().for_each(|tau| *tau = 20.0 * random.normal());
    }
}

/// Parts of a correct log give no problem; few samples per joint are not evidence.
#[test]
fn parts_of_a_log_raise_no_alarm() {
    let case = |name, rows| Case { name, rows, study: SAME, kind: "", named: &[] };
    let parts = [
        case("first 60 %", |rows| rows.truncate(1500)),
        case("last 60 %", |rows| drop(rows.drain(..1000))),
        case("middle", |rows| {
            rows.truncate(2000);
            drop(rows.drain(..500));
        }),
        case("first 40 %", |rows| rows.truncate(1000)),
    ];
    for part in &parts {
        let check = checked_in(part, &["train.csv"]);
        assert!(problems(&check).is_empty(), "{}: {:?}", part.name, problems(&check));
    }
}

/// Identified value of a parameter, held-out error in percent, and sample rate of the training log.
fn identified(change: fn(&mut Vec<Row>), decimals: Option<usize>) -> (f64, f64, f64) {
    let folder = tempfile::tempdir().unwrap();
    let study = std::fs::read_to_string(repository("examples/ur10_simulated.toml")).unwrap();
    let study = study
        .replace("../robots/ur10.urdf", &repository("robots/ur10.urdf").display().to_string())
        .replace("[format]", WITH_DRIVES)
        .replace("ur10_simulated/", "");
    for name in ["train.csv", "test.csv"] {
        let (header, mut rows) = read(name);
        change(&mut rows);
        let mut text = header + "\n";
        for row in &rows {
            let time = decimals.map_or_else(|| row[0].to_string(), |decimals| format!("{:.decimals$}", row[0]));
            let fields: Vec<String> = row[1..].iter().map(f64::to_string).collect();
            writeln!(text, "{time},{}", fields.join(",")).unwrap();
        }
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let path = folder.path().join("study.toml");
    std::fs::write(&path, study).unwrap();
    let options = RunOptions { data: None, threads: 2, progress: &Silent };
    let result = identify(&Study::load(&path).unwrap(), &path, &options).unwrap().result;
    let error = result.validation[0].model.relative_error_percent.unwrap();
    let value = result.base_parameters.iter().find(|one| one.symbol == "Iyy2").unwrap().value;
    (value, error, result.logs[0].import.rate_hz)
}

/// Time stamps with two decimals at 125 Hz and duplicate rows give the model of the original log.
#[test]
fn rounded_stamps_and_repeated_rows_do_no_harm() {
    let (value, error, rate) = identified(|_| {}, None);
    let twice: fn(&mut Vec<Row>) = |rows| *rows = rows.iter().flat_map(|row| [*row, *row]).collect();
    for (name, change, decimals) in [("rounded", (|_| {}) as fn(&mut Vec<Row>), Some(2)), ("twice", twice, None)] {
        let (own, own_error, own_rate) = identified(change, decimals);
        assert!((own_rate / rate - 1.0).abs() < 1e-3, "{name}: {own_rate} for {rate} Hz");
        // Rounding moves the ends of the log by up to half a step, about 1e-4 of its length.
        assert!((own / value - 1.0).abs() < 0.01, "{name}: {own} for {value}");
        assert!(own_error < 1.05 * error, "{name}: {own_error} % for {error} %");
    }
}

/// A body with ten times its mass is reported as a warning, because the fit is not affected, and no torque unit is
/// proposed.
#[test]
fn one_wrong_mass_is_no_unit_of_torque() {
    let folder = tempfile::tempdir().unwrap();
    let urdf = std::fs::read_to_string(repository("robots/ur10.urdf")).unwrap();
    let mass = "3.87";
    assert_eq!(urdf.matches(&format!("<mass value=\"{mass}\"")).count(), 1, "the forearm's mass");
    let urdf = urdf.replace(&format!("<mass value=\"{mass}\""), "<mass value=\"38.7\"");
    std::fs::write(folder.path().join("arm.urdf"), urdf).unwrap();
    for name in ["train.csv", "test.csv"] {
        std::fs::copy(repository("examples/ur10_simulated").join(name), folder.path().join(name)).unwrap();
    }
    let study = std::fs::read_to_string(repository("examples/ur10_simulated.toml")).unwrap();
    let study = study.replace("../robots/ur10.urdf", "arm.urdf").replace("ur10_simulated/", "");
    let check = check_text(folder.path(), &study);
    assert!(problems(&check).is_empty(), "{:?}", problems(&check));
    let named = check.findings.iter().find(|finding| finding.kind == "description").expect("the body is named");
    assert!(named.level == Level::Warning && named.sentence().contains("forearm_link"), "{}", named.sentence());
    assert!(JOINTS.iter().all(|joint| !named.sentence().contains(joint)) && named.write.is_empty());
}

/// Time in hundredths of a second, the gain of one joint, and the gear ratio of a harmonic drive are found with their
/// numbers.
#[test]
fn numbers_between_usual_units_are_found() {
    all_are_named(&[
        Case {
            name: "hundredths of seconds",
            rows: |rows| each(rows, |row| row[0] *= 100.0),
            study: SAME,
            kind: "unit",
            named: &["scale = 0.0100"],
        },
        Case {
            name: "one torque ten times too large",
            rows: |rows| each(rows, |row| row[9] *= 10.0),
            study: SAME,
            kind: "unit",
            named: &["scale = [1.0, 1.0, 0.100", "scale = [1.0, 1.0, 0.09", "scale = [1.0, 1.0, 0.10"],
        },
        Case {
            name: "a gear of 137",
            rows: |rows| each(rows, |row| row[1..7].iter_mut().for_each(|q| *q *= 137.0)),
            study: SAME,
            kind: "unit",
            // 1/137 within 4 %.
            named: &[
                "scale = 0.0070",
                "scale = 0.0071",
                "scale = 0.0072",
                "scale = 0.0073",
                "scale = 0.0074",
                "scale = 0.0075",
            ],
        },
    ]);
}

/// Unordered rows are reported; repeated positions and torques are a warning.
#[test]
fn rows_out_of_order_and_rows_that_repeat_are_told() {
    let (header, rows) = read("train.csv");
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(repository("examples/ur10_simulated.toml")).unwrap();
    let text = text
        .replace("../robots/ur10.urdf", &repository("robots/ur10.urdf").display().to_string())
        .replace("ur10_simulated/", "");
    let path = folder.path().join("study.toml");
    std::fs::write(&path, text).unwrap();
    let write = |rows: &[Row]| {
        let lines = rows.iter().map(|row| row.map(|value| value.to_string()).join(","));
        let text = [header.clone()].into_iter().chain(lines).collect::<Vec<_>>().join("\n");
        std::fs::write(folder.path().join("train.csv"), text).unwrap();
    };
    std::fs::copy(repository("examples/ur10_simulated/test.csv"), folder.path().join("test.csv")).unwrap();
    let options = RunOptions { data: None, threads: 2, progress: &Silent };
    // Two of five steps go back in time.
    let shuffled: Vec<Row> = (0..rows.len()).map(|k| rows[k * 1009 % rows.len()]).collect();
    write(&shuffled);
    let study = Study::load(&path).unwrap();
    let refused = dynident::check(&study, &path, &options).unwrap_err().to_string();
    assert!(refused.contains("not in order of time"), "{refused}");

    let held: Vec<Row> = (0..rows.len())
        .map(|k| {
            let mut row = rows[k];
            row[1..7].copy_from_slice(&rows[k / 5 * 5][1..7]);
            row
        })
        .collect();
    write(&held);
    let check = dynident::check(&study, &path, &options).unwrap().check;
    let told = check.findings.iter().find(|finding| finding.evidence.contains("every 5th row"));
    assert!(told.is_some_and(|finding| finding.level == Level::Warning), "{:?}", check.findings);
}

/// An inconsistent body that the logs do not determine keeps its description; this is reported, but is not a mistake in
/// the logs.
#[test]
fn bodies_that_cannot_be_are_a_warning() {
    let urdf = std::fs::read_to_string(repository("robots/ur10.urdf")).unwrap();
    let no_inertia: String = urdf
        .split_inclusive('\n')
        .map(|line| if line.contains("<inertia ") { INERTIA_OF_NOTHING.to_owned() } else { line.to_owned() })
        .collect();
    assert_ne!(no_inertia, urdf);
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("robot.urdf"), no_inertia).unwrap();
    let text = std::fs::read_to_string(repository("examples/ur10_simulated.toml")).unwrap();
    let data = repository("examples").display().to_string();
    let text = text
        .replace("../robots/ur10.urdf", "robot.urdf")
        .replace("ur10_simulated/", &format!("{data}/ur10_simulated/"));
    let check = check_text(folder.path(), &text);
    assert!(problems(&check).is_empty(), "{:?}", problems(&check));
    assert!(check.findings.iter().any(|finding| finding.kind == "description"), "{:?}", check.findings);
}

const INERTIA_OF_NOTHING: &str = "<inertia ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\"/>\n";
