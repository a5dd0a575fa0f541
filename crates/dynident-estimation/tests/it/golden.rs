//! Estimators compared with statsmodels and NumPy (golden/statsmodels_estimators.py).

use dynident_estimation::{
    CovarianceMethod, Estimate, EstimateStatus, LinearProblem, OrdinarySettings, SegmentSettings, SegmentedFactor,
    WeightedSettings, ordinary_least_squares, weighted_least_squares,
};
use nalgebra::{DMatrix, DVector};
use serde_json::Value;

/// Double precision on rows with a condition number of 2.7e3 raw (2 scaled). The oracle's XᵀX loses at most its square
/// times 1.1e-16, i.e. 8e-10.
const RELATIVE: f64 = 1.0e-9;

fn golden() -> Value {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../golden/statsmodels_estimators.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

fn matrix(value: &Value) -> DMatrix<f64> {
    let rows: Vec<Vec<f64>> = value.as_array().unwrap().iter().map(numbers).collect();
    DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j])
}

fn problem(golden: &Value) -> LinearProblem {
    let first_length_rows = golden["segment_rows"].as_u64().unwrap() as usize;
    let settings = SegmentSettings { max_segments: 64, first_length_rows };
    let names = (0..5).map(|c| format!("theta{c}")).collect();
    let mut problem = LinearProblem::new(names, vec!["joint1".into(), "joint2".into()]);
    for (log, joints) in golden["logs"].as_array().unwrap().iter().enumerate() {
        for (joint, data) in joints.as_array().unwrap().iter().enumerate() {
            let columns: Vec<usize> = numbers(&golden["joint_columns"][joint]).iter().map(|&c| c as usize).collect();
            let mut panel: Vec<f64> = data["w_by_column"].as_array().unwrap().iter().flat_map(numbers).collect();
            let tau = numbers(&data["tau"]);
            panel.extend(&tau);
            let mut factor = SegmentedFactor::new(columns.len(), settings).unwrap();
            factor.absorb(&panel, tau.len()).unwrap();
            problem.add(&format!("log{log}"), joint, columns, factor).unwrap();
        }
    }
    problem
}

fn assert_close(what: &str, found: f64, expected: f64, scale: f64) {
    assert!((found - expected).abs() <= RELATIVE * scale, "{what}: found {found:e}, expected {expected:e}");
}

fn assert_vector(what: &str, found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert_close(&format!("{what}[{i}]"), *found, *expected, expected.abs());
    }
}

/// Every entry, relative to the standard deviations of its row and column.
fn assert_covariance(what: &str, found: &DMatrix<f64>, expected: &DMatrix<f64>) {
    for i in 0..expected.nrows() {
        for j in 0..expected.ncols() {
            let scale = (expected[(i, i)] * expected[(j, j)]).sqrt();
            assert_close(&format!("{what}[{i},{j}]"), found[(i, j)], expected[(i, j)], scale);
        }
    }
}

fn assert_conditions(estimate: &Estimate, expected: &Value) {
    let raw = expected["condition_raw"].as_f64().unwrap();
    let scaled = expected["condition_scaled"].as_f64().unwrap();
    assert_close("raw condition", estimate.condition_number_raw, raw, raw);
    assert_close("scaled condition", estimate.condition_number_scaled, scaled, scaled);
}

#[test]
fn ordinary_least_squares_agrees_with_statsmodels() {
    let golden = golden();
    let expected = &golden["ordinary"];
    let problem = problem(&golden);
    let settings = OrdinarySettings { covariance: CovarianceMethod::Segments, ..Default::default() };
    let estimate = ordinary_least_squares(&problem, &settings).unwrap();
    assert_eq!(estimate.status, EstimateStatus::Complete);
    assert_eq!(estimate.degrees_of_freedom, 2 * (310 + 215) - 5);
    assert_vector("values", &estimate.values, &numbers(&expected["values"]));
    let white: Vec<f64> = estimate.covariance_white.diagonal().iter().map(|v| v.sqrt()).collect();
    assert_vector("white std", &white, &numbers(&expected["std_scaled"]));
    assert_covariance("segments", &estimate.covariance, &matrix(&expected["covariance_segments"]));
    // 13 + 9 segments of each of two joints.
    assert_eq!(estimate.clusters, 44);
    assert_conditions(&estimate, expected);
    let settings = OrdinarySettings { covariance: CovarianceMethod::SegmentsAcrossJoints, ..Default::default() };
    let across = ordinary_least_squares(&problem, &settings).unwrap();
    assert_eq!(across.clusters, 22);
    assert_covariance("across", &across.covariance, &matrix(&expected["covariance_segments_across_joints"]));
    let rss = problem.combined(&[1.0, 1.0]).unwrap().residual_sum_of_squares(&estimate.values).unwrap();
    assert_vector("rss", &[rss], &[expected["rss"].as_f64().unwrap()]);
}

#[test]
fn weighted_least_squares_agrees_with_statsmodels() {
    let golden = golden();
    let expected = &golden["weighted"];
    let problem = problem(&golden);
    let settings =
        WeightedSettings { covariance: CovarianceMethod::Segments, tolerance: 1.0e-12, ..Default::default() };
    let estimate = weighted_least_squares(&problem, &settings).unwrap();
    assert_eq!(estimate.status, EstimateStatus::Complete);
    assert!(estimate.iterations < 20, "{} iterations", estimate.iterations);
    assert_vector("values", &estimate.values, &numbers(&expected["values"]));
    assert_vector("sigma", &estimate.joint_sigma, &numbers(&expected["joint_sigma"]));
    assert_covariance("white", &estimate.covariance_white, &matrix(&expected["covariance_unscaled"]));
    assert_covariance("segments", &estimate.covariance, &matrix(&expected["covariance_segments"]));
    assert_conditions(&estimate, expected);
    let settings = WeightedSettings { covariance: CovarianceMethod::SegmentsAcrossJoints, ..settings };
    let across = weighted_least_squares(&problem, &settings).unwrap();
    assert_covariance("across", &across.covariance, &matrix(&expected["covariance_segments_across_joints"]));
}

#[test]
fn a_prior_agrees_with_numpy() {
    let golden = golden();
    let expected = &golden["prior"];
    let information = DMatrix::from_diagonal(&DVector::from_vec(numbers(&expected["std"])).map(|std| 1.0 / std));
    let problem = problem(&golden).with_prior(numbers(&expected["mean"]), information).unwrap();
    let settings = WeightedSettings { tolerance: 1.0e-12, ..Default::default() };
    let estimate = weighted_least_squares(&problem, &settings).unwrap();
    assert_vector("values", &estimate.values, &numbers(&expected["values"]));
    assert_covariance("white", &estimate.covariance_white, &matrix(&expected["covariance_white"]));
    assert!(ordinary_least_squares(&problem, &OrdinarySettings::default()).is_err());
}
