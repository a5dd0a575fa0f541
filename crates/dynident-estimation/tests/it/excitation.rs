//! Columns that contain only noise of the motion.

use crate::common::Random;
use dynident_estimation::{
    EstimateStatus, LinearProblem, RankSettings, SegmentSettings, SegmentedFactor, Unexcited, WeightedSettings,
    unexcited_columns, weighted_least_squares,
};
use nalgebra::{DMatrix, DVector};

const ROWS: usize = 400;
const JOINTS: usize = 2;

fn problem(rows: &[DMatrix<f64>], tau: &[DVector<f64>]) -> LinearProblem {
    let columns = rows[0].ncols();
    let names = (0..columns).map(|c| format!("p{c}")).collect();
    let mut problem = LinearProblem::new(names, vec!["a".into(), "b".into()]);
    for (joint, (w, tau)) in rows.iter().zip(tau).enumerate() {
        let mut factor = SegmentedFactor::new(columns, SegmentSettings::default()).unwrap();
        let panel: Vec<f64> = w.iter().chain(tau.iter()).copied().collect();
        factor.absorb(&panel, w.nrows()).unwrap();
        problem.add("log", joint, (0..columns).collect(), factor).unwrap();
    }
    problem
}

type Rows = Vec<DMatrix<f64>>;

/// Rows, their noise, torque. Columns: 0 and 1 are motion with some noise; 2 is noise; 3 is constant; 4 is constant
/// with noise; 5 is zero.
fn at_rest() -> (Rows, Rows, Vec<DVector<f64>>) {
    let mut random = Random::new(5);
    let noise = [0.01, 0.02, 0.3, 0.0, 0.05, 0.0];
    let (mut rows, mut made, mut torques) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..JOINTS {
        let truth = DMatrix::from_fn(ROWS, 6, |_, c| match c {
            0 | 1 => random.normal(),
            3 => 1.0,
            4 => 2.0,
            _ => 0.0,
        });
        let mut drawn = || DMatrix::from_fn(ROWS, 6, |_, c| noise[c] * random.normal());
        let (measured, again) = (&truth + drawn(), drawn());
        let theta = DVector::from_vec(vec![1.0, -2.0, 3.0, 0.5, 0.25, 7.0]);
        let torque = &truth * theta + DVector::from_fn(ROWS, |_, _| 0.1 * random.normal());
        rows.push(measured);
        made.push(again);
        torques.push(torque);
    }
    (rows, made, torques)
}

fn found(rows: &[DMatrix<f64>], made: &[DMatrix<f64>], scales: Option<&[f64]>) -> Unexcited {
    let zeros = vec![DVector::zeros(ROWS); JOINTS];
    unexcited_columns(&problem(rows, &zeros), &problem(made, &zeros), &[1.0; JOINTS], scales).unwrap()
}

#[test]
fn columns_of_noise_are_held() {
    let (rows, made, torques) = at_rest();
    let unexcited = found(&rows, &made, None);
    // Of the two constant columns the exact one is selected.
    assert_eq!((&unexcited.columns[..], &unexcited.silent[..]), (&[2, 4, 5][..], &[2, 5][..]));
    let nominal = vec![0.0, 0.0, 2.5, 0.0, 0.2, 6.0];
    let problem = problem(&rows, &torques).with_fallback(nominal.clone()).unwrap().with_unexcited(unexcited).unwrap();
    let estimate = weighted_least_squares(&problem, &WeightedSettings::default()).unwrap();
    assert_eq!(estimate.status, EstimateStatus::NotAllExcited);
    for column in [2, 4, 5] {
        assert_eq!((estimate.values[column], estimate.std[column]), (nominal[column], 0.0));
    }
    // Standard errors: 0.1 over the root of 800 rows, plus torque from the nominal value 2.5 and noise 0.3: 0.027 in
    // all; tolerance 5 σ. The data determine p3 + 2 p4 = 1, so the estimate is p3 with p4 at nominal.
    for (column, expected) in [(0, 1.0), (1, -2.0), (3, 1.0 - 2.0 * 0.2)] {
        assert!((estimate.values[column] - expected).abs() < 0.14, "{column}: {}", estimate.values[column]);
    }
    // p3 depends on p4; nothing depends on pure noise columns.
    let answers = |column: usize| {
        let fixed = estimate.rank.fixed.iter().find(|fixed| fixed.column == column).unwrap();
        assert!(fixed.noise);
        fixed.answers.clone()
    };
    assert!((answers(4)[3] + 2.0).abs() < 0.05 && answers(4)[0].abs() < 0.05, "{:?}", answers(4));
    assert_eq!((answers(2), answers(5)), (vec![0.0; 6], vec![0.0; 6]));
    // The combination is kept and the noise removed.
    let factor = problem.combined_without_noise(&[1.0; JOINTS], &RankSettings::default()).unwrap();
    let norms = factor.column_norms();
    assert_eq!((norms[2], norms[5]), (0.0, 0.0));
    assert!((norms[4] - 2.0 * norms[3]).abs() < 0.05 * norms[3]);
}

#[test]
fn order_and_units_do_not_matter() {
    let (rows, made, _) = at_rest();
    let plain = found(&rows, &made, None).columns;
    let order = [4, 2, 0, 5, 3, 1];
    let turned =
        |all: &[DMatrix<f64>]| -> Vec<DMatrix<f64>> { all.iter().map(|rows| rows.select_columns(&order)).collect() };
    let mut other: Vec<usize> =
        found(&turned(&rows), &turned(&made), None).columns.iter().map(|&column| order[column]).collect();
    other.sort_unstable();
    assert_eq!(other, plain);
    let unit = |c: usize| 10_f64.powi(3 * c as i32 - 6);
    let scaled = |all: &[DMatrix<f64>]| -> Vec<DMatrix<f64>> {
        all.iter().map(|rows| DMatrix::from_fn(ROWS, 6, |r, c| unit(c) * rows[(r, c)])).collect()
    };
    assert_eq!(found(&scaled(&rows), &scaled(&made), None).columns, plain);
    // With known scales the parameter with the largest torque error is estimated: p4.
    let scales = [1.0, 1.0, 1.0, 0.1, 1.0, 1.0];
    assert_eq!(found(&rows, &made, Some(&scales)).columns, [2, 3, 5]);
    let in_units: Vec<f64> = (0..6).map(|c| scales[c] / unit(c)).collect();
    assert_eq!(found(&scaled(&rows), &scaled(&made), Some(&in_units)).columns, [2, 3, 5]);
}

#[test]
fn without_noise_only_dependent_columns_are_held() {
    let (rows, made, _) = at_rest();
    let none: Vec<DMatrix<f64>> = made.iter().map(|rows| rows * 0.0).collect();
    assert_eq!(found(&rows, &none, None).columns, [5]);
    assert!(
        unexcited_columns(
            &problem(&rows, &[DVector::zeros(ROWS), DVector::zeros(ROWS)]),
            &LinearProblem::new(vec!["p".into()], vec!["a".into(), "b".into()]),
            &[1.0; 2],
            None
        )
        .is_err()
    );
}
