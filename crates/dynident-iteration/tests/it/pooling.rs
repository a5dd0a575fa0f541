use crate::simulated_arm::{Simulated, described, iterated, settings};
use dynident_dynamics::ParametricModel;
use dynident_iteration::{IterationSettings, RunEstimate};
use dynident_simulation::SensorSettings;

/// Settings for four runs without convergence.
fn four_runs() -> IterationSettings {
    let mut settings = settings();
    settings.settled.parameter_sigmas = 0.0;
    settings.settled.parameter_tolerance = 0.0;
    settings.max_runs = 4;
    settings
}

/// Geometric mean of the error bars of the determined parameters.
fn bars(estimate: &RunEstimate) -> f64 {
    let own = estimate.std.iter().filter(|std| **std > 0.0);
    (own.clone().map(|std| std.ln()).sum::<f64>() / own.count() as f64).exp()
}

fn errors_in_bars(estimate: &RunEstimate, truth: &[f64]) -> Vec<f64> {
    let pairs = estimate.values.iter().zip(truth).zip(&estimate.std);
    pairs.filter(|(_, std)| **std > 0.0).map(|((value, truth), std)| (value - truth) / std).collect()
}

/// Error bars after k runs are at most 1.1/√k of those of the first, and they are valid: over seeds the errors are 0.8
/// to 1.2 of them, and 93 to 97 % are inside 95 % intervals. The tolerances for a few seeds are wider; errors of one
/// seed are correlated, so a seed counts like four independent numbers.
#[test]
fn bars_narrow_with_every_run_and_hold() {
    let described: ParametricModel = described();
    let (mut square, mut inside, mut count) = (0.0, 0.0, 0.0);
    let seeds = dynident_testing::count(5, 100);
    for seed in 1..=seeds as u64 {
        let sensors = SensorSettings { seed, ..Simulated::default().sensors };
        let simulated = Simulated { sensors, ..Simulated::default() };
        let (_, outcome) = iterated(&simulated, four_runs());
        assert!(outcome.runs.len() == 4 && outcome.runs.iter().all(|run| run.accepted));
        let first = bars(outcome.runs[0].estimate.as_ref().unwrap());
        for (k, run) in (2..).zip(&outcome.runs[1..]) {
            let ratio = bars(run.pooled.as_ref().unwrap()) / first;
            assert!(ratio <= 1.1 / f64::from(k).sqrt(), "seed {seed}, {k} runs: {ratio}");
        }
        let errors = errors_in_bars(outcome.runs[3].pooled.as_ref().unwrap(), &simulated.truth(&described));
        square += errors.iter().map(|error| error * error).sum::<f64>();
        // Half a 95 % interval of Student's distribution; segments have about twenty degrees of freedom.
        inside += errors.iter().filter(|error| error.abs() <= 2.05).count() as f64;
        count += errors.len() as f64;
    }
    let (rms, inside) = ((square / count).sqrt(), 100.0 * inside / count);
    println!("error over bar {rms:.3}, inside {inside:.1} % of {count}");
    // Two standard deviations of a root mean square, and of a share of 5 %, with four numbers per seed.
    let numbers = 4.0 * seeds as f64;
    let leeway = 2.0 / (2.0 * numbers).sqrt();
    assert!(rms >= 0.8 - leeway && rms <= 1.2 + leeway, "{rms}");
    assert!((inside - 95.0).abs() <= 2.0 + 2.0 * 100.0 * (0.05 * 0.95 / numbers).sqrt(), "{inside}");
}

#[test]
fn runs_may_stand_alone() {
    let mut settings = four_runs();
    settings.pool = false;
    settings.max_runs = 2;
    let (_, outcome) = iterated(&Simulated::default(), settings);
    assert!(outcome.runs.iter().all(|run| run.pooled.is_none()));
}
