//! Local noise levels: nearly as accurate as known levels, and no loss for constant noise.

use crate::common::Random;
use dynident_estimation::{
    CovarianceMethod, EstimationError, LinearProblem, NoiseLevelSettings, RowBlock, SegmentSettings, SegmentedFactor,
    WeightedSettings, noise_weighted_least_squares, weighted_least_squares,
};

const ROWS: usize = 2000;
const TRUTH: [f64; 3] = [2.0, -1.0, 0.5];

/// Two joints with three columns; noise of joint 0 alternates every 250 rows, that of joint 1 is constant.
fn panels(random: &mut Random, quiet: f64, loud: f64) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
    let mut sigmas = Vec::new();
    let panels = (0..2)
        .map(|joint| {
            let sigma: Vec<f64> =
                (0..ROWS).map(|k| if joint == 0 && k / 250 % 2 == 1 { loud } else { quiet }).collect();
            let columns: Vec<f64> = (0..3 * ROWS).map(|_| random.normal()).collect();
            let tau = (0..ROWS)
                .map(|k| (0..3).map(|c| TRUTH[c] * columns[c * ROWS + k]).sum::<f64>() + sigma[k] * random.normal());
            let panel = columns.iter().copied().chain(tau.collect::<Vec<_>>()).collect();
            sigmas.push(sigma);
            panel
        })
        .collect();
    (panels, sigmas)
}

fn problem(panels: &[Vec<f64>]) -> LinearProblem {
    let names = ["a", "b", "c"].map(String::from).to_vec();
    let mut problem = LinearProblem::new(names, vec!["joint1".into(), "joint2".into()]);
    for (joint, panel) in panels.iter().enumerate() {
        let settings = SegmentSettings { max_segments: 16, first_length_rows: 125 };
        let mut rows = SegmentedFactor::new(3, settings).unwrap();
        rows.absorb(panel, ROWS).unwrap();
        problem.add("run", joint, vec![0, 1, 2], rows).unwrap();
    }
    problem
}

fn visited(panels: &[Vec<f64>], visit: &mut dynident_estimation::RowVisitor<'_>) -> Result<(), EstimationError> {
    for (joint, panel) in panels.iter().enumerate() {
        visit(&RowBlock { log: 0, joint, rows: ROWS, panel })?;
    }
    Ok(())
}

fn error(values: &[f64]) -> f64 {
    values.iter().zip(&TRUTH).map(|(value, truth)| (value - truth).powi(2)).sum()
}

#[test]
fn uneven_noise_costs_no_more_than_known_levels_would() {
    // Mean square errors over 30 draws. Only joint 0 has quiet rows of 0.2 among loud ones of 2 (within the contrast
    // of the default share): one σ per joint wastes them.
    let settings = NoiseLevelSettings { covariance: CovarianceMethod::White, ..NoiseLevelSettings::default() };
    let white = WeightedSettings { covariance: CovarianceMethod::White, ..WeightedSettings::default() };
    let (mut by_levels, mut known, mut weighted) = (0.0, 0.0, 0.0);
    let mut inside = 0;
    for seed in 0..30 {
        let (panels, sigmas) = panels(&mut Random::new(seed), 0.2, 2.0);
        let found =
            noise_weighted_least_squares(&problem(&panels), &settings, |visit| visited(&panels, visit)).unwrap();
        by_levels += error(&found.estimate.values);
        let bars = found.estimate.values.iter().zip(&found.estimate.half_width_95).zip(&TRUTH);
        inside += bars.filter(|((value, half), truth)| (*value - *truth).abs() <= **half).count();
        assert!(found.level_range[0][0] < 0.25 && found.level_range[0][1] > 1.3);
        weighted += error(&weighted_least_squares(&problem(&panels), &white).unwrap().values);
        let scaled: Vec<Vec<f64>> = panels
            .iter()
            .zip(&sigmas)
            .map(|(panel, sigma)| panel.iter().enumerate().map(|(k, value)| value / sigma[k % ROWS]).collect())
            .collect();
        known += error(&weighted_least_squares(&problem(&scaled), &white).unwrap().values);
    }
    // Levels known to 10 % cost one or two percent; the ends of the stretches (50 of 250 rows with a mixed level) at
    // most a fifth of joint 0's quiet half; sampling error of the ratio over 30 draws below 0.1.
    assert!(by_levels <= 1.3 * known, "{} of the known levels' error", by_levels / known);
    // Quiet thousand rows of joint 0, two thousand rows of joint 1: without levels a third of the information is lost.
    assert!(by_levels <= 0.9 * weighted, "{} of the weighted error", by_levels / weighted);
    // 90 intervals of 95 %: expected 85.5 with a standard deviation of 2.1; lower limit 3 σ and an allowance for the
    // uncertainty of the levels.
    assert!(inside >= 78, "{inside} of 90 inside");
}

#[test]
fn even_noise_gives_weighted_least_squares_within_a_fraction_of_an_error_bar() {
    let (panels, _) = panels(&mut Random::new(7), 0.3, 0.3);
    let found = noise_weighted_least_squares(&problem(&panels), &NoiseLevelSettings::default(), |visit| {
        visited(&panels, visit)
    })
    .unwrap();
    let plain = weighted_least_squares(&problem(&panels), &WeightedSettings::default()).unwrap();
    for (k, (value, std)) in plain.values.iter().zip(&plain.std).enumerate() {
        // Weights with a scatter of 10 % move an estimate by about a tenth of its error bar; tolerance three times
        // that.
        assert!((found.estimate.values[k] - value).abs() < 0.3 * std, "column {k}");
    }
    // Fully pooled it is weighted least squares, up to rounding and the stopping tolerance of the noise.
    let pooled = NoiseLevelSettings { pooled_share: 1.0, ..NoiseLevelSettings::default() };
    let same = noise_weighted_least_squares(&problem(&panels), &pooled, |visit| visited(&panels, visit)).unwrap();
    for (a, b) in same.estimate.values.iter().zip(&plain.values) {
        assert!((a - b).abs() < 1e-9);
    }
}

#[test]
fn other_rows_and_bad_settings_are_named() {
    let (panels, _) = panels(&mut Random::new(1), 0.3, 0.3);
    let problem = problem(&panels);
    let settings = NoiseLevelSettings::default();
    let short = noise_weighted_least_squares(&problem, &settings, |visit| {
        visit(&RowBlock { log: 0, joint: 0, rows: ROWS, panel: &panels[0] })
    });
    assert!(matches!(short, Err(EstimationError::Mismatch { expected: ROWS, found: 0, .. })));
    let twice = noise_weighted_least_squares(&problem, &settings, |visit| {
        visit(&RowBlock { log: 0, joint: 0, rows: ROWS, panel: &panels[0] })?;
        visit(&RowBlock { log: 0, joint: 0, rows: ROWS, panel: &panels[0] })
    });
    assert!(matches!(twice, Err(EstimationError::Mismatch { .. })));
    for (settings, name) in [
        (NoiseLevelSettings { window_rows: 2, ..settings.clone() }, "window_rows"),
        (NoiseLevelSettings { pooled_share: 0.0, ..settings.clone() }, "pooled_share"),
        (NoiseLevelSettings { tolerance: f64::NAN, ..settings.clone() }, "tolerance"),
        (NoiseLevelSettings { max_passes: 1, ..settings.clone() }, "max_passes"),
    ] {
        let error = settings.validate().unwrap_err();
        assert!(matches!(error, EstimationError::Setting { setting, .. } if setting == name));
    }
}
