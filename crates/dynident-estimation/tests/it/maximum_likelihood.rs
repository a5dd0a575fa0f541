//! Maximum likelihood with noise in the motion: compared with total least squares for a straight line, and unbiased
//! where least squares is biased.

use crate::common::Random;
use dynident_estimation::{
    EstimateStatus, EstimationError, InstantRows, MaximumLikelihoodEstimate, MaximumLikelihoodSettings, RankSettings,
    maximum_likelihood,
};
use nalgebra::{DMatrix, DVector};

fn settings(motion: &[f64], torque: &[f64]) -> MaximumLikelihoodSettings {
    let diagonal = |std: &[f64]| DMatrix::from_diagonal(&DVector::from_iterator(std.len(), std.iter().map(|s| s * s)));
    MaximumLikelihoodSettings {
        motion_covariance: diagonal(motion),
        torque_covariance: diagonal(torque),
        rank: RankSettings::default(),
        tolerance: 1.0e-8,
        max_iterations: 50,
    }
}

fn names(count: usize) -> Vec<String> {
    (0..count).map(|k| format!("p{k}")).collect()
}

#[test]
fn a_straight_line_gives_total_least_squares() {
    // τ = 2 x with errors of 0.5 in x and 1 in τ: the smallest singular vector of [w/0.5 | τ] is the maximum
    // likelihood solution (Golub and Van Loan).
    let mut random = Random::new(3);
    let data: Vec<[f64; 2]> = (0..300)
        .map(|k| {
            let x = f64::from(k % 31) / 5.0 - 3.0;
            [x + 0.5 * random.normal(), 2.0 * x + random.normal()]
        })
        .collect();
    let by = [DMatrix::from_element(1, 1, 1.0)];
    let found: MaximumLikelihoodEstimate = maximum_likelihood(&names(1), &settings(&[0.5], &[1.0]), |visit| {
        for [w, tau] in &data {
            let (regressor, torque) = (DMatrix::from_element(1, 1, *w), DVector::from_element(1, *tau));
            visit(&InstantRows { regressor: &regressor, torque: &torque, regressor_by_motion: &by })?;
        }
        Ok::<(), EstimationError>(())
    })
    .unwrap();
    let scaled = DMatrix::from_fn(300, 2, |k, c| if c == 0 { data[k][0] / 0.5 } else { data[k][1] });
    let svd = scaled.svd(false, true);
    let v = svd.v_t.unwrap();
    let total = -v[(1, 0)] / v[(1, 1)] / 0.5;
    // Step tolerance times the error bar, and rounding.
    assert!((found.values[0] - total).abs() < 1e-8, "{} for {total}", found.values[0]);
    // The cost is the square of the smallest singular value; expected 299 with a standard deviation of 24.
    assert!((found.cost - svd.singular_values[1].powi(2)).abs() < 1e-6);
    assert!((found.cost - 299.0).abs() < 100.0 && found.degrees_of_freedom == 299);
    assert_eq!(found.status, EstimateStatus::Complete);
}

/// Rows of `τ = a sin q + b q̈ + c cos q` (two joints that share b) and their derivatives by (q, q̈).
fn instant(q: f64, ddq: f64) -> (DMatrix<f64>, [DMatrix<f64>; 2]) {
    let regressor = DMatrix::from_row_slice(2, 3, &[q.sin(), ddq, 0.0, 0.0, ddq, q.cos()]);
    let by_q = DMatrix::from_row_slice(2, 3, &[q.cos(), 0.0, 0.0, 0.0, 0.0, -q.sin()]);
    let by_ddq = DMatrix::from_row_slice(2, 3, &[0.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
    (regressor, [by_q, by_ddq])
}

const TRUTH: [f64; 3] = [5.0, 1.5, -2.0];
const MOTION_STD: [f64; 2] = [0.02, 0.6];
const TORQUE_STD: [f64; 2] = [0.1, 0.3];

fn estimate(seed: u64, with_motion_noise: bool) -> MaximumLikelihoodEstimate {
    let mut random = Random::new(seed);
    let data: Vec<(f64, f64, DVector<f64>)> = (0..200)
        .map(|k| {
            let t = f64::from(k) * 0.0314;
            let (q, ddq) = (1.2 * t.sin() + 0.4 * (2.0 * t).cos(), -1.2 * t.sin() - 1.6 * (2.0 * t).cos());
            let noise = DVector::from_fn(2, |i, _| TORQUE_STD[i] * random.normal());
            let torque = instant(q, ddq).0 * DVector::from_row_slice(&TRUTH) + noise;
            (q + MOTION_STD[0] * random.normal(), ddq + MOTION_STD[1] * random.normal(), torque)
        })
        .collect();
    let motion = if with_motion_noise { MOTION_STD } else { [0.0; 2] };
    maximum_likelihood(&names(3), &settings(&motion, &TORQUE_STD), |visit| {
        for (q, ddq, torque) in &data {
            let (regressor, by) = instant(*q, *ddq);
            visit(&InstantRows { regressor: &regressor, torque, regressor_by_motion: &by })?;
        }
        Ok::<(), EstimationError>(())
    })
    .unwrap()
}

#[test]
fn noise_in_the_motion_does_not_bias_and_the_error_bars_are_right() {
    let runs = 200;
    let (mut sums, mut squares, mut cost, mut plain) = ([0.0; 3], [0.0; 3], 0.0, 0.0);
    for seed in 0..runs {
        let found = estimate(seed, true);
        for k in 0..3 {
            let off = (found.values[k] - TRUTH[k]) / found.std[k];
            sums[k] += off;
            squares[k] += off * off;
        }
        cost += found.cost / found.degrees_of_freedom as f64;
        plain += estimate(seed, false).values[1] / TRUTH[1];
    }
    let runs = runs as f64;
    for k in 0..3 {
        // The mean of 200 has a standard deviation of 0.07; tolerance 4 σ. The curvature of the sines within 0.02 rad
        // adds less.
        assert!((sums[k] / runs).abs() < 0.3, "bias of p{k}: {} error bars", sums[k] / runs);
        // A variance from 200 squares has a standard deviation of 10 %; tolerance 4 σ.
        assert!((squares[k] / runs - 1.0).abs() < 0.4, "p{k}: {}", squares[k] / runs);
    }
    // χ² with 397 degrees of freedom, mean of 200: a standard deviation of 0.5 %, plus the curvature.
    assert!((cost / runs - 1.0).abs() < 0.03, "{}", cost / runs);
    // Without the motion's noise it is least squares, which is biased: noise of 0.36 in q̈ with a signal of 1.9
    // reduces the estimate by about 15 %.
    assert!(plain / runs < 0.92, "{}", plain / runs);
}

#[test]
fn invalid_covariances_and_shapes_are_named() {
    let bad = |change: &dyn Fn(&mut MaximumLikelihoodSettings)| {
        let mut settings = settings(&[0.1], &[1.0]);
        change(&mut settings);
        settings.validate().unwrap_err()
    };
    let name = |error: EstimationError| match error {
        EstimationError::Setting { setting, .. } => setting,
        _ => "",
    };
    assert_eq!(name(bad(&|s| s.torque_covariance[(0, 0)] = 0.0)), "torque_covariance");
    assert_eq!(name(bad(&|s| s.torque_covariance[(0, 0)] = f64::NAN)), "torque_covariance");
    assert_eq!(name(bad(&|s| s.motion_covariance[(0, 0)] = -1.0)), "motion_covariance");
    assert_eq!(name(bad(&|s| s.tolerance = 0.0)), "tolerance");
    assert_eq!(name(bad(&|s| s.max_iterations = 0)), "max_iterations");
    assert!(matches!(bad(&|s| s.motion_covariance = DMatrix::zeros(1, 2)), EstimationError::Mismatch { .. }));
    let none = maximum_likelihood(&names(1), &settings(&[0.1], &[1.0]), |_| Ok::<(), EstimationError>(()));
    assert!(matches!(none, Err(EstimationError::Empty)));
    let (regressor, torque) = (DMatrix::from_element(1, 1, 1.0), DVector::from_element(1, 1.0));
    let shape = maximum_likelihood(&names(1), &settings(&[0.1], &[1.0]), |visit| {
        visit(&InstantRows { regressor: &regressor, torque: &torque, regressor_by_motion: &[] })
    });
    assert!(matches!(shape, Err(EstimationError::Mismatch { expected: 1, found: 0, .. })));
}
