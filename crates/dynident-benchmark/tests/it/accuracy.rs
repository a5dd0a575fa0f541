//! The Monte Carlo benchmark: seeds, threads, and known results.

use dynident_benchmark::accuracy::{BenchmarkError, BenchmarkFile, BenchmarkSettings, benchmark};
use dynident_benchmark::cutoffs::{CUTOFF_CELLS, cutoff_figures};
use dynident_benchmark::friction_truths::{FrictionTruth, friction_cells, friction_figures};
use dynident_identification::Silent;

fn settings() -> BenchmarkSettings {
    let one = |name: &str| vec![name.to_owned()];
    BenchmarkSettings {
        robots: one("planar2r"),
        noise: one("standard"),
        estimators: ["weighted", "weighted-true-motion", "simultaneous"].map(str::to_owned).to_vec(),
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
fn figures_are_identical_for_any_number_of_threads() -> Result<(), Box<dyn std::error::Error>> {
    assert_eq!(made(1)?, made(3)?);
    Ok(())
}

/// No unbiased estimator is better than the bound: with the true motion, 12 runs and at least 12 parameters the RMS
/// over the bound has a sampling error of about 1/√(2·12·12) = 6 % for independent errors; lower limit 3 σ. Upper
/// limit: decimation to the motion's band costs at most half.
#[test]
fn true_motion_nearly_reaches_the_bound() -> Result<(), Box<dyn std::error::Error>> {
    let file = made(2)?;
    let oracle = file.cells.iter().find(|cell| cell.estimator == "weighted-true-motion").ok_or("no such cell")?;
    assert_eq!((oracle.runs, oracle.failures), (12, 0));
    let ratio = oracle.rmse_over_bound.ok_or("no figure")?;
    assert!((0.82..1.5).contains(&ratio), "{ratio}");
    Ok(())
}

/// With unknown motion the simultaneous fit reaches its bound, which is above that of known motion. Sampling error as
/// above; the coverage of its 12 · 16 intervals has a standard deviation of 1.6 % for independent parameters, twice
/// that here; lower limit 3 σ.
#[test]
fn the_simultaneous_fit_reaches_the_bound_with_the_motion_unknown() -> Result<(), Box<dyn std::error::Error>> {
    let file = made(2)?;
    let cell = file.cells.iter().find(|cell| cell.estimator == "simultaneous").ok_or("no such cell")?;
    assert_eq!((cell.runs, cell.failures), (12, 0));
    assert!(cell.parameters.iter().all(|p| p.bound_with_motion >= p.bound));
    let ratio = cell.rmse_over_bound_with_motion.ok_or("no figure")?;
    assert!((0.82..1.2).contains(&ratio), "{ratio}");
    let covered = cell.coverage_percent.ok_or("no figure")?;
    assert!(covered > 85.0, "{covered}");
    Ok(())
}

#[test]
fn unknown_names_and_no_runs_are_reported() {
    let wrong = BenchmarkSettings { estimators: vec!["best".to_owned()], ..settings() };
    let message = benchmark(&wrong, &Silent).map(|_| ()).map_err(|error| error.to_string());
    assert!(message.is_err_and(|message| message.contains("--estimators best") && message.contains("weighted")));
    let none = BenchmarkSettings { runs: 0, ..settings() };
    assert!(matches!(none.validate(), Err(BenchmarkError::Runs { runs: 0 })));
}

/// The cut-off is selected by its effect on the parameters, not by the motion's power: a slow motion with low encoder
/// noise needs a higher one than the spectrum suggests, and the default uses it. With two runs the limits are wider
/// than 1.15.
#[test]
fn slow_motion_gets_the_cutoff_of_its_parameters() -> Result<(), Box<dyn std::error::Error>> {
    let slow = CUTOFF_CELLS.iter().find(|cell| cell.robot.name == "Panda" && cell.log.position_noise_rad == 1e-4);
    let figures = cutoff_figures(slow.ok_or("no such cell")?, 2, false)?;
    assert!(figures.default_over_best() < 1.3, "{figures:?}");
    assert!(figures.of_default < 0.85 * figures.of_spectrum, "{figures:?}");
    Ok(())
}

/// Direction-dependent friction is found, with constants between grid points: the error is at most twice that with the
/// true terms and constants, on a motion where viscous and Coulomb friction have over ten times that error.
#[test]
fn selected_friction_is_nearly_as_good_as_known_friction() -> Result<(), Box<dyn std::error::Error>> {
    let cells = friction_cells();
    let cell = cells.iter().find(|cell| cell.truth == FrictionTruth::Asymmetric).ok_or("no such cell")?;
    let figures = friction_figures(cell, 1)?;
    assert_eq!((figures.told, figures.tellable), (6, 6));
    assert!(figures.of_choice < 2.0 * figures.of_truth && figures.of_plain > 10.0 * figures.of_truth, "{figures:?}");
    Ok(())
}
