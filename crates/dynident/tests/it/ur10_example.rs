//! The stored example log equals the output of its generator, and respects the limits of a UR10.

#[path = "../../examples/simulate_ur10.rs"]
#[allow(
    dead_code,
    unreachable_pub,
    reason = "the example's main is not called, and its files are public for this test"
)]
mod simulate_ur10;

use dynident::{RunOptions, Silent, Study, identify};
use dynident_dynamics::{BaseParameterSettings, BaseParameters};
use dynident_model::read_urdf;
use dynident_model::terms::{CoulombShape, DriveChoice, terms_per_joint};
use serde_json::Value;
use std::path::{Path, PathBuf};

const RATE_HZ: f64 = 125.0;

fn committed(name: &str) -> String {
    let folder: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/ur10_simulated");
    std::fs::read_to_string(folder.join(name)).unwrap()
}

fn rows(csv: &str) -> Vec<Vec<f64>> {
    csv.lines().skip(1).map(|line| line.split(',').map(|field| field.parse().unwrap()).collect()).collect()
}

#[test]
fn the_generator_makes_the_committed_logs() {
    let files = simulate_ur10::files().unwrap();
    for (name, made) in files.iter().filter(|(name, _)| *name != "truth.json") {
        let committed = committed(name);
        assert_eq!(made.lines().next(), committed.lines().next(), "{name}");
        let (made, committed) = (rows(made), rows(&committed));
        assert_eq!(made.len(), committed.len(), "{name}");
        for (row, (a, b)) in made.iter().zip(&committed).enumerate() {
            assert_eq!(a.len(), b.len(), "{name}, row {row}");
            for (column, (a, b)) in a.iter().zip(b).enumerate() {
                // Sine, logarithm and fused multiply-add differ in the last bit between computers, which may change the
                // last of seven digits or the encoder step of 4.8e-5 rad.
                let tolerance = 1e-6 * b.abs() + if (1..=6).contains(&column) { 4.9e-5 } else { 1e-9 };
                assert!((a - b).abs() <= tolerance, "{name}, row {row}, column {column}: {a} and {b}");
            }
        }
    }
}

#[test]
fn the_truth_beside_the_logs_is_the_generators() {
    let files = simulate_ur10::files().unwrap();
    let made: Value = serde_json::from_str(&files.iter().find(|(name, _)| *name == "truth.json").unwrap().1).unwrap();
    let committed: Value = serde_json::from_str(&committed("truth.json")).unwrap();
    assert_eq!(made["joints"], committed["joints"]);
    let parameters = |truth: &Value| truth["parameters"].as_array().unwrap().clone();
    let (made, committed) = (parameters(&made), parameters(&committed));
    assert_eq!(made.len(), 6 * (10 + 4));
    assert_eq!(made.len(), committed.len());
    for (a, b) in made.iter().zip(&committed) {
        assert_eq!((&a["symbol"], &a["unit"]), (&b["symbol"], &b["unit"]));
        let (a, b) = (a["value"].as_f64().unwrap(), b["value"].as_f64().unwrap());
        // A few roundings of values up to some tens.
        assert!((a - b).abs() <= 1e-12 * (1.0 + b.abs()), "{a} and {b}");
    }
}

#[test]
fn the_motions_keep_the_robots_limits_and_start_and_end_at_rest() {
    let model = read_urdf(include_str!("../../../../robots/ur10.urdf")).unwrap().model;
    let logs = ["train.csv", "test.csv"].map(|name| rows(&committed(name)));
    assert_ne!(logs[0], logs[1], "validation needs another motion");
    for rows in &logs {
        assert_eq!(rows.len(), 2501);
        for (joint, limits) in model.joints().iter().map(|joint| joint.limits).enumerate() {
            let (q, tau) = (1 + joint, 7 + joint);
            // Over ten samples, encoder steps and noise (1e-4 rad) give a velocity error of 1e-3 rad/s.
            let speed = |from: usize| (rows[from + 10][q] - rows[from][q]).abs() * RATE_HZ / 10.0;
            for from in 0..rows.len() - 10 {
                assert!(speed(from) < limits.velocity.unwrap());
            }
            for row in rows {
                assert!(row[q] > limits.lower.unwrap() && row[q] < limits.upper.unwrap());
                assert!(row[tau].abs() < limits.effort.unwrap(), "joint {joint}: {}", row[tau]);
            }
            // The fade is of third order: 80 ms after the start it has reached 1e-3 of the motion.
            assert!(speed(0) < 0.05 && speed(rows.len() - 11) < 0.05);
            let moved = rows.iter().fold(0.0_f64, |most, row| most.max((row[q] - rows[0][q]).abs()));
            assert!(moved > 0.5, "joint {joint} moves by {moved} rad only");
        }
    }
}

#[test]
fn identification_finds_the_truth_within_its_error_bars() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let path = root.join("study.toml");
    let study = r#"
        data = "examples/ur10_simulated"
        [robot]
        file = "robots/ur10.urdf"
        [drive]
        drive_inertia = true
        coulomb_width = 0.01
        [motion]
        differentiator = { method = "butterworth", cutoff_hz = 10.0 }
        [parallel_filter]
        factor = 5
        [format]
        time = { column = "t_s" }
        position = { columns = "q{1..6}_rad" }
        torque = { columns = "tau{1..6}_Nm" }
        [[log]]
        file = "train.csv"
        [[log]]
        file = "test.csv"
        role = "validate"
    "#;
    let study = Study::parse(study, &path).unwrap();
    let result = identify(&study, &path, &RunOptions { data: None, threads: 1, progress: &Silent }).unwrap().result;

    let model = read_urdf(include_str!("../../../../robots/ur10.urdf")).unwrap().model;
    let terms = terms_per_joint(&model, |_| DriveChoice {
        drive_inertia: true,
        viscous: true,
        coulomb: Some(CoulombShape::Smooth { width: 0.01 }),
        offset: true,
    });
    let base = BaseParameters::new(&model, &terms, &BaseParameterSettings::default());
    let truth: Value = serde_json::from_str(&committed("truth.json")).unwrap();
    let truth: Vec<f64> =
        truth["parameters"].as_array().unwrap().iter().map(|parameter| parameter["value"].as_f64().unwrap()).collect();
    let truth = base.values(&truth);
    let expressions: Vec<&String> = result.base_parameters.iter().map(|parameter| &parameter.expression).collect();
    assert_eq!(expressions, base.expressions().iter().collect::<Vec<_>>());
    for (parameter, truth) in result.base_parameters.iter().zip(&truth) {
        // 64 segments for 58 parameters give a standard deviation within a factor of about 1.5; in addition 3.3 true
        // standard deviations.
        let error = (parameter.value - truth).abs() / parameter.std;
        assert!(
            error < 5.0,
            "{}: {} for {truth}, {error:.1} standard deviations",
            parameter.expression,
            parameter.value
        );
    }
    let held_out = &result.validation[0];
    let error_percent = held_out.model.relative_error_percent.unwrap();
    // Filtered torque noise is about 2 % of the torque; parameter errors are well below it.
    assert!(error_percent < 3.0, "{error_percent} %");
    // Inertials are off by 10 %, without friction.
    let prior_percent = held_out.prior.as_ref().unwrap().relative_error_percent.unwrap();
    assert!(prior_percent > 10.0, "{prior_percent} %");
}
