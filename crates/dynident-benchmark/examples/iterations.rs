//! Results of the iteration under noise: every example's robot over many seeds, with the error of its parameters in
//! units of the Cramér-Rao bound, tracking, and runs.
//!
//! ```text
//! cargo run --release -p dynident-benchmark --example iterations -- [SEEDS] [STUDY.toml ..]
//! ```
//!
//! The trajectory is designed once. Every seed has its own noise and, if the robot differs from its description, its
//! own robot.

#![allow(clippy::print_stdout, reason = "printing a table is what this program is for")]

use core::fmt::Write;
use core::ops::ControlFlow;
use dynident::{IterationWatch, IterationsFile, RunOptions, Silent, Study, design_study, iterate_study};
use std::error::Error;
use std::path::{Path, PathBuf};

const STUDIES: [&str; 4] = [
    "examples/iterate_paper_2r_noise.toml",
    "examples/iterate_planar_3r.toml",
    "examples/iterate_ur10.toml",
    "examples/iterate_panda.toml",
];

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let seeds: u64 = arguments.next().map_or(Ok(40), |text| text.parse())?;
    let mut studies: Vec<PathBuf> = arguments.map(PathBuf::from).collect();
    if studies.is_empty() {
        studies = STUDIES.iter().map(PathBuf::from).collect();
    }
    println!(
        "| study | seeds | converged | runs | tracking, first run, rad | last run | better by at least | error over bound, last run | worst seed |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for path in studies {
        println!("{}", row(&path, seeds)?);
    }
    Ok(())
}

fn largest(errors: &[f64]) -> f64 {
    errors.iter().fold(0.0, |most, error| most.max(*error))
}

fn row(path: &Path, seeds: u64) -> Result<String, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let options = RunOptions { data: None, threads: 2, progress: &Silent };
    let mut study = Study::load(path)?;
    let section = study.iteration.clone().unwrap_or_default();
    let rate_hz = study.simulation.clone().unwrap_or_default().rate_hz;
    if section.trajectory.is_none() {
        let found = design_study(&study, path, &options, |_| ControlFlow::Continue(()))?;
        let (times, motion) = found.sampled(rate_hz);
        let mut table = String::from("t_s");
        for name in ["q", "dq", "ddq"] {
            (1..=motion.joints).try_for_each(|joint| write!(table, ",{name}{joint}"))?;
        }
        for (sample, time) in times.iter().enumerate() {
            write!(table, "\n{time}")?;
            for values in [&motion.q, &motion.dq, &motion.ddq] {
                (0..motion.joints)
                    .try_for_each(|joint| write!(table, ",{}", values[joint * motion.samples + sample]))?;
            }
        }
        let trajectory = folder.path().join("trajectory.csv");
        std::fs::write(&trajectory, table + "\n")?;
        study.iteration.get_or_insert_default().trajectory = Some(trajectory);
    }
    let mut files: Vec<IterationsFile> = Vec::new();
    for seed in 1..=seeds {
        let simulation = study.simulation.get_or_insert_default();
        (simulation.seed, simulation.sensors.seed) = (seed, seed);
        let out = folder.path().join(format!("seed_{seed}"));
        let mut hear = |_: &_, _: &[_]| {};
        let mut watch = IterationWatch::new(&|_| ControlFlow::Continue(()), &mut hear);
        files.push(iterate_study(&study, path, &out, false, &options, &mut watch)?);
        std::fs::remove_dir_all(&out)?;
    }
    let converged = files.iter().filter(|file| file.converged).count();
    let runs: Vec<usize> = files.iter().map(|file| file.runs.len()).collect();
    let tracking = |last: bool| {
        let of = |file: &IterationsFile| {
            if last { file.runs.last() } else { file.runs.first() }
                .map_or(f64::NAN, |run| largest(&run.max_tracking_error_rad))
        };
        files.iter().map(of).fold(0.0, f64::max)
    };
    let improvement = files.iter().filter_map(|file| file.tracking_improvement).fold(f64::INFINITY, f64::min);
    let ratios: Vec<f64> = files.iter().filter_map(|file| file.error_over_bound).collect();
    let square = ratios.iter().map(|ratio| ratio * ratio).sum::<f64>() / ratios.len() as f64;
    // Sampling error from the spread of the seeds' mean squares, because parameters of one run are correlated.
    let variance =
        ratios.iter().map(|ratio| (ratio * ratio - square).powi(2)).sum::<f64>() / (ratios.len().max(2) - 1) as f64;
    let bar = (variance / ratios.len() as f64).sqrt() / (2.0 * square.sqrt());
    Ok(format!(
        "| {} | {seeds} | {converged} | {} to {} | {:.2e} | {:.2e} | {improvement:.0} | {:.2} ± {bar:.2} | {:.2} |",
        path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
        runs.iter().min().unwrap_or(&0),
        runs.iter().max().unwrap_or(&0),
        tracking(false),
        tracking(true),
        square.sqrt(),
        ratios.iter().fold(0.0_f64, |most, ratio| most.max(*ratio)),
    ))
}
