//! Newey-West covariance compared with statsmodels; essential parameters compared with a fit of fewer columns.

use dynident_estimation::{
    CovarianceMethod, EssentialEnd, EssentialSettings, Estimate, LinearProblem, OrdinarySettings, SegmentSettings,
    SegmentedFactor, essential, ordinary_least_squares, strongest_correlations,
};
use dynident_model::sample::Random;
use serde_json::Value;

fn fit(columns: &[Vec<f64>], tau: &[f64], segments: SegmentSettings, covariance: CovarianceMethod) -> Estimate {
    let mut panel = columns.concat();
    panel.extend(tau);
    let mut factor = SegmentedFactor::new(columns.len(), segments).unwrap();
    factor.absorb(&panel, tau.len()).unwrap();
    let names = (0..columns.len()).map(|c| format!("theta{c}")).collect();
    let mut problem = LinearProblem::new(names, vec!["joint1".into()]);
    problem.add("log", 0, (0..columns.len()).collect(), factor).unwrap();
    ordinary_least_squares(&problem, &OrdinarySettings { covariance, ..OrdinarySettings::default() }).unwrap()
}

/// With segments of one row it is the textbook form. Double precision, condition number below 100: its square times
/// rounding is 1e-12.
#[test]
fn newey_west_agrees_with_statsmodels() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../golden/statsmodels_newey_west.json");
    let golden: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let numbers =
        |value: &Value| -> Vec<f64> { value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect() };
    let columns: Vec<Vec<f64>> = golden["w_by_column"].as_array().unwrap().iter().map(numbers).collect();
    let segments = SegmentSettings { max_segments: 1000, first_length_rows: 1 };
    let estimate = fit(&columns, &numbers(&golden["tau"]), segments, CovarianceMethod::NeweyWest);
    for (i, row) in golden["covariance"].as_array().unwrap().iter().enumerate() {
        for (j, expected) in numbers(row).into_iter().enumerate() {
            let scale = estimate.std[i] * estimate.std[j];
            let found = estimate.covariance[(i, j)];
            assert!((found - expected).abs() < 1e-10 * scale, "({i}, {j}): {found:e}, expected {expected:e}");
        }
    }
}

fn columns(random: &mut Random, rows: usize, count: usize) -> Vec<Vec<f64>> {
    (0..count).map(|_| (0..rows).map(|_| random.normal()).collect()).collect()
}

/// Two of four parameters are zero and are dropped; the result equals ordinary least squares on the other two.
#[test]
fn insignificant_parameters_are_dropped() {
    let mut random = Random::new(3);
    let w = columns(&mut random, 400, 4);
    let tau: Vec<f64> = (0..400).map(|k| 2.0 * w[0][k] - 3.0 * w[2][k] + 0.1 * random.normal()).collect();
    let full = fit(&w, &tau, SegmentSettings::default(), CovarianceMethod::White);
    let (reduced, report) = essential(&full, &EssentialSettings { ratio: 10.0, significance: 0.01 }).unwrap();
    let mut names: Vec<&str> = report.dropped.iter().map(|dropped| &*dropped.name).collect();
    names.sort_unstable();
    assert_eq!(names, ["theta1", "theta3"], "{report:?}");
    assert_eq!((report.kept, report.end), (2, EssentialEnd::RatioReached));
    let two = fit(&[w[0].clone(), w[2].clone()], &tau, SegmentSettings::default(), CovarianceMethod::White);
    for (column, expected) in [(0, two.values[0]), (2, two.values[1])] {
        // Both solve the same equations with a condition number near one.
        assert!((reduced.values[column] - expected).abs() < 1e-12);
    }
    assert_eq!((reduced.values[1], reduced.std[3]), (0.0, 0.0));
    // F of two fits: ((RSS₂ − RSS₄)/2) / (RSS₄/(N − 4)).
    let square = |estimate: &Estimate| estimate.joint_sigma[0].powi(2) * estimate.degrees_of_freedom as f64;
    let f = (square(&two) - square(&full)) / 2.0 / (square(&full) / 396.0);
    // Small difference of two sums of squares: 1e-16 over its share of 1e-3, with margin.
    assert!((report.dropped[1].f - f).abs() < 1e-9 * f.max(1.0), "{} {f}", report.dropped[1].f);
}

/// A poorly determined parameter that is significantly different from zero is kept by the F-test.
#[test]
fn parameters_needed_by_the_residual_stay() {
    let mut random = Random::new(4);
    let w = columns(&mut random, 400, 2);
    let tau: Vec<f64> = (0..400).map(|k| 50.0 * w[0][k] + 0.05 * w[1][k] + 0.1 * random.normal()).collect();
    let full = fit(&w, &tau, SegmentSettings::default(), CovarianceMethod::White);
    let (reduced, report) = essential(&full, &EssentialSettings::default()).unwrap();
    assert_eq!((report.kept, report.end), (2, EssentialEnd::ResidualGrows));
    assert_eq!((reduced.values, report.refused.unwrap().name), (full.values, "theta1".to_owned()));
    assert!(essential(&reduced_nothing(), &EssentialSettings { ratio: 0.5, significance: 0.05 }).is_err());
}

fn reduced_nothing() -> Estimate {
    let mut random = Random::new(5);
    let w = columns(&mut random, 50, 1);
    fit(&w, &w[0].clone(), SegmentSettings::default(), CovarianceMethod::White)
}

/// Columns a and a + small b have estimates with a correlation near −1.
#[test]
fn similar_columns_are_the_strongest_pair() {
    let mut random = Random::new(6);
    let mut w = columns(&mut random, 300, 3);
    w[2] = w[0].iter().zip(&w[2]).map(|(a, b)| a + 0.1 * b).collect();
    let tau: Vec<f64> = (0..300).map(|k| w[0][k] + w[1][k] + 0.1 * random.normal()).collect();
    let estimate = fit(&w, &tau, SegmentSettings::default(), CovarianceMethod::White);
    let pairs = strongest_correlations(&estimate, 1);
    assert_eq!(pairs[0].parameters, ["theta0".to_owned(), "theta2".to_owned()]);
    assert!(pairs[0].correlation < -0.98, "{pairs:?}");
}
