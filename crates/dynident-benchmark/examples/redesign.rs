//! Benefit of redesigned motions: three runs along one motion compared with three of which two are redesigned, over
//! seeds of noise and robot.
//!
//! ```text
//! cargo run --release -p dynident-benchmark --example redesign -- [SEEDS] [STUDY.toml]
//! ```
//!
//! The result is the RMS of the ten widest axes of the parameters' ellipsoid from the covariance after each run,
//! measured by their torque error over random states within the limits, relative to the first run.

#![allow(clippy::print_stdout, reason = "printing a table is what this program is for")]

use core::ops::ControlFlow;
use dynident::iteration::{RedesignSettings, RunEstimate, RunRecord};
use dynident::study::MotionChoice;
use dynident::{IterationWatch, RunOptions, Silent, Study, design_study, iterate_study};
use dynident_excitation::{Information, Motion};
use dynident_model::sample::Random;
use nalgebra::DMatrix;
use std::error::Error;
use std::path::{Path, PathBuf};

const RUNS: usize = 3;
const STATES: usize = 5_000;
const WORST: usize = 10;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let seeds: u64 = arguments.next().map_or(Ok(5), |text| text.parse())?;
    let path = arguments.next().map_or_else(|| PathBuf::from("examples/iterate_ur10.toml"), PathBuf::from);
    let mut study = Study::load(&path)?;
    let section = study.iteration.get_or_insert_default();
    // A fixed number of runs.
    (section.max_runs, section.settled.parameter_sigmas, section.settled.parameter_tolerance) = (RUNS, 0.0, 0.0);
    let root = task_root(&study, &path)?;
    let mut sums = [[0.0; RUNS]; 2];
    println!("| seed | motion | second run | third run | worst bars were to narrow by, % | did by, % |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for seed in 1..=seeds {
        let simulation = study.simulation.get_or_insert_default();
        (simulation.seed, simulation.sensors.seed) = (seed, seed);
        for (sums, motion) in
            sums.iter_mut().zip([MotionChoice::Repeat, MotionChoice::Redesign(RedesignSettings::default())])
        {
            let name = if motion == MotionChoice::Repeat { "repeated" } else { "redesigned" };
            study.iteration.get_or_insert_default().motion = motion;
            let records = runs(&study, &path)?;
            let bars = |record: &RunRecord| record.knowledge().map_or(f64::NAN, |known| worst_bars(known, &root));
            let first = bars(&records[0]);
            let (mut expected, mut reached) = (Vec::new(), Vec::new());
            for (sum, record) in sums.iter_mut().zip(&records) {
                *sum += bars(record) / first;
                if let (Some(forecast), Some(known)) = (&record.forecast, record.knowledge()) {
                    expected.push(format!("{:.0}", forecast.gain_percent));
                    reached.extend(forecast.reached_gain_percent(known).map(|by| format!("{by:.0}")));
                }
            }
            let ratio = |run: usize| records.get(run).map_or(f64::NAN, |record| bars(record) / first);
            println!(
                "| {seed} | {name} | {:.3} | {:.3} | {} | {} |",
                ratio(1),
                ratio(2),
                expected.join(", "),
                reached.join(", ")
            );
        }
    }
    let [repeated, redesigned] = sums.map(|sums| sums.map(|sum| sum / seeds as f64));
    for run in 1..RUNS {
        let allowed = 1.1 / ((run + 1) as f64).sqrt();
        println!(
            "after {} runs: repeated {:.3} of the first (1.1/sqrt(k) is {allowed:.3}), redesigned {:.3}: {:.0} % below 1.1/sqrt(k), {:.0} % below the repeated",
            run + 1,
            repeated[run],
            redesigned[run],
            100.0 * (1.0 - redesigned[run] / allowed),
            100.0 * (1.0 - redesigned[run] / repeated[run])
        );
    }
    Ok(())
}

fn runs(study: &Study, path: &Path) -> Result<Vec<RunRecord>, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let options = RunOptions { data: None, threads: 2, progress: &Silent };
    let mut records = Vec::new();
    let mut hear = |record: &RunRecord, _: &[_]| records.push(record.clone());
    let mut watch = IterationWatch::new(&|_| ControlFlow::Continue(()), &mut hear);
    iterate_study(study, path, folder.path(), false, &options, &mut watch)?;
    Ok(records)
}

/// L of `M = L Lᵀ`, the mean information of a sample over random states within the study's limits.
fn task_root(study: &Study, path: &Path) -> Result<DMatrix<f64>, Box<dyn Error>> {
    let options = RunOptions { data: None, threads: 2, progress: &Silent };
    let found = design_study(study, path, &options, |_| ControlFlow::Continue(()))?;
    let (robot, joints) = (&found.robot, found.robot.model().joints());
    let mut random = Random::new(77);
    let mut states = Motion::default();
    states.reset(joints.len(), STATES);
    for (joint, description) in joints.iter().enumerate() {
        let limit = found.limits.of(&description.name).ok_or("a joint without limits")?;
        let [lower, upper] = limit.position.unwrap_or([-3.0, 3.0]);
        let pi = core::f64::consts::PI;
        for place in states.of(joint) {
            states.q[place] = random.uniform(lower.max(-pi), upper.min(pi));
            states.dq[place] = random.uniform(-1.0, 1.0) * limit.speed.ok_or("a joint without a limit of speed")?;
            states.ddq[place] = random.uniform(-1.0, 1.0) * limit.acceleration.ok_or("or of acceleration")?;
        }
    }
    let ones = vec![1.0; joints.len()];
    let needed = Information::new(robot.model(), robot.layout(), &ones, None).of(&states, 1.0 / STATES as f64);
    Ok(needed.cholesky().ok_or("states that do not excite every parameter")?.l())
}

fn worst_bars(known: &RunEstimate, root: &DMatrix<f64>) -> f64 {
    let count = known.covariance.len();
    let covariance = DMatrix::from_fn(count, count, |row, column| known.covariance[row][column]);
    let mut values: Vec<f64> =
        (root.tr_mul(&covariance) * root).symmetric_eigenvalues().iter().map(|value| value.max(0.0)).collect();
    values.sort_by(|a, b| b.total_cmp(a));
    values.iter().take(WORST).sum::<f64>().sqrt()
}
