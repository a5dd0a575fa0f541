//! Joint gains from logs without and with a known load.

use crate::common::Random;
use dynident_estimation::{
    EstimateStatus, EstimationError, GainProblem, LinearProblem, SegmentSettings, SegmentedFactor, WeightedSettings,
    joint_gains,
};

const SAMPLES: usize = 1200;
/// The first two parameters belong to both joints (`shared`) or to one each.
const THETA: [f64; 4] = [3.0, -2.0, 1.0, 0.7];
const GAINS: [f64; 2] = [12.0, -0.4];

/// Two joints with two parameters each: joint 1 has 0 and 1; joint 2 has 2 and 3, or 1 and 3 if they share one. The
/// load adds to parameter 0 and, if `felt`, to 3.
fn problem(random: &mut Random, noise: f64, shared: bool, felt: bool) -> (LinearProblem, Vec<Vec<f64>>) {
    let names = (0..4).map(|c| format!("theta{c}")).collect();
    let mut problem = LinearProblem::new(names, vec!["joint1".into(), "joint2".into()]);
    let load = vec![0.8, 0.0, 0.0, if felt { 0.5 } else { 0.0 }];
    let known = vec![vec![0.0; 4], load];
    for (log, known) in known.iter().enumerate() {
        for (joint, columns) in [vec![0, 1], if shared { vec![1, 3] } else { vec![2, 3] }].into_iter().enumerate() {
            let mut panel = vec![0.0; 3 * SAMPLES];
            let mut error = 0.0;
            for k in 0..SAMPLES {
                let t = (k + 17 * log) as f64;
                let row = [(t / 37.0).sin() + 0.1 * joint as f64, (t / (61.0 - 20.0 * joint as f64)).cos() + 0.3];
                error = 0.7 * error + noise * random.normal();
                let torque: f64 = row.iter().zip(&columns).map(|(w, &c)| w * (THETA[c] + known[c])).sum();
                panel[k] = row[0];
                panel[SAMPLES + k] = row[1];
                panel[2 * SAMPLES + k] = (torque + error) / GAINS[joint];
            }
            let mut factor = SegmentedFactor::new(2, SegmentSettings::default()).unwrap();
            factor.absorb(&panel, SAMPLES).unwrap();
            problem.add(&format!("log{log}"), joint, columns, factor).unwrap();
        }
    }
    (problem, known)
}

#[test]
fn noise_free_data_give_the_true_gains() {
    for (shared, felt) in [(false, true), (true, true), (true, false)] {
        let (rows, known) = problem(&mut Random::new(1), 0.0, shared, felt);
        let found = joint_gains(&GainProblem { rows: &rows, known }, &WeightedSettings::default()).unwrap();
        for (gain, truth) in found.gains.iter().zip(GAINS) {
            // Rounding only; a joint that shares a parameter needs no load.
            assert!(gain.identified && (gain.gain / truth - 1.0).abs() < 1e-8, "{gain:?}");
        }
        for (column, truth) in THETA.iter().enumerate().filter(|(c, _)| !shared || *c != 2) {
            assert!((found.estimate.values[column] / truth - 1.0).abs() < 1e-8, "{column}");
        }
    }
}

#[test]
fn intervals_cover_the_true_values() {
    let mut random = Random::new(77);
    let (mut inside, mut runs) = (0_usize, 0);
    for _ in 0..150 {
        let (rows, known) = problem(&mut random, 0.3, true, true);
        let found = joint_gains(&GainProblem { rows: &rows, known }, &WeightedSettings::default()).unwrap();
        assert_eq!(found.estimate.status, EstimateStatus::NotAllExcited); // theta2, which nobody sees
        for (gain, truth) in found.gains.iter().zip(GAINS) {
            inside += usize::from((gain.gain - truth).abs() <= gain.half_width_95);
            runs += 1;
        }
    }
    // 300 intervals give 95 % to 1.3 %, slightly less for two correlated ones per run: 90 to 99 %.
    let share = inside as f64 / f64::from(runs);
    assert!((0.90..=0.99).contains(&share), "{share}");
}

#[test]
fn joints_without_load_are_named() {
    let (rows, known) = problem(&mut Random::new(9), 0.3, false, false);
    let found = joint_gains(&GainProblem { rows: &rows, known: known.clone() }, &WeightedSettings::default()).unwrap();
    assert!(found.gains[0].identified && !found.gains[1].identified);
    assert!((found.gains[0].gain - GAINS[0]).abs() <= 3.0 * found.gains[0].half_width_95);
    let none = GainProblem { rows: &rows, known: vec![vec![0.0; 4]; 2] };
    assert!(matches!(joint_gains(&none, &WeightedSettings::default()), Err(EstimationError::Setting { .. })));
    let short = GainProblem { rows: &rows, known: known[..1].to_vec() };
    assert!(matches!(joint_gains(&short, &WeightedSettings::default()), Err(EstimationError::Mismatch { .. })));
}
