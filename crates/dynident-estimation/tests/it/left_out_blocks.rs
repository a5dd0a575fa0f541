//! Prediction error on left-out blocks: compared with refitted rows, for a correct model and for a drifting one.

use dynident_estimation::{
    Estimate, LinearProblem, SegmentSettings, SegmentedFactor, WeightedSettings, left_out_ratios,
    weighted_least_squares,
};
use dynident_model::sample::Random;
use nalgebra::{DMatrix, DVector};

const ROWS: usize = 4096;
const BLOCKS: usize = 4;

/// Two joints that share the middle one of three columns; the torque of the second drifts by `drift` of its own column
/// from the first sample to the last.
fn rows(seed: u64, drift: f64) -> [(DMatrix<f64>, DVector<f64>); 2] {
    let mut random = Random::new(seed);
    [[0, 1], [1, 2]].map(|columns| {
        let truth = [2.0, -1.0, 0.5];
        let w = DMatrix::from_fn(ROWS, 2, |_, _| random.normal());
        let tau = DVector::from_fn(ROWS, |row, _| {
            let late = row as f64 / ROWS as f64;
            let own = truth[columns[1]] + if columns[1] == 2 { drift * late } else { 0.0 };
            w[(row, 0)] * truth[columns[0]] + w[(row, 1)] * own + 0.1 * (1.0 + columns[0] as f64) * random.normal()
        });
        (w, tau)
    })
}

fn fitted(joints: &[(DMatrix<f64>, DVector<f64>); 2]) -> (LinearProblem, Estimate) {
    let names = |kind: &str, count: usize| (0..count).map(|k| format!("{kind}{k}")).collect();
    let mut problem = LinearProblem::new(names("p", 3), names("j", 2));
    for (joint, (w, tau)) in joints.iter().enumerate() {
        let settings = SegmentSettings { max_segments: 64, first_length_rows: ROWS / 64 };
        let mut factor = SegmentedFactor::new(2, settings).unwrap();
        let panel: Vec<f64> = w.iter().chain(tau.iter()).copied().collect();
        factor.absorb(&panel, ROWS).unwrap();
        problem.add("run", joint, vec![joint, joint + 1], factor).unwrap();
    }
    let estimate = weighted_least_squares(&problem, &WeightedSettings::default()).unwrap();
    (problem, estimate)
}

#[test]
fn ratio_equals_that_of_refitted_rows() {
    let joints = rows(5, 0.4);
    let (problem, estimate) = fitted(&joints);
    let found = left_out_ratios(&problem, &estimate, BLOCKS).unwrap();
    // Predicts every block by a fit to all other rows, with the weights of the full fit.
    let full = |joint: usize| {
        let (w, tau) = &joints[joint];
        let mut wide = DMatrix::zeros(ROWS, 3);
        wide.view_mut((0, joint), (ROWS, 2)).copy_from(w);
        (wide / estimate.joint_sigma[joint], tau / estimate.joint_sigma[joint])
    };
    let weighted = [full(0), full(1)];
    let information: DMatrix<f64> = weighted.iter().map(|(w, _)| w.transpose() * w).sum();
    let length = ROWS / BLOCKS;
    let mut ratios = [0.0; 2];
    for block in 0..BLOCKS {
        let (mut a, mut b) = (DMatrix::zeros(3, 3), DVector::zeros(3));
        for (w, tau) in &weighted {
            for row in (0..ROWS).filter(|row| row / length != block) {
                a += w.row(row).transpose() * w.row(row);
                b += w.row(row).transpose() * tau[row];
            }
        }
        let inverse = a.try_inverse().unwrap();
        let theta = &inverse * b;
        let variance = &inverse * &information * &estimate.covariance * &information * &inverse;
        for (ratio, (w, tau)) in ratios.iter_mut().zip(&weighted) {
            let (w, tau) = (w.rows(block * length, length), tau.rows(block * length, length));
            let expected = (w * &variance * w.transpose()).trace() + length as f64;
            *ratio += (tau - w * &theta).norm_squared() / expected / BLOCKS as f64;
        }
    }
    for (found, ratio) in found.iter().zip(ratios) {
        // Rounding of sums of some thousand squares.
        assert!((found * found - ratio.max(1.0)).abs() < 1e-9, "{found} and {ratio}");
    }
    assert!(found[1] > 1.05, "{found:?}");
}

#[test]
fn correct_models_predict_their_error_and_drifting_ones_do_not() {
    for seed in 0..20 {
        let joints = rows(seed, 0.0);
        let (problem, estimate) = fitted(&joints);
        let ratios = left_out_ratios(&problem, &estimate, BLOCKS).unwrap();
        // The mean of 4,096 squares has a standard deviation of 2.2 %, its root half of that; tolerance 4 σ.
        assert!(ratios.iter().all(|ratio| (1.0..1.045).contains(ratio)), "{ratios:?}");
    }
    let joints = rows(3, 4.0);
    let (problem, estimate) = fitted(&joints);
    let ratios = left_out_ratios(&problem, &estimate, BLOCKS).unwrap();
    // Only the second joint's own column drifts; the shared column is hardly affected.
    assert!(ratios[0] < 1.1 && ratios[1] > 1.15, "{ratios:?}");
}

#[test]
fn blocks_that_alone_determine_a_parameter_give_finite_ratios() {
    let mut joints = rows(1, 0.0);
    joints[1].0.view_mut((0, 1), (3 * ROWS / 4, 1)).fill(0.0);
    let (problem, estimate) = fitted(&joints);
    let ratios = left_out_ratios(&problem, &estimate, BLOCKS).unwrap();
    assert!(ratios.iter().all(|ratio| ratio.is_finite() && *ratio >= 1.0), "{ratios:?}");
}
