//! The noise levels converge to those of the plain iteration over dense rows, in fewer solutions.

use crate::common::Random;
use dynident_estimation::{
    LinearProblem, SegmentSettings, SegmentedFactor, WeightedSettings, weighted_least_squares, weighted_values,
};
use nalgebra::{DMatrix, DVector};

const COLUMNS: usize = 12;
/// Rows and noise of the joints: few rows per column, so that each joint's weight affects the noise of the others.
const JOINTS: [(usize, f64); 4] = [(28, 1.0), (36, 0.1), (50, 3.0), (32, 0.4)];

/// `[W | τ]` of every joint, each with all columns.
fn rows(random: &mut Random) -> Vec<(DMatrix<f64>, DVector<f64>)> {
    let truth = DVector::from_fn(COLUMNS, |column, _| 1.0 + column as f64 / 3.0);
    let of_joint = |&(count, sigma): &(usize, f64)| {
        let regressor = DMatrix::from_fn(count, COLUMNS, |_, _| random.normal());
        let torque = &regressor * &truth + DVector::from_fn(count, |_, _| sigma * random.normal());
        (regressor, torque)
    };
    JOINTS.iter().map(of_joint).collect()
}

fn problem(rows: &[(DMatrix<f64>, DVector<f64>)]) -> LinearProblem {
    let named = |kind: &str, count: usize| (0..count).map(|number| format!("{kind}{number}")).collect::<Vec<_>>();
    let mut problem = LinearProblem::new(named("theta", COLUMNS), named("joint", rows.len()));
    for (joint, (regressor, torque)) in rows.iter().enumerate() {
        let mut factor = SegmentedFactor::new(COLUMNS, SegmentSettings::default()).unwrap();
        let panel = [regressor.as_slice(), torque.as_slice()].concat();
        factor.absorb(&panel, regressor.nrows()).unwrap();
        problem.add("log", joint, (0..COLUMNS).collect(), factor).unwrap();
    }
    problem
}

/// Residual noise of every joint for weights `1/σ`, by normal equations over the dense rows.
fn left(rows: &[(DMatrix<f64>, DVector<f64>)], sigma: &[f64]) -> Vec<f64> {
    let mut information = DMatrix::zeros(COLUMNS, COLUMNS);
    let mut right = DVector::zeros(COLUMNS);
    for ((regressor, torque), sigma) in rows.iter().zip(sigma) {
        information += regressor.tr_mul(regressor) / (sigma * sigma);
        right += regressor.tr_mul(torque) / (sigma * sigma);
    }
    let theta = information.cholesky().unwrap().solve(&right);
    let share = COLUMNS as f64 / rows.len() as f64;
    let of_joint = |(regressor, torque): &(DMatrix<f64>, DVector<f64>)| {
        ((torque - regressor * &theta).norm_squared() / (regressor.nrows() as f64 - share)).sqrt()
    };
    rows.iter().map(of_joint).collect()
}

#[test]
fn noise_converges_to_the_plain_iteration_and_faster() {
    let mut random = Random::new(20_261_128);
    let (mut plain_solutions, mut solutions) = (0, 0);
    for _ in 0..20 {
        let rows = rows(&mut random);
        let found = weighted_values(&problem(&rows), &WeightedSettings::default()).unwrap();
        assert!(found.converged);

        let mut sigma = vec![1.0; JOINTS.len()];
        for step in 1.. {
            let next = left(&rows, &sigma);
            let change = next.iter().zip(&sigma).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max);
            sigma = next;
            if step > 1 && change <= 1.0e-6 {
                plain_solutions += step;
                break;
            }
            assert!(step < 1_000, "the plain iteration does not converge");
        }
        // Both end when a step changes less than 1e-6; the slow iteration may then still be 1e-5 from its limit.
        for (found, plain) in found.joint_sigma.iter().zip(&sigma) {
            assert!((found / plain - 1.0).abs() < 1.0e-5, "{found} {plain}");
        }
        let again = left(&rows, &found.joint_sigma);
        for (found, again) in found.joint_sigma.iter().zip(&again) {
            assert!((found / again - 1.0).abs() < 1.0e-6, "{found} {again}");
        }
        solutions += found.iterations;
    }
    assert!(4 * solutions < 3 * plain_solutions, "{solutions} solutions, {plain_solutions} of the plain iteration");
}

#[test]
fn values_alone_equal_those_of_the_estimate() {
    let rows = rows(&mut Random::new(7));
    let (problem, settings) = (problem(&rows), WeightedSettings::default());
    let (values, estimate) =
        (weighted_values(&problem, &settings).unwrap(), weighted_least_squares(&problem, &settings).unwrap());
    assert_eq!(values.values, estimate.values);
    assert_eq!(values.joint_sigma, estimate.joint_sigma);
    assert_eq!(values.iterations, estimate.iterations);
    for (column, std) in values.white_std.iter().enumerate() {
        let other = estimate.covariance_white[(column, column)].sqrt();
        assert!((std / other - 1.0).abs() < 1.0e-12, "{std} {other}");
    }
}
