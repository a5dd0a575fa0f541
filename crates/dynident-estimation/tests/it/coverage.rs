//! Coverage of 95 % intervals for residuals that are correlated in time.

use crate::common::Random;
use dynident_estimation::{
    LinearProblem, OrdinarySettings, SegmentSettings, SegmentedFactor, WeightedSettings, ordinary_least_squares,
    weighted_least_squares,
};
use dynident_testing::count;

const SAMPLES: usize = 6_400;
const RHO: f64 = 0.9;
const THETA: [f64; 4] = [2.0, -1.0, 0.5, 0.3];

/// Two joints with AR(1) noise of different size; columns as slow as a robot's motion (periods of about 100 to 400
/// samples), the last one the sign of a velocity, as for Coulomb friction.
fn simulated(random: &mut Random, settings: SegmentSettings) -> LinearProblem {
    let names = (0..THETA.len()).map(|c| format!("theta{c}")).collect();
    let mut problem = LinearProblem::new(names, vec!["joint1".into(), "joint2".into()]);
    for (joint, (sigma, columns)) in [(0.5, vec![0, 1, 2, 3]), (0.1, vec![1, 2, 3])].into_iter().enumerate() {
        let mut factor = SegmentedFactor::new(columns.len(), settings).unwrap();
        let mut panel = vec![0.0; (columns.len() + 1) * SAMPLES];
        let mut noise = random.normal() * sigma / (1.0 - RHO * RHO).sqrt();
        for k in 0..SAMPLES {
            let t = k as f64;
            let row = [(t / 37.0).sin(), (t / 61.0).cos(), (t / 23.0 + 0.4).sin(), (t / 29.0).cos().signum()];
            noise = RHO * noise + sigma * random.normal();
            let mut tau = noise;
            for (c, &column) in columns.iter().enumerate() {
                panel[c * SAMPLES + k] = row[column];
                tau += row[column] * THETA[column];
            }
            panel[columns.len() * SAMPLES + k] = tau;
        }
        factor.absorb(&panel, SAMPLES).unwrap();
        problem.add("log", joint, columns, factor).unwrap();
    }
    problem
}

/// Coverage of 95 % intervals over all parameters and runs, by segments and under white noise; and the mean effective
/// lag-1 correlation.
fn coverage(weighted: bool) -> (f64, f64, f64) {
    let mut random = Random::new(20_261_121);
    let (mut segments, mut white, mut lag1) = (0, 0, 0.0);
    let runs = count(100, 400);
    for _ in 0..runs {
        let problem = simulated(&mut random, SegmentSettings::default());
        let estimate = if weighted {
            weighted_least_squares(&problem, &WeightedSettings::default()).unwrap()
        } else {
            ordinary_least_squares(&problem, &OrdinarySettings::default()).unwrap()
        };
        for (c, truth) in THETA.iter().enumerate() {
            let error = (estimate.values[c] - truth).abs();
            segments += usize::from(error <= 1.96 * estimate.std[c]);
            white += usize::from(error <= 1.96 * estimate.covariance_white[(c, c)].sqrt());
        }
        lag1 += estimate.effective_lag1.iter().sum::<f64>() / 2.0;
    }
    let share = |count: usize| count as f64 / (runs * THETA.len()) as f64;
    (share(segments), share(white), lag1 / runs as f64)
}

/// With ρ = 0.9 and slow columns the white standard deviation is too small by up to √(1.9/0.1) = 4.4. The coverage of
/// its "95 %" interval is then P(|z| < 1.96/4.4) = 34 %, more for the faster columns; the limit is 75 %. The interval
/// from segments is asymptotically correct; with about 50 segments per joint the coverage may be a few percent lower,
/// so the limits are 90 % and 99 %. Sampling error of the coverage: √(0.95·0.05/400) = 1.1 % for the 400 intervals of
/// the daily run, 0.6 % for the 1,600 of the long run.
fn assert_coverage(weighted: bool) {
    let (segments, white, lag1) = coverage(weighted);
    assert!((0.90..=0.99).contains(&segments), "segments {segments}");
    assert!(white < 0.75, "white {white}");
    // Below ρ = 0.9 because the columns move.
    assert!((0.6..0.95).contains(&lag1), "effective lag-1 {lag1}");
}

#[test]
fn ordinary_intervals_cover_under_coloured_noise() {
    assert_coverage(false);
}

#[test]
fn weighted_intervals_cover_under_coloured_noise() {
    assert_coverage(true);
}

#[test]
fn too_short_segments_show_correlated_scores() {
    let segment_correlation = |settings| {
        let problem = simulated(&mut Random::new(5), settings);
        let estimate = ordinary_least_squares(&problem, &OrdinarySettings::default()).unwrap();
        estimate.segment_correlation.iter().sum::<f64>() / 2.0
    };
    // Sums of AR(1) noise over neighbouring segments of L samples correlate by ρ(1−ρ^L)² / (L(1−ρ²) − 2ρ(1−ρ^L)) for
    // columns that are constant over the segments: 0.05 for L = 100, 0.59 for L = 8. One log of 64 segments and four
    // columns has a sampling error of 1/√(64·4) = 0.06; tolerance 3 σ.
    let long = segment_correlation(SegmentSettings::default());
    let short = segment_correlation(SegmentSettings { max_segments: 1024, first_length_rows: 8 });
    assert!(long.abs() < 0.25, "{long}");
    assert!(short > 0.4, "{short}");
}
