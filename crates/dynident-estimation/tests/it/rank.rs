//! Unexcited columns are reported, fixed, and never NaN.

use crate::common::Random;
use dynident_estimation::{
    CovarianceMethod, Estimate, EstimateStatus, EstimationError, LinearProblem, OrdinarySettings, RankSettings,
    SegmentSettings, SegmentedFactor, WeightedSettings, correlation, ordinary_least_squares, weighted_least_squares,
};
use nalgebra::{DMatrix, DVector};

const WHITE: OrdinarySettings = OrdinarySettings {
    rank: RankSettings { tolerance: 1.0e-8, negligible_column: 1.0e-12 },
    covariance: CovarianceMethod::White,
};

fn names(count: usize) -> Vec<String> {
    (0..count).map(|c| format!("p{c}")).collect()
}

fn one_joint(w: &DMatrix<f64>, tau: &DVector<f64>) -> LinearProblem {
    let mut factor = SegmentedFactor::new(w.ncols(), SegmentSettings::default()).unwrap();
    let mut panel = w.as_slice().to_vec();
    panel.extend(tau.iter());
    factor.absorb(&panel, w.nrows()).unwrap();
    let mut problem = LinearProblem::new(names(w.ncols()), vec!["joint1".into()]);
    problem.add("log", 0, (0..w.ncols()).collect(), factor).unwrap();
    problem
}

/// Six columns: 2 is zero, 3 = 2·p0 − p1, 5 is rounding noise.
fn deficient() -> (DMatrix<f64>, DVector<f64>) {
    let mut random = Random::new(3);
    let mut w = DMatrix::from_fn(200, 6, |_, _| random.normal());
    w.column_mut(2).fill(0.0);
    let combination = w.column(0) * 2.0 - w.column(1);
    w.set_column(3, &combination);
    w.column_mut(5).scale_mut(1.0e-16);
    let tau = w.column(0) * 3.0 + w.column(3) + w.column(4) * 0.5 + DVector::from_fn(200, |_, _| 0.1 * random.normal());
    (w, tau)
}

fn assert_finite(estimate: &Estimate) {
    assert!(estimate.values.iter().chain(&estimate.std).chain(&estimate.joint_sigma).all(|x| x.is_finite()));
    assert!(estimate.covariance.iter().chain(estimate.covariance_white.iter()).all(|x| x.is_finite()));
    assert!(estimate.score_inflation.iter().chain(&estimate.effective_lag1).all(|x| x.is_finite()));
    assert!(estimate.condition_number_raw.is_finite() && estimate.condition_number_scaled.is_finite());
}

#[test]
fn unexcited_columns_are_named_and_fixed() {
    let (w, tau) = deficient();
    let problem = one_joint(&w, &tau);
    let estimate = ordinary_least_squares(&problem, &WHITE).unwrap();
    assert_finite(&estimate);
    assert_eq!(estimate.status, EstimateStatus::NotAllExcited);
    assert_eq!((estimate.rank.rank, estimate.rank.columns, estimate.rank.numerical_rank), (3, 6, 3));
    let fixed: Vec<(&str, f64)> = estimate.rank.fixed.iter().map(|f| (f.name.as_str(), f.value)).collect();
    assert_eq!(fixed, [("p2", 0.0), ("p3", 0.0), ("p5", 0.0)]);
    for column in [2, 3, 5] {
        assert_eq!((estimate.values[column], estimate.std[column]), (0.0, 0.0));
        assert_eq!(estimate.relative_std_percent[column], None);
    }
    // p0 and p1 include the effect of p3: 3 + 2 and −1. Noise 0.1 over 200 rows: standard error 0.007; tolerance 5 σ.
    for (column, expected) in [(0, 5.0), (1, -1.0), (4, 0.5)] {
        assert!((estimate.values[column] - expected).abs() < 0.035);
    }
    // Equal to a fit without the other columns up to rounding.
    let alone = ordinary_least_squares(&one_joint(&w.select_columns(&[0, 1, 4]), &tau), &WHITE).unwrap();
    for (k, column) in [0, 1, 4].into_iter().enumerate() {
        assert!((alone.values[k] - estimate.values[column]).abs() < 1e-12);
        assert!((alone.std[k] - estimate.std[column]).abs() < 1e-12);
    }
    assert_eq!(alone.degrees_of_freedom, estimate.degrees_of_freedom);
}

#[test]
fn unexcited_columns_take_their_fallback_and_others_adapt() {
    let (w, tau) = deficient();
    let problem = one_joint(&w, &tau).with_fallback(vec![9.0, 9.0, 7.0, 1.0, 9.0, 4.0]).unwrap();
    for estimate in [
        ordinary_least_squares(&problem, &WHITE).unwrap(),
        weighted_least_squares(&problem, &WeightedSettings::default()).unwrap(),
    ] {
        assert_finite(&estimate);
        assert_eq!((estimate.values[2], estimate.values[3], estimate.values[5]), (7.0, 1.0, 4.0));
        // With p3 at its true value, p0 and p1 are the truth.
        for (column, expected) in [(0, 3.0), (1, 0.0), (4, 0.5)] {
            assert!((estimate.values[column] - expected).abs() < 0.035);
        }
    }
}

#[test]
fn noise_free_torque_is_solved_exactly_and_the_iteration_ends() {
    let mut random = Random::new(4);
    let w = DMatrix::from_fn(500, 4, |_, c| random.normal() * 10_f64.powi(c as i32 * 2));
    let theta = [1.0, -2.0, 0.3, 1.0e-3];
    let tau = &w * DVector::from_column_slice(&theta);
    let estimate = weighted_least_squares(&one_joint(&w, &tau), &WeightedSettings::default()).unwrap();
    assert_finite(&estimate);
    assert_eq!(estimate.status, EstimateStatus::Complete);
    for (found, expected) in estimate.values.iter().zip(theta) {
        // Condition number near one: rounding of the largest column (1e3) against 1.
        assert!((found - expected).abs() < 1e-12 * expected.abs().max(1.0), "{found} {expected}");
    }
}

#[test]
fn zero_torques_and_empty_columns_stay_finite() {
    // All torques zero; then also all columns zero.
    let mut random = Random::new(5);
    let w = DMatrix::from_fn(60, 2, |_, _| random.normal());
    for w in [w, DMatrix::zeros(60, 2)] {
        let problem = one_joint(&w, &DVector::zeros(60));
        for estimate in [
            ordinary_least_squares(&problem, &OrdinarySettings::default()).unwrap(),
            weighted_least_squares(&problem, &WeightedSettings::default()).unwrap(),
        ] {
            assert_finite(&estimate);
            assert_eq!(estimate.values, [0.0, 0.0]);
        }
    }
}

#[test]
fn a_prior_excites_what_the_data_do_not() {
    let (w, tau) = deficient();
    let problem = one_joint(&w, &tau).with_prior(vec![1.0; 6], DMatrix::identity(6, 6)).unwrap();
    let estimate = weighted_least_squares(&problem, &WeightedSettings::default()).unwrap();
    assert_finite(&estimate);
    assert_eq!(estimate.status, EstimateStatus::Complete);
    // No data for p2: mean and standard deviation are those of the prior (rounding).
    assert!((estimate.values[2] - 1.0).abs() < 1e-9 && (estimate.std[2] - 1.0).abs() < 1e-9);
}

#[test]
fn too_few_data_are_an_error() {
    let w = DMatrix::from_fn(3, 3, |i, j| ((i + 2 * j) % 4) as f64 + f64::from(u8::from(i == j)));
    let problem = one_joint(&w, &DVector::from_element(3, 1.0));
    assert!(matches!(ordinary_least_squares(&problem, &WHITE), Err(EstimationError::TooFewRows { rows: 3, .. })));
    let empty = LinearProblem::new(names(2), vec!["joint1".into()]);
    assert_eq!(ordinary_least_squares(&empty, &WHITE), Err(EstimationError::Empty));
    let nothing = LinearProblem::new(Vec::new(), Vec::new());
    assert_eq!(ordinary_least_squares(&nothing, &WHITE), Err(EstimationError::Empty));
    // One segment only: an error instead of another covariance.
    let short = one_joint(&DMatrix::from_element(10, 1, 1.0), &DVector::from_element(10, 1.0));
    assert_eq!(
        ordinary_least_squares(&short, &OrdinarySettings::default()),
        Err(EstimationError::TooFewSegments { clusters: 1 })
    );
    assert!(ordinary_least_squares(&short, &WHITE).is_ok());
    // A joint without rows has no noise level.
    let mut lonely = LinearProblem::new(names(1), vec!["joint1".into(), "joint2".into()]);
    let mut factor = SegmentedFactor::new(1, SegmentSettings::default()).unwrap();
    factor.absorb(&[1.0; 80], 40).unwrap();
    lonely.add("log", 0, vec![0], factor).unwrap();
    assert!(matches!(ordinary_least_squares(&lonely, &WHITE), Err(EstimationError::TooFewRows { rows: 0, .. })));
}

#[test]
fn absurd_magnitudes_are_an_error_not_a_nan() {
    let mut random = Random::new(6);
    let w = DMatrix::from_fn(40, 1, |_, _| 1.0e139 * random.uniform());
    let tau = DVector::from_fn(40, |_, _| 1.0e-139 * random.normal());
    match weighted_least_squares(&one_joint(&w, &tau), &WeightedSettings::default()) {
        Ok(estimate) => assert_finite(&estimate),
        Err(error) => assert!(matches!(error, EstimationError::Overflow { .. }), "{error}"),
    }
}

#[test]
fn wrong_shapes_and_settings_are_refused() {
    let factor = || SegmentedFactor::new(2, SegmentSettings::default()).unwrap();
    let mut problem = LinearProblem::new(names(2), vec!["joint1".into()]);
    assert!(matches!(problem.add("log", 1, vec![0, 1], factor()), Err(EstimationError::Mismatch { .. })));
    assert!(matches!(problem.add("log", 0, vec![0], factor()), Err(EstimationError::Mismatch { .. })));
    assert!(matches!(problem.add("log", 0, vec![0, 2], factor()), Err(EstimationError::Column { column: 2, .. })));
    assert!(matches!(problem.add("log", 0, vec![1, 1], factor()), Err(EstimationError::Column { column: 1, .. })));
    assert!(problem.combined(&[1.0, 1.0]).is_err());
    assert!(problem.clone().with_fallback(vec![0.0]).is_err());
    assert!(problem.clone().with_fallback(vec![0.0, f64::NAN]).is_err());
    assert!(problem.clone().with_prior(vec![0.0; 2], DMatrix::identity(3, 3)).is_err());
    assert!(problem.with_prior(vec![0.0; 2], DMatrix::from_element(1, 2, f64::INFINITY)).is_err());
    assert!(SegmentedFactor::new(2, SegmentSettings { max_segments: 1, first_length_rows: 4 }).is_err());
    assert!(SegmentedFactor::new(2, SegmentSettings { max_segments: 4, first_length_rows: 0 }).is_err());
    for tolerance in [0.0, f64::NAN, 1.0, -1.0] {
        assert!(RankSettings { tolerance, ..Default::default() }.validate().is_err());
        assert!(WeightedSettings { tolerance: tolerance - 1.0, ..Default::default() }.validate().is_err());
    }
    assert!(WeightedSettings { max_iterations: 0, ..Default::default() }.validate().is_err());
}

#[test]
fn the_iteration_limit_is_a_status() {
    let (w, tau) = deficient();
    let settings = WeightedSettings { max_iterations: 1, ..Default::default() };
    let estimate = weighted_least_squares(&one_joint(&w, &tau), &settings).unwrap();
    assert_eq!((estimate.status, estimate.iterations), (EstimateStatus::IterationLimit, 1));
}

#[test]
fn estimates_serialise_with_valid_correlations() {
    let (w, tau) = deficient();
    let estimate = ordinary_least_squares(&one_joint(&w, &tau), &WHITE).unwrap();
    let json = serde_json::to_value(&estimate).unwrap();
    assert_eq!(json["status"], "not-all-excited");
    assert_eq!(json["covariance"][0][0].as_f64(), Some(estimate.covariance[(0, 0)]));
    assert_eq!(json["rank"]["fixed"][0]["name"], "p2");
    let correlation = correlation(&estimate.covariance);
    for i in 0..6 {
        assert_eq!(correlation[(i, i)], 1.0);
        assert!((0..6).all(|j| correlation[(i, j)].abs() <= 1.0 + 1e-12));
    }
    assert_eq!(correlation[(0, 2)], 0.0);
}

#[test]
fn clusters_across_joints_need_the_same_segments() {
    let mut random = Random::new(11);
    let mut problem = LinearProblem::new(names(1), vec!["joint1".into(), "joint2".into()]);
    for (joint, rows) in [(0, 100), (1, 90)] {
        let mut factor = SegmentedFactor::new(1, SegmentSettings::default()).unwrap();
        let panel: Vec<f64> = (0..2 * rows).map(|_| random.normal()).collect();
        factor.absorb(&panel, rows).unwrap();
        problem.add("long run", joint, vec![0], factor).unwrap();
    }
    let across = OrdinarySettings { covariance: CovarianceMethod::SegmentsAcrossJoints, ..Default::default() };
    let error = ordinary_least_squares(&problem, &across).unwrap_err();
    assert_eq!(error, EstimationError::SegmentsDiffer { log: "long run".into(), joint: "joint2".into() });
    assert!(ordinary_least_squares(&problem, &OrdinarySettings::default()).is_ok());
}
