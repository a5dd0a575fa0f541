//! The jackknife covariance compared with fits that leave segments out, and its coverage with few segments.

use dynident_estimation::{
    CovarianceMethod, Estimate, LinearProblem, OrdinarySettings, SegmentSettings, SegmentedFactor,
    ordinary_least_squares,
};
use dynident_model::sample::Random;

const COLUMNS: usize = 6;

/// Rows of one joint: smooth columns, torque with parameters 1, 2, .. and noise correlated in time.
fn rows(random: &mut Random, count: usize, correlation: f64) -> Vec<Vec<f64>> {
    let mut noise = random.normal();
    let phases: Vec<f64> = (0..COLUMNS).map(|_| random.uniform(0.0, 6.0)).collect();
    (0..count)
        .map(|t| {
            noise = correlation * noise + (1.0 - correlation * correlation).sqrt() * random.normal();
            let columns = (0..COLUMNS).map(|c| (0.11 * (1.0 + c as f64) * t as f64 + phases[c]).sin());
            let mut row: Vec<f64> = columns.collect();
            row.push(row.iter().enumerate().map(|(c, x)| (1.0 + c as f64) * x).sum::<f64>() + noise);
            row
        })
        .collect()
}

fn fit(rows: &[Vec<f64>], length: usize, covariance: CovarianceMethod) -> Estimate {
    let panel: Vec<f64> = (0..=COLUMNS).flat_map(|c| rows.iter().map(move |row| row[c])).collect();
    let settings = SegmentSettings { max_segments: 1024, first_length_rows: length };
    let mut factor = SegmentedFactor::new(COLUMNS, settings).expect("settings are valid");
    factor.absorb(&panel, rows.len()).expect("rows are finite");
    let names = (0..COLUMNS).map(|c| format!("p{c}")).collect();
    let mut problem = LinearProblem::new(names, vec!["joint".into()]);
    problem.add("log", 0, (0..COLUMNS).collect(), factor).expect("one joint, all columns");
    ordinary_least_squares(&problem, &OrdinarySettings { covariance, ..Default::default() }).expect("full rank")
}

#[test]
fn equals_fits_that_leave_one_segment_out() {
    let mut random = Random::new(8);
    // Segments stored as factors, as rows, and with fewer rows than columns.
    for (length, segments) in [(25, 12), (12, 25), (4, 75)] {
        let rows = rows(&mut random, length * segments, 0.8);
        let all = fit(&rows, length, CovarianceMethod::Jackknife);
        let mut expected = nalgebra::DMatrix::<f64>::zeros(COLUMNS, COLUMNS);
        for g in 0..segments {
            let kept: Vec<Vec<f64>> =
                rows.iter().enumerate().filter(|(t, _)| t / length != g).map(|(_, row)| row.clone()).collect();
            let without = fit(&kept, length, CovarianceMethod::White);
            let change = nalgebra::DVector::from_fn(COLUMNS, |c, _| without.values[c] - all.values[c]);
            expected += &change * change.transpose() * ((segments as f64 - 1.0) / segments as f64);
        }
        // The leverage ridge changes eigenvalues by 1e-6.
        assert!((&all.covariance - &expected).amax() <= 1e-4 * expected.amax());
    }
}

#[test]
fn intervals_cover_with_few_segments() {
    // Three segments per parameter. 600 intervals in the daily run, 2,400 in the long run: a coverage of 95 % has a
    // sampling error of √(0.95·0.05/600) = 0.9 % (0.5 %); lower limit 0.92 (3 σ). With about ten degrees of freedom
    // the interval should be wider than 1.96 std; the conservative jackknife compensates for this. CR1 must be worse.
    let mut random = Random::new(21);
    let (mut inside, mut inside_own, mut count) = (0, 0, 0);
    for _ in 0..dynident_testing::count(100, 400) {
        let rows = rows(&mut random, 18 * 40, 0.9);
        for (method, inside) in
            [(CovarianceMethod::Jackknife, &mut inside), (CovarianceMethod::Segments, &mut inside_own)]
        {
            let estimate = fit(&rows, 40, method);
            *inside += (0..COLUMNS)
                .filter(|&c| (estimate.values[c] - (1.0 + c as f64)).abs() <= 1.96 * estimate.std[c])
                .count();
        }
        count += COLUMNS;
    }
    let share = |inside: usize| inside as f64 / count as f64;
    assert!(share(inside) >= 0.92 && share(inside) <= 0.99, "jackknife {}", share(inside));
    assert!(share(inside_own) < share(inside), "own residuals {}", share(inside_own));
}

#[test]
fn segments_and_columns_without_motion_are_accepted() {
    let mut random = Random::new(5);
    let moving = rows(&mut random, 120, 0.5);
    let still = |row: &Vec<f64>| [vec![0.0; COLUMNS], vec![0.1 * row[COLUMNS]]].concat();
    for length in [4, 30] {
        // The second half is at rest.
        let half: Vec<Vec<f64>> =
            moving.iter().enumerate().map(|(t, row)| if t < 60 { row.clone() } else { still(row) }).collect();
        let found = fit(&half, length, CovarianceMethod::Jackknife);
        assert!(found.std.iter().all(|std| std.is_finite() && *std > 0.0), "{:?}", found.std);
        let none: Vec<Vec<f64>> = moving.iter().map(still).collect();
        let found = fit(&none, length, CovarianceMethod::Jackknife);
        assert_eq!(found.std, [0.0; COLUMNS], "nothing is estimated");
        assert_eq!(found.rank.fixed.len(), COLUMNS);
    }
}

/// Four joints with six parameters and ten segments each, as many as a robot has of both: the smallest eigenvalues of
/// the jackknife covariance are far too small. The squared distance of the estimate from the truth, χ²(24), exceeds its
/// 95 % quantile of 36.4 in 5 % of the cases if the covariance is right. Limits, chosen before measuring: at most 15 %
/// for the joint covariance (its noise level has few degrees of freedom), at least 30 % for the jackknife.
#[test]
fn joint_tests_hold_with_few_segments() {
    const JOINTS: usize = 4;
    let mut random = Random::new(34);
    let runs = dynident_testing::count(60, 400);
    let (mut joint, mut plain) = (0, 0);
    for _ in 0..runs {
        let names = (0..JOINTS * COLUMNS).map(|c| format!("p{c}")).collect();
        let mut problem = LinearProblem::new(names, (0..JOINTS).map(|j| format!("joint{j}")).collect());
        for own in 0..JOINTS {
            let rows = rows(&mut random, 600, 0.5);
            let panel: Vec<f64> = (0..=COLUMNS).flat_map(|c| rows.iter().map(move |row| row[c])).collect();
            let settings = SegmentSettings { max_segments: 1024, first_length_rows: 60 };
            let mut factor = SegmentedFactor::new(COLUMNS, settings).expect("settings are valid");
            factor.absorb(&panel, rows.len()).expect("rows are finite");
            let columns = (COLUMNS * own..COLUMNS * (own + 1)).collect();
            problem.add("log", own, columns, factor).expect("own columns");
        }
        let estimate = ordinary_least_squares(&problem, &OrdinarySettings::default()).expect("full rank");
        let truth = |c: usize| 1.0 + (c % COLUMNS) as f64;
        let error = nalgebra::DVector::from_fn(JOINTS * COLUMNS, |c, _| estimate.values[c] - truth(c));
        let is_far = |covariance: nalgebra::DMatrix<f64>| {
            let solved = covariance.cholesky().expect("positive definite").solve(&error);
            usize::from(error.dot(&solved) > 36.4)
        };
        joint += is_far(estimate.joint_covariance());
        plain += is_far(estimate.covariance.clone());
    }
    let share = |count: usize| count as f64 / runs as f64;
    assert!(share(joint) <= 0.15, "joint covariance: {}", share(joint));
    assert!(share(plain) >= 0.30, "jackknife: {}", share(plain));
}

#[test]
fn the_joint_covariance_of_white_errors_is_theirs() {
    let estimate = fit(&rows(&mut Random::new(3), 400, 0.0), 40, CovarianceMethod::White);
    assert_eq!(estimate.joint_covariance(), estimate.covariance);
}
