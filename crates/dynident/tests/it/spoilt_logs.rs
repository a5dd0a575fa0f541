//! Outliers and held torque must not affect the model of a simulated UR10.
use crate::common::{Job, Motion, Random, Truth, header, plain, repository, write_log};
use dynident::IdentificationOutcome;
use dynident_testing::count;
use serde_json::Value;
use std::fmt::Write;
use std::path::{Path, PathBuf};

const RATE_HZ: f64 = 125.0;
const SECONDS: f64 = 20.0;
/// Torque noise of one sample, as in `examples/ur10_simulated`.
const SIGMA_NM: [f64; 6] = [1.2, 1.5, 0.8, 0.25, 0.25, 0.2];
const SIGMA_RAD: f64 = 1e-5;
/// Largest error ratio of the models of corrupt and clean logs.
const MAX_ERROR_RATIO: f64 = 1.15;
const JOINTS: usize = 6;
const NAMES: [&str; JOINTS] =
    ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"];

fn arm() -> PathBuf {
    repository("robots/ur10.urdf")
}

/// Rows of a log with noise; also writes `truth.csv`, another motion without noise.
fn rows(folder: &Path, seed: u64) -> Vec<Vec<f64>> {
    let (truth, mut random) = (Truth::near(&arm(), 0.1, true), Random(seed));
    let (file, tested) = (folder.join("clean.csv"), folder.join("truth.csv"));
    let lengths = (RATE_HZ, SECONDS);
    write_log(&file, &truth, &Motion::new(JOINTS, seed), lengths, &header(JOINTS), |q, tau| {
        let q: Vec<f64> = q.iter().map(|q| q + SIGMA_RAD * random.normal()).collect();
        let tau = tau.iter().zip(SIGMA_NM).map(|(torque, sigma)| torque + sigma * random.normal());
        q.into_iter().chain(tau).collect()
    });
    write_log(&tested, &truth, &Motion::new(JOINTS, seed + 1), lengths, &header(JOINTS), plain);
    let text = std::fs::read_to_string(file).unwrap();
    text.lines().skip(1).map(|line| line.split(',').map(|field| field.parse().unwrap()).collect()).collect()
}

fn fitted(folder: &Path, rows: &[Vec<f64>]) -> IdentificationOutcome {
    let mut text = header(JOINTS) + "\n";
    for row in rows {
        let fields: Vec<String> = row.iter().map(f64::to_string).collect();
        writeln!(text, "{}", fields.join(",")).unwrap();
    }
    std::fs::write(folder.join("log.csv"), text).unwrap();
    let study = format!(
        r#"
        robot.file = {:?}
        drive.drive_inertia = true
        drive.friction = "stated"
        [format]
        time = {{ column = "t" }}
        position = {{ columns = "q{{1..6}}" }}
        torque = {{ columns = "tau{{1..6}}" }}
        [[log]]
        file = "log.csv"
        [[log]]
        file = "truth.csv"
        role = "validate"
        "#,
        arm().display().to_string(),
    );
    Job::new(folder, &study).identify()
}

/// Torque error on the motion without noise, percent: of the estimate and of the written model.
fn model_errors(found: &IdentificationOutcome) -> [f64; 2] {
    let validation = &found.result.validation[0];
    let written = validation.physical.as_ref().unwrap();
    [&validation.model, written].map(|report| report.relative_error_percent.unwrap())
}

/// Corrupt samples: column, first row, number of rows.
type Spoilt = Vec<(usize, usize, usize)>;
type Spoiler = fn(&mut [Vec<f64>], &mut Random) -> Spoilt;

/// One sample in twenty with an error of twenty standard deviations, either sign.
fn outliers(rows: &mut [Vec<f64>], random: &mut Random) -> Spoilt {
    let mut spoilt = Vec::new();
    for (number, row) in rows.iter_mut().enumerate() {
        for (joint, sigma) in SIGMA_NM.iter().enumerate() {
            if random.next().abs() < 0.05 {
                row[1 + JOINTS + joint] += 20.0 * sigma * if random.next() > 0.0 { 1.0 } else { -1.0 };
                spoilt.push((joint, number, 1));
            }
        }
    }
    spoilt
}

/// Torque of all joints repeated for 0.2 s, twice.
fn held(rows: &mut [Vec<f64>], random: &mut Random) -> Spoilt {
    let length = (0.2 * RATE_HZ) as usize;
    let mut spoilt = Vec::new();
    for half in 0..2 {
        let from = rows.len() / 2 * half + ((0.25 + 0.2 * random.next()) * rows.len() as f64) as usize;
        let value = rows[from][1 + JOINTS..].to_vec();
        rows[from + 1..from + length].iter_mut().for_each(|row| row[1 + JOINTS..].copy_from_slice(&value));
        spoilt.extend((0..JOINTS).map(|joint| (joint, from + 1, length - 1)));
    }
    spoilt
}

fn set_aside<'a>(found: &'a Value, joint: &str, reason: &str) -> Option<&'a Value> {
    let all = found["set_aside"].as_array().unwrap().iter();
    all.into_iter().find(|aside| aside["joint"] == joint && aside["reason"] == reason && aside["channel"] == "torque")
}

#[test]
fn outliers_and_held_torque_do_not_reach_the_model() {
    let folder = tempfile::tempdir().unwrap();
    let spoilers: [(&str, Spoiler); 2] = [("outlier", outliers), ("held", held)];
    let experiments = count(2, 40);
    // Sums of squares for clean and corrupt logs; estimate and written model. With `keep_outliers` the roots are four
    // to nine times as large.
    let (mut clean_squares, mut squares) = ([0.0; 2], [[0.0; 2]; 2]);
    let add = |to: &mut [f64; 2], found: &IdentificationOutcome| {
        to.iter_mut().zip(model_errors(found)).for_each(|(sum, error)| *sum += error * error);
    };
    for seed in 0..experiments as u64 {
        let clean = rows(folder.path(), 10 * seed + 3);
        let reference = fitted(folder.path(), &clean);
        add(&mut clean_squares, &reference);
        let import = serde_json::to_value(&reference.result.logs[0].import).unwrap();
        assert_eq!(import["set_aside"], Value::Array(Vec::new()), "{seed}");
        for (which, (reason, spoil)) in spoilers.iter().enumerate() {
            let mut bad = clean.clone();
            let spoilt = spoil(&mut bad, &mut Random(100 + seed));
            let found = fitted(folder.path(), &bad);
            add(&mut squares[which], &found);
            let import = serde_json::to_value(&found.result.logs[0].import).unwrap();
            for (joint, name) in NAMES.iter().enumerate() {
                let own: Vec<_> = spoilt.iter().filter(|(of, ..)| *of == joint).collect();
                let samples: usize = own.iter().map(|(.., samples)| samples).sum();
                let told = set_aside(&import, name, reason).unwrap_or_else(|| panic!("{seed}, {reason}, {name}"));
                // Channel, number and time: at least three quarters of them, and no others.
                let of = |key: &str| told[key].as_f64().unwrap();
                let row = of("row") as usize;
                assert!((0.75 * samples as f64..=samples as f64).contains(&of("samples")), "{seed} {samples} {told}");
                assert!(own.iter().any(|(_, from, length)| (*from..from + length).contains(&row)), "{seed} {told}");
                assert!((of("time_s") - row as f64 / RATE_HZ).abs() < 1e-9, "{seed} {told}");
                let mut findings = import["findings"].as_array().unwrap().iter();
                let says = |finding: &Value| finding["message"].as_str().is_some_and(|text| text.contains("left out"));
                let named = |finding: &Value| finding["channel"] == format!("torque {name}") && says(finding);
                assert!(findings.any(named), "{seed}, {reason}, {name}");
            }
        }
    }
    let root = |square: f64| (square / experiments as f64).sqrt();
    for ((reason, _), spoilt) in spoilers.iter().zip(squares) {
        for (spoilt, clean) in spoilt.map(root).into_iter().zip(clean_squares.map(root)) {
            println!("{reason}: {spoilt:.3} % instead of {clean:.3} %");
            assert!(spoilt <= MAX_ERROR_RATIO * clean, "{reason}: {spoilt} % instead of {clean} %");
        }
    }
}

/// A channel that saturates at 80 % of the shoulder's torque: saturated samples are removed and reported, and the model
/// uses the rest.
#[test]
fn saturated_torque_does_not_reach_the_model() {
    const LIFT: usize = 1;
    let folder = tempfile::tempdir().unwrap();
    let clean = rows(folder.path(), 21);
    let reference = fitted(folder.path(), &clean);
    let column = 1 + JOINTS + LIFT;
    let limit = 0.8 * clean.iter().map(|row| row[column].abs()).fold(0.0, f64::max);
    let cut = clean.iter().filter(|row| row[column].abs() > limit).count();
    let mut bad = clean.clone();
    for row in &mut bad {
        row[column] = row[column].clamp(-limit, limit);
    }
    let found = fitted(folder.path(), &bad);
    let import = serde_json::to_value(&found.result.logs[0].import).unwrap();
    let told = set_aside(&import, NAMES[LIFT], "saturated").unwrap();
    let samples = told["samples"].as_f64().unwrap();
    // Near the limit, noise makes runs shorter than ten samples, which remain.
    assert!((0.75 * cut as f64..=cut as f64).contains(&samples), "{cut} {told}");
    let findings = import["findings"].as_array().unwrap();
    let names = |finding: &&Value| finding["channel"] == format!("torque {}", NAMES[LIFT]);
    let own: Vec<&Value> = findings.iter().filter(names).collect();
    assert!(own.len() == 1 && own[0]["level"] == "warning", "{own:?}");
    for (found, reference) in model_errors(&found).into_iter().zip(model_errors(&reference)) {
        // A tenth to a third of a joint's rows is saturated.
        assert!(found < 1.5 * reference, "{found} for {reference}, {cut} samples cut off");
    }
}
