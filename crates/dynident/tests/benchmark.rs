//! The Monte Carlo benchmark: seeds, threads, and figures that are what they must be.

use dynident::Silent;
use dynident::benchmark::{BenchmarkError, BenchmarkFile, BenchmarkSettings, benchmark};

fn settings() -> BenchmarkSettings {
    let one = |name: &str| vec![name.to_owned()];
    BenchmarkSettings {
        robots: one("planar2r"),
        noise: one("standard"),
        estimators: vec!["weighted".to_owned(), "weighted-true-motion".to_owned()],
        runs: 12,
        seed: 3,
    }
}

fn made(threads: usize) -> Result<BenchmarkFile, Box<dyn std::error::Error>> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    let mut file = pool.install(|| benchmark(&settings(), &Silent))?;
    file.cells.iter_mut().for_each(|cell| cell.time_ms = 0.0);
    Ok(file)
}

#[test]
fn the_same_for_any_number_of_threads() -> Result<(), Box<dyn std::error::Error>> {
    assert_eq!(made(1)?, made(3)?);
    Ok(())
}

/// No unbiased estimator beats the bound: with the true motion, 12 runs and 12 or more parameters the root mean square over the bound has a sampling error of about 1/√(2·12·12) = 6 % if
/// errors were independent; three of these, below. Above, decimation to the motion's band costs no more than half.
#[test]
fn the_bound_is_a_bound_and_nearly_reached() -> Result<(), Box<dyn std::error::Error>> {
    let file = made(2)?;
    let oracle = file.cells.iter().find(|cell| cell.estimator == "weighted-true-motion").ok_or("no such cell")?;
    assert_eq!((oracle.runs, oracle.failures), (12, 0));
    let ratio = oracle.rmse_over_bound.ok_or("no figure")?;
    assert!((0.82..1.5).contains(&ratio), "{ratio}");
    Ok(())
}

#[test]
fn unknown_names_and_no_runs_are_told() {
    let wrong = BenchmarkSettings { estimators: vec!["best".to_owned()], ..settings() };
    let message = benchmark(&wrong, &Silent).map(|_| ()).map_err(|error| error.to_string());
    assert!(message.is_err_and(|message| message.contains("--estimators best") && message.contains("weighted")));
    let none = BenchmarkSettings { runs: 0, ..settings() };
    assert!(matches!(none.validate(), Err(BenchmarkError::Runs { runs: 0 })));
}
