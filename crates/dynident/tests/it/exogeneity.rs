//! Noise in the regressor: detected automatically, corrected if possible, otherwise a problem.
use crate::common::{Job, Motion, Random, Truth, format, header, plain, repository, write_log};
use dynident::IdentificationOutcome;
use dynident::identification::estimators::NoiseVerdict;
use std::path::Path;

fn arm() -> std::path::PathBuf {
    repository("robots/planar2r.urdf")
}

/// A slow motion of a two-link arm at 250 Hz; `noise` of the positions, rad.
fn write(folder: &Path, name: &str, truth: &Truth, seed: u64, noise: f64) {
    let mut random = Random(seed);
    write_log(&folder.join(name), truth, &Motion::new(2, seed), (250.0, 30.0), &header(2), |q, tau| {
        let q: Vec<f64> = q.iter().map(|q| q + noise * random.normal()).collect();
        q.into_iter().chain(tau.iter().map(|t| t + 0.02 * random.normal())).collect()
    });
}

fn study(further: &str) -> String {
    format!(
        r#"
        robot.file = {:?}
        log = [{{ file = "log.csv" }}, {{ file = "test.csv", role = "validate" }}]
        {further}
        [format]
        time = {{ column = "t" }}
        position = {{ columns = "q{{1..2}}" }}
        torque = {{ columns = "tau{{1..2}}" }}
        "#,
        arm().display().to_string(),
    )
}

/// Root mean square error of all base parameters, in error bars.
fn score(found: &IdentificationOutcome, truth: &[f64], bars: &[f64]) -> f64 {
    let squares = (0..truth.len()).map(|i| ((found.estimate.values[i] - truth[i]) / bars[i]).powi(2));
    (squares.sum::<f64>() / truth.len() as f64).sqrt()
}

fn verdict(found: &IdentificationOutcome) -> NoiseVerdict {
    found.result.noise_in_regressor.as_ref().unwrap().verdict
}

const HIGH: &str = "motion.differentiator = { method = \"butterworth\", cutoff_hz = 15.0 }\n";

#[test]
fn noise_of_the_positions_is_found_and_undone_without_asking() {
    let (folder, truth) = (tempfile::tempdir().unwrap(), Truth::near(&arm(), 0.1, false));
    write(folder.path(), "log.csv", &truth, 3, 1e-3);
    write(folder.path(), "test.csv", &truth, 4, 1e-3);
    // The highest frequency of the motion is 0.65 Hz. White noise of 1 mrad below 15 Hz is about 5 rad/s² of
    // acceleration, several times that of the motion.
    let job = Job::new(folder.path(), &study(HIGH));
    let found = job.identify();
    let values = truth.base_values(&job.robot());
    assert_eq!(
        (&found.result.method.estimator[..], verdict(&found)),
        ("instrumental", NoiseVerdict::BiasesLeastSquares)
    );
    let noise = found.result.noise_in_regressor.as_ref().unwrap();
    assert!(noise.instruments_taken && !noise.instruments.weak, "{noise:?}");
    assert!(noise.fast_motion.unwrap().followed < 0.5, "{noise:?}");
    // Instruments must pass the highest frequency of the motion, 0.65 Hz.
    let [cutoff_hz, _] = noise.instrument_cutoff_hz.unwrap();
    assert!((0.65..=7.5).contains(&cutoff_hz), "{cutoff_hz}");
    assert!(found.result.problems.is_empty(), "{:?}", found.result.problems);
    let weighted = Job::new(folder.path(), &study(&(HIGH.to_owned() + "estimator.method = \"weighted\"\n"))).identify();
    let bars = &found.estimate.std;
    let (by_instruments, by_least_squares) = (score(&found, &values, bars), score(&weighted, &values, bars));
    // A dozen squares with mean one: their root mean square is below 1.7 by four standard deviations; friction near its
    // steps needs slightly more.
    assert!(by_instruments < 2.0, "{by_instruments}");
    assert!(by_least_squares > 2.0 * by_instruments, "{by_least_squares} and {by_instruments}");
    // A study with least squares gets a report of its bias.
    assert_eq!(verdict(&weighted), NoiseVerdict::BiasesLeastSquares);
    let problems = &weighted.result.problems;
    assert!(
        problems.iter().any(|problem| problem.contains("noise in the regressor biases least squares")),
        "{problems:?}"
    );
}

#[test]
fn a_clean_log_is_weighted_least_squares_and_nothing_is_said() {
    let (folder, truth) = (tempfile::tempdir().unwrap(), Truth::near(&arm(), 0.1, false));
    write(folder.path(), "log.csv", &truth, 3, 1e-6);
    write(folder.path(), "test.csv", &truth, 4, 1e-6);
    for further in ["", HIGH] {
        let found = Job::new(folder.path(), &study(further)).identify();
        assert_eq!((&found.result.method.estimator[..], verdict(&found)), ("weighted", NoiseVerdict::Harmless));
        assert!(found.result.problems.is_empty(), "{:?}", found.result.problems);
        let weighted =
            Job::new(folder.path(), &study(&format!("{further}estimator.method = \"weighted\"\n"))).identify();
        assert_eq!(found.estimate.values, weighted.estimate.values);
    }
}

#[test]
fn instruments_left_to_the_data_hold_the_motion() {
    let folder = tempfile::tempdir().unwrap();
    let ur10 = repository("robots/ur10.urdf");
    let truth = Truth::near(&ur10, 0.2, false);
    for (name, seed) in [("log.csv", 1), ("test.csv", 2)] {
        let mut random = Random(seed);
        write_log(&folder.path().join(name), &truth, &Motion::new(6, seed), (125.0, 20.0), &header(6), |q, tau| {
            let q: Vec<f64> = q.iter().map(|q| q + 1e-5 * random.normal()).collect();
            q.into_iter().chain(tau.iter().map(|t| t + 0.1 * random.normal())).collect()
        });
    }
    let text = |further: &str| {
        let text = study(further).replace("{1..2}", "{1..6}");
        text.replace(&arm().display().to_string(), &ur10.display().to_string())
    };
    let held_out = |found: &IdentificationOutcome| found.result.validation[0].model.relative_error_percent.unwrap();
    let weighted = Job::new(folder.path(), &text("estimator.method = \"weighted\"\n")).identify();
    let found = Job::new(folder.path(), &text("estimator.method = \"instrumental\"\n")).identify();
    // A log with little noise: instruments only lose a little precision.
    assert!(held_out(&found) < 1.2 * held_out(&weighted), "{} and {}", held_out(&found), held_out(&weighted));
    assert!(!found.result.noise_in_regressor.as_ref().unwrap().instruments.weak);
    // A cut-off below the motion's band gives weak instruments, which is a problem.
    let below = "estimator = { method = \"instrumental\", instruments = { cutoff_hz = 0.06 } }\n";
    let below = Job::new(folder.path(), &text(below)).identify();
    let problems = &below.result.problems;
    assert!(problems.iter().any(|problem| problem.contains("weak instruments")), "{problems:?}");
}

#[test]
fn logs_that_cannot_be_examined_are_fitted_all_the_same() {
    // Too short for a lower filter, and without noise.
    let (folder, truth) = (tempfile::tempdir().unwrap(), Truth::near(&arm(), 0.1, false));
    write_log(&folder.path().join("log.csv"), &truth, &Motion::new(2, 3), (50.0, 4.0), &header(2), plain);
    let text = format!(
        "robot.file = {:?}\nlog = [{{ file = \"log.csv\" }}]\nparallel_filter.enabled = false\n{}",
        arm().display().to_string(),
        format(2)
    );
    let found = Job::new(folder.path(), &text).identify();
    assert_eq!(found.result.method.estimator, "weighted");
}
