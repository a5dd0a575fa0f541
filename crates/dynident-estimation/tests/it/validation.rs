//! Validation results compared with hand computation.

use dynident_estimation::{EstimationError, Validation};
use proptest::prelude::*;

#[test]
fn figures_of_a_small_example() {
    // Joint a: τ = 1, 2, 3, 6, errors 1, 0, −1, 2. Joint b: τ = −2, 0, 2, 0, errors 0, 1, 0, 0.
    let measured = [[1.0, -2.0], [2.0, 0.0], [3.0, 2.0], [6.0, 0.0]];
    let predicted = [[0.0, -2.0], [2.0, -1.0], [4.0, 2.0], [4.0, 0.0]];
    let mut validation = Validation::new(vec!["a".into(), "b".into()]);
    for (m, p) in measured.iter().zip(&predicted) {
        validation.add(m, p).unwrap();
    }
    let report = validation.report();
    let close = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    let a = &report.joints[0];
    assert_eq!((a.name.as_str(), a.samples), ("a", 4));
    close(a.rmse_nm, (6.0_f64 / 4.0).sqrt());
    close(a.relative_error_percent.unwrap(), 100.0 * (6.0_f64 / 50.0).sqrt());
    close(a.max_error_nm, 2.0);
    // Mean 3, spread 4 + 1 + 0 + 9 = 14.
    close(a.r_squared.unwrap(), 1.0 - 6.0 / 14.0);
    let b = &report.joints[1];
    close(b.rmse_nm, 0.5);
    close(b.relative_error_percent.unwrap(), 100.0 * (1.0_f64 / 8.0).sqrt());
    close(b.r_squared.unwrap(), 1.0 - 1.0 / 8.0);
    // Stacked: error² 7, τ² 58, mean 12/8, spread 58 − 8·1.5² = 40.
    assert_eq!(report.samples, 4);
    close(report.rmse_nm, (7.0_f64 / 8.0).sqrt());
    close(report.relative_error_percent.unwrap(), 100.0 * (7.0_f64 / 58.0).sqrt());
    close(report.max_error_nm, 2.0);
    close(report.r_squared.unwrap(), 1.0 - 7.0 / 40.0);
    let json = serde_json::to_value(&report).unwrap();
    assert_eq!(json["joints"][1]["rmse_nm"], 0.5);
}

#[test]
fn empty_and_zero_signals_give_no_ratios() {
    let mut validation = Validation::new(vec!["a".into()]);
    let report = validation.report();
    assert_eq!((report.samples, report.rmse_nm, report.relative_error_percent, report.r_squared), (0, 0.0, None, None));
    validation.add_joint(0, &[0.0, 0.0], &[0.5, 0.5]).unwrap();
    let report = validation.report();
    assert_eq!((report.rmse_nm, report.relative_error_percent, report.r_squared), (0.5, None, None));
}

#[test]
fn bad_samples_are_refused_whole() {
    let mut validation = Validation::new(vec!["a".into(), "b".into()]);
    assert!(matches!(validation.add(&[1.0], &[1.0, 2.0]), Err(EstimationError::Mismatch { .. })));
    assert!(matches!(validation.add(&[1.0, 2.0], &[1.0, f64::NAN]), Err(EstimationError::Unusable { column: 1, .. })));
    assert!(validation.add_joint(2, &[1.0], &[1.0]).is_err());
    assert!(validation.add_joint(0, &[1.0, 2.0], &[1.0]).is_err());
    assert!(matches!(
        validation.add_joint(0, &[1.0, f64::INFINITY], &[1.0, 1.0]),
        Err(EstimationError::Unusable { row: 1, .. })
    ));
    assert_eq!(validation.report().samples, 0);
}

proptest! {
    #[test]
    fn streaming_equals_two_passes(values in prop::collection::vec((-50.0..50.0_f64, -50.0..50.0_f64), 2..60), offset in -1.0e4..1.0e4_f64) {
        let (measured, predicted): (Vec<f64>, Vec<f64>) = values.iter().map(|(m, p)| (m + offset, p + offset)).unzip();
        let mut validation = Validation::new(vec!["a".into()]);
        validation.add_joint(0, &measured, &predicted).unwrap();
        let n = measured.len() as f64;
        let mean = measured.iter().sum::<f64>() / n;
        let spread: f64 = measured.iter().map(|m| (m - mean).powi(2)).sum();
        let square: f64 = measured.iter().zip(&predicted).map(|(m, p)| (m - p).powi(2)).sum();
        let joint = &validation.report().joints[0];
        prop_assert!((joint.rmse_nm - (square / n).sqrt()).abs() < 1e-9);
        // For torque that is not nearly constant the spread is accurate to 1e-9 despite an offset 200 times as large.
        if spread > 1.0 {
            prop_assert!((joint.r_squared.unwrap() - (1.0 - square / spread)).abs() < 1e-6 * (1.0 + square / spread));
        }
    }
}
