//! Noise in the regressor, gross errors and invalid input.

use crate::common::Random;
use dynident_estimation::{
    CrossProblem, EstimateStatus, EstimationError, HausmanSettings, HausmanVerdict, InstrumentalSettings,
    InstrumentedProblem, LinearProblem, RobustSettings, RowBlock, RowWeight, SegmentSettings, SegmentedFactor,
    WeightedSettings, fast_motion, generalized_least_squares, hausman_test, instrumental_variables,
    robust_least_squares, weighted_least_squares,
};

const THETA: [f64; 2] = [2.0, -1.0];

fn problem_of(panel: &[f64], rows: usize) -> InstrumentedProblem {
    let settings = SegmentSettings { max_segments: 64, first_length_rows: (rows / 32).max(1) };
    let mut factor = SegmentedFactor::new(4, settings).unwrap();
    factor.absorb(panel, rows).unwrap();
    let mut problem = InstrumentedProblem::new(vec!["inertia".into(), "gravity".into()], vec!["joint1".into()]);
    problem.add("run", 0, &[0, 1], factor).unwrap();
    problem
}

/// Two columns of normal numbers, measured with noise of standard deviation `noise`; instruments with independent
/// noise of the same size; coloured torque noise.
fn experiment(random: &mut Random, rows: usize, noise: f64) -> Vec<f64> {
    let mut columns = vec![Vec::new(); 5];
    let mut coloured = 0.0;
    for _ in 0..rows {
        let x = [random.normal(), random.normal()];
        for (c, x) in x.iter().enumerate() {
            columns[c].push(x + noise * random.normal());
            columns[2 + c].push(x + noise * random.normal());
        }
        coloured = 0.8 * coloured + 0.2 * random.normal();
        columns[4].push(THETA[0] * x[0] + THETA[1] * x[1] + coloured);
    }
    columns.concat()
}

/// Mean error of both estimators over `runs` experiments.
fn bias(rows: usize, noise: f64, runs: u32) -> ([f64; 2], [f64; 2]) {
    let mut random = Random::new(7);
    let (mut plain, mut instruments) = ([0.0; 2], [0.0; 2]);
    for _ in 0..runs {
        let problem = problem_of(&experiment(&mut random, rows, noise), rows);
        let least = weighted_least_squares(&problem.regressors().unwrap(), &WeightedSettings::default()).unwrap();
        let found = instrumental_variables(&problem, &InstrumentalSettings::default()).unwrap();
        for c in 0..2 {
            plain[c] += (least.values[c] - THETA[c]) / f64::from(runs);
            instruments[c] += (found.estimate.values[c] - THETA[c]) / f64::from(runs);
        }
    }
    (plain, instruments)
}

#[test]
fn more_data_remove_the_bias_of_instruments_but_not_of_least_squares() {
    // Noise of 0.5: least squares converges to θ/(1 + 0.25), a bias of −0.4 and 0.2 for any number of rows.
    for rows in [200, 3200] {
        let (plain, instruments) = bias(rows, 0.5, 40);
        for c in 0..2 {
            let limit = -0.2 * THETA[c];
            // A run's estimate has a standard deviation of about √(1.2/rows) ≈ 0.08 at 200 rows; the mean of 40 runs a
            // sixth of it. Tolerance 4 σ.
            let chance = 4.0 * (2.0 / rows as f64 / 40.0).sqrt();
            // The finite-sample bias of IV is a few times 1/rows.
            let small = 6.0 / rows as f64;
            assert!((plain[c] - limit).abs() < chance + small, "{rows} rows, column {c}: {}", plain[c]);
            assert!(instruments[c].abs() < chance + small, "{rows} rows, column {c}: {}", instruments[c]);
        }
    }
}

#[test]
fn hausman_test_has_its_level_and_power() {
    let settings = HausmanSettings { level: 0.05, ..Default::default() };
    let mut random = Random::new(11);
    let (mut false_alarms, mut found) = (0, 0);
    for _ in 0..200 {
        // Noise in Z only: least squares is correct although residuals are coloured.
        let rows = 640;
        let mut panel = experiment(&mut random, rows, 0.0);
        panel[..2 * rows].iter_mut().for_each(|z| *z += 0.3 * random.normal());
        for (panel, count) in [(panel, &mut false_alarms), (experiment(&mut random, rows, 0.3), &mut found)] {
            let problem = problem_of(&panel, rows);
            let estimate = instrumental_variables(&problem, &InstrumentalSettings::default()).unwrap();
            let test = hausman_test(&problem, &estimate, &settings).unwrap();
            *count += i32::from(test.verdict == HausmanVerdict::RejectLeastSquares);
        }
    }
    // 5 % of 200 is 10 with a standard deviation of 3.1; the jackknife is conservative. Upper limit 4 σ.
    assert!(false_alarms <= 22, "{false_alarms} of 200");
    // A bias of 8 % of θ is fifteen standard deviations here.
    assert_eq!(found, 200);
}

/// κ is 1 for motion and 0 for noise in the part of the regressor that the instruments do not explain.
#[test]
fn torque_separates_fast_motion_from_noise() {
    let mut random = Random::new(5);
    let (rows, runs) = (640, 100);
    let mut inside = [0, 0];
    for _ in 0..runs {
        let clean = experiment(&mut random, rows, 0.0);
        // Noisy instruments: the unexplained part is motion.
        let mut fewer = clean.clone();
        fewer[..2 * rows].iter_mut().for_each(|z| *z += 0.3 * random.normal());
        // Noisy regressor, exact instruments: the unexplained part is noise.
        let mut noisy = clean;
        noisy[2 * rows..4 * rows].iter_mut().for_each(|w| *w += 0.3 * random.normal());
        for (place, (panel, expected)) in [(fewer, 1.0), (noisy, 0.0)].into_iter().enumerate() {
            let problem = problem_of(&panel, rows);
            let found = instrumental_variables(&problem, &InstrumentalSettings::default()).unwrap();
            let WeightedSettings { rank, covariance, .. } = WeightedSettings::default();
            let fast = fast_motion(&problem, &found, rank, covariance).unwrap().unwrap();
            inside[place] += i32::from((fast.followed - expected).abs() <= fast.half_width_95);
            assert!((fast.followed - expected).abs() < 0.5 && fast.share_of_torque < 0.5, "{fast:?}");
        }
    }
    // 95 of 100 with a standard deviation of 2.2; lower limit 4 σ and an allowance for the uncertainty of θ.
    assert!(inside.iter().all(|&count| count >= 84), "{inside:?}");
}

#[test]
fn weak_and_useless_instruments_are_named() {
    let mut random = Random::new(3);
    let rows = 400;
    let mut panel = experiment(&mut random, rows, 0.1);
    // The first instrument is independent noise.
    panel[..rows].iter_mut().for_each(|z| *z = random.normal());
    let problem = problem_of(&panel, rows);
    let found = instrumental_variables(&problem, &InstrumentalSettings::default()).unwrap();
    assert!(found.instruments.weak, "{:?}", found.instruments);
    assert_eq!(found.instruments.weakest_column.as_deref(), Some("inertia"));
    assert!(found.estimate.values.iter().chain(&found.estimate.std).all(|v| v.is_finite()));
    // A constant instrument: its column stays at the fallback.
    panel[..rows].fill(0.0);
    let problem = problem_of(&panel, rows).with_fallback(vec![1.5, 0.0]).unwrap();
    let found = instrumental_variables(&problem, &InstrumentalSettings::default()).unwrap();
    assert_eq!(found.estimate.status, EstimateStatus::NotAllExcited);
    assert_eq!(found.estimate.rank.fixed.len(), 1);
    assert!(found.estimate.values.iter().chain(&found.estimate.std).all(|v| v.is_finite()));
    let test = hausman_test(&problem, &found, &HausmanSettings::default()).unwrap();
    assert!(test.f.is_none_or(f64::is_finite));
    // Instruments equal to the regressor: undecided.
    let regressor = panel[2 * rows..4 * rows].to_vec();
    panel[..2 * rows].copy_from_slice(&regressor);
    let problem = problem_of(&panel, rows);
    let found = instrumental_variables(&problem, &InstrumentalSettings::default()).unwrap();
    assert_eq!(found.instruments.weakest_f, None);
    let test = hausman_test(&problem, &found, &HausmanSettings::default()).unwrap();
    assert_eq!(test.verdict, HausmanVerdict::Undecided);
    assert!(test.reason.unwrap().contains("instruments"));
}

#[test]
fn too_few_rows_are_refused_and_resting_joints_accepted() {
    let mut random = Random::new(5);
    let few = problem_of(&experiment(&mut random, 2, 0.1), 2);
    let refused = instrumental_variables(&few, &InstrumentalSettings::default());
    assert!(matches!(refused, Err(EstimationError::TooFewRows { .. })), "{refused:?}");
    let empty = InstrumentedProblem::new(vec!["a".into()], vec!["joint1".into()]);
    let refused = instrumental_variables(&empty, &InstrumentalSettings::default());
    assert_eq!(refused, Err(EstimationError::Empty));
    // Zero torque and columns: all values stay at the fallback.
    let rest = problem_of(&[0.0; 320], 64);
    let found = instrumental_variables(&rest, &InstrumentalSettings::default()).unwrap();
    assert_eq!(found.estimate.rank.fixed.len(), 2);
    assert_eq!(found.estimate.values, [0.0, 0.0]);
    let plain = rest.regressors().unwrap();
    let panel = [0.0; 192];
    let robust = robust_least_squares::<EstimationError>(&plain, &RobustSettings::default(), |visit| {
        visit(&RowBlock { log: 0, joint: 0, rows: 64, panel: &panel })
    })
    .unwrap();
    assert_eq!(robust.estimate.values, [0.0, 0.0]);
    assert!(robust.estimate.joint_sigma[0].is_finite());
    // A pass with rows that differ from those of the problem.
    let other = robust_least_squares::<EstimationError>(&plain, &RobustSettings::default(), |visit| {
        visit(&RowBlock { log: 0, joint: 0, rows: 32, panel: &panel[..96] })
    });
    assert!(matches!(other, Err(EstimationError::Mismatch { .. })), "{other:?}");
    // Two joints with the same error, one of them without motion.
    let mut problem =
        CrossProblem::new(vec!["a".into()], vec!["j1".into(), "j2".into()], vec![vec![0], vec![]]).unwrap();
    let mut factor =
        SegmentedFactor::new(problem.width(), SegmentSettings { max_segments: 8, first_length_rows: 8 }).unwrap();
    let x: Vec<f64> = (0..64).map(|k| f64::from(k % 5) - 2.0).collect();
    let noise: Vec<f64> = (0..64).map(|_| 0.1 * random.normal()).collect();
    let tau: Vec<f64> = x.iter().zip(&noise).map(|(x, e)| 3.0 * x + e).collect();
    factor.absorb(&[x, tau, noise].concat(), 64).unwrap();
    problem.add("run", factor).unwrap();
    let found = generalized_least_squares(&problem, &WeightedSettings::default()).unwrap();
    // The second joint determines the first one's error up to the correlation limit of 1 − 1e-9: a share of √2e-9
    // remains.
    assert!((found.estimate.values[0] - 3.0).abs() < 1.0e-4, "{}", found.estimate.values[0]);
    assert!(found.estimate.covariance.iter().all(|v| v.is_finite()));
}

/// RMS error of the parameters over `runs`, relative to the error bars without outliers.
fn robust_error(share: f64, weight: Option<RowWeight>, runs: u32) -> f64 {
    let mut random = Random::new(23);
    let rows = 300;
    let mut sum = 0.0;
    for _ in 0..runs {
        let mut panel = vec![0.0; 3 * rows];
        for row in 0..rows {
            let (a, b) = (random.normal(), 1.0 + random.uniform());
            let clean = THETA[0] * a + THETA[1] * b + 0.1 * random.normal();
            // Always drawn, so that all settings have the same noise.
            let (chance, gross) = (random.uniform(), 5.0 * random.normal());
            let tau = clean + if chance < share { gross } else { 0.0 };
            (panel[row], panel[rows + row], panel[2 * rows + row]) = (a, b, tau);
        }
        let settings = SegmentSettings { max_segments: 32, first_length_rows: 10 };
        let mut factor = SegmentedFactor::new(2, settings).unwrap();
        factor.absorb(&panel, rows).unwrap();
        let mut problem = LinearProblem::new(vec!["a".into(), "b".into()], vec!["joint1".into()]);
        problem.add("run", 0, vec![0, 1], factor).unwrap();
        let values = match weight {
            None => weighted_least_squares(&problem, &WeightedSettings::default()).unwrap().values,
            Some(weight) => {
                let settings = RobustSettings { weight, ..Default::default() };
                robust_least_squares::<EstimationError>(&problem, &settings, |visit| {
                    // In two blocks, as from a stream.
                    let half = rows / 2;
                    for (from, to) in [(0, half), (half, rows)] {
                        let part: Vec<f64> =
                            (0..3).flat_map(|c| panel[c * rows + from..c * rows + to].to_vec()).collect();
                        visit(&RowBlock { log: 0, joint: 0, rows: to - from, panel: &part })?;
                    }
                    Ok(())
                })
                .unwrap()
                .estimate
                .values
            }
        };
        sum += (0..2).map(|c| (values[c] - THETA[c]).powi(2)).sum::<f64>() / f64::from(runs);
    }
    sum.sqrt()
}

#[test]
fn gross_errors_cost_reweighting_at_most_a_fifth() {
    let runs = 150;
    let clean = robust_error(0.0, None, runs);
    let spoilt = robust_error(0.05, None, runs);
    assert!(spoilt > 5.0 * clean, "least squares suffers: {spoilt} against {clean}");
    for weight in [RowWeight::huber(), RowWeight::tukey()] {
        let robust = robust_error(0.05, Some(weight), runs);
        // Requirement of the project.
        assert!(robust <= 1.2 * clean, "{weight:?}: {robust} against {clean}");
    }
}
