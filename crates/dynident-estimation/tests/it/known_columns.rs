//! Two steps: some parameters from one recording, others from another, with propagated errors.

use crate::common::Random;
use dynident_estimation::{
    CovarianceMethod, EstimationError, KnownColumns, LinearProblem, SegmentSettings, SegmentedFactor, WeightedSettings,
    weighted_least_squares, weighted_least_squares_with_known,
};
use nalgebra::DMatrix;

const THETA: [f64; 3] = [2.0, -1.0, 0.5];
const SAMPLES: usize = 1600;
const RHO: f64 = 0.8;

/// Columns a, b of the first step and c of the second; AR(1) noise.
fn recording(random: &mut Random, with_load: bool) -> LinearProblem {
    let mut factor = SegmentedFactor::new(3, SegmentSettings::default()).unwrap();
    let mut panel = vec![0.0; 4 * SAMPLES];
    let mut noise = random.normal() / (1.0 - RHO * RHO).sqrt();
    for k in 0..SAMPLES {
        let t = k as f64;
        // Similar to the first column, so that its known value matters.
        let load = if with_load { 0.3 * (t / 31.0).sin() + 0.8 * (t / 37.0).sin() } else { 0.0 };
        let row = [(t / 37.0).sin(), (t / 61.0).cos() + 0.5, load];
        noise = RHO * noise + random.normal();
        for (c, w) in row.iter().enumerate() {
            panel[c * SAMPLES + k] = *w;
        }
        panel[3 * SAMPLES + k] = noise + row.iter().zip(THETA).map(|(w, theta)| w * theta).sum::<f64>();
    }
    factor.absorb(&panel, SAMPLES).unwrap();
    let mut problem = LinearProblem::new(vec!["a".into(), "b".into(), "c".into()], vec!["joint1".into()]);
    problem.add("log", 0, vec![0, 1, 2], factor).unwrap();
    problem
}

#[test]
fn intervals_of_the_second_step_cover() {
    let mut random = Random::new(5);
    let (mut inside, mut without, mut runs) = (0, 0, 0);
    for _ in 0..400 {
        let first = weighted_least_squares(&recording(&mut random, false), &WeightedSettings::default()).unwrap();
        let known = |covariance| KnownColumns { columns: vec![0, 1], values: first.values[..2].to_vec(), covariance };
        let problem = recording(&mut random, true);
        let of = |covariance| {
            weighted_least_squares_with_known(&problem, &known(covariance), &WeightedSettings::default()).unwrap()
        };
        let second = of(first.covariance.view((0, 0), (2, 2)).into_owned());
        let error = (second.values[2] - THETA[2]).abs();
        inside += usize::from(error <= second.half_width_95[2]);
        without += usize::from(error <= of(DMatrix::zeros(2, 2)).half_width_95[2]);
        runs += 1;
    }
    // 400 runs give 95 % to 1.1 %; lower limit 3 σ; above, the error bars are conservative. Without the errors of the
    // first step they are too short.
    let share = |count: usize| count as f64 / f64::from(runs);
    assert!((0.917..=0.995).contains(&share(inside)), "{}", share(inside));
    assert!(share(without) < share(inside) - 0.02, "{} {}", share(without), share(inside));
}

#[test]
fn exactly_known_columns_leave_the_fit_of_the_others() {
    let problem = recording(&mut Random::new(3), true);
    let known = KnownColumns { columns: vec![1], values: vec![-1.1], covariance: DMatrix::zeros(1, 1) };
    let settings = WeightedSettings { covariance: CovarianceMethod::White, ..WeightedSettings::default() };
    let found = weighted_least_squares_with_known(&problem, &known, &settings).unwrap();
    // Oracle: a nearly exact prior.
    let strong = problem.clone().with_prior(vec![0.0, -1.1, 0.0], DMatrix::from_row_slice(1, 3, &[0.0, 1e7, 0.0]));
    let expected = weighted_least_squares(&strong.unwrap(), &settings).unwrap();
    for column in 0..3 {
        // The rows of the prior change the degrees of freedom by one in 1600.
        assert!((found.values[column] - expected.values[column]).abs() < 1e-6, "{column}");
        assert!((found.std[column] - expected.std[column]).abs() < 2e-3 * expected.std[column] + 2e-7, "{column}");
    }
}

#[test]
fn mismatched_columns_are_refused() {
    let problem = recording(&mut Random::new(3), true);
    let of = |columns: Vec<usize>, values: Vec<f64>| {
        let covariance = DMatrix::zeros(columns.len(), columns.len());
        weighted_least_squares_with_known(
            &problem,
            &KnownColumns { columns, values, covariance },
            &WeightedSettings::default(),
        )
    };
    assert!(matches!(of(vec![3], vec![1.0]), Err(EstimationError::Mismatch { .. })));
    assert!(matches!(of(vec![1, 1], vec![1.0, 1.0]), Err(EstimationError::Mismatch { .. })));
    assert!(matches!(of(vec![0, 1, 2], vec![1.0; 3]), Err(EstimationError::Mismatch { .. })));
    assert!(matches!(of(vec![0], vec![f64::NAN]), Err(EstimationError::Setting { .. })));
}
