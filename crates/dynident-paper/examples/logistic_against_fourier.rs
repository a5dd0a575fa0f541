//! Compares logistic strokes with Fourier series: same arm, limits, time, controller and noise; parameter errors over
//! many noisy runs.
//!
//! ```text
//! cargo run --release -p dynident-paper --example logistic_against_fourier [SEEDS [SECONDS]]
//! ```
//!
//! SECONDS ends each search early, for a quick test instead of a comparison.

#![allow(clippy::print_stdout, reason = "printing a table is what this program is for")]

use core::ops::ControlFlow;
use dynident::{RunOptions, Silent, Study, design_study};
use dynident_dynamics::ParametricModel;
use dynident_iteration::{IterationTask, RunIdentificationSettings, identify_run};
use dynident_recording::{DecimationSettings, DifferentiatorSettings, ReferenceSettings};
use dynident_simulation::controllers::FiniteTimeSettings;
use dynident_simulation::{
    ControllerModel, ControllerSettings, Integrator, LoopSettings, Plant, Reference, SensorSettings, closed_loop,
};
use std::error::Error;
use std::path::Path;

const RATE_HZ: f64 = 1000.0;
/// Cut-off of the deviation's smoother and of the parallel filter, Hz; above the power of all motions here.
const CUTOFF_HZ: f64 = 6.0;
const DECIMATION: usize = 50;

/// Studies of the examples with the limits, and the duration (s).
const STUDIES: [(&str, &str, Option<f64>); 2] = [
    ("the paper's arm, limits (18), 40 s", "examples/design_paper.toml", Some(40.0)),
    ("UR10, 10 s", "examples/design_ur10.toml", None),
];

const FAMILIES: [(&str, &str); 4] = [
    ("Fourier, 5 harmonics", "kind = \"fourier\"\nharmonics = 5"),
    ("logistic strokes, 6 overlapping", "kind = \"logistic-strokes\""),
    ("logistic strokes, 4 spliced", "kind = \"logistic-strokes\"\nstrokes = 4\norder = \"spliced\""),
    ("the paper's spliced logistic", "kind = \"spliced-logistic\"\nperiod_times_omega = 40"),
];

fn main() -> Result<(), Box<dyn Error>> {
    let seeds: u64 = std::env::args().nth(1).map_or(Ok(100), |text| text.parse())?;
    let seconds: Option<f64> = std::env::args().nth(2).map(|text| text.parse()).transpose()?;
    println!("| arm | family | log det | error against Fourier | largest tracking error, rad |");
    println!("| --- | --- | --- | --- | --- |");
    for (arm, path, duration_s) in STUDIES {
        let mut first: Option<Vec<f64>> = None;
        for (name, family) in FAMILIES {
            match compared(Path::new(path), family, duration_s, seconds, seeds)? {
                None => println!("| {arm} | {name} | none inside the limits | | |"),
                Some(Outcome { log_det, errors, tracking }) => {
                    let reference = first.get_or_insert_with(|| errors.clone());
                    let logs: Vec<f64> = errors.iter().zip(&*reference).map(|(a, b)| (a / b).ln()).collect();
                    let mean = logs.iter().sum::<f64>() / logs.len() as f64;
                    // A root mean square of n runs has the relative error 1/√(2n), a quotient of two 1/√n. The
                    // parameters of one run are not independent, so the error is not divided further.
                    let bar = mean.exp() / (seeds as f64).sqrt();
                    println!("| {arm} | {name} | {log_det:.1} | {:.2} ± {bar:.2} | {tracking:.1e} |", mean.exp());
                }
            }
        }
    }
    Ok(())
}

struct Outcome {
    log_det: f64,
    /// Root mean square error of every base parameter over the seeds.
    errors: Vec<f64>,
    /// Largest tracking error, rad.
    tracking: f64,
}

/// Designs, runs and identifies; `None` without a motion inside the limits.
fn compared(
    path: &Path,
    family: &str,
    duration_s: Option<f64>,
    seconds: Option<f64>,
    seeds: u64,
) -> Result<Option<Outcome>, Box<dyn Error>> {
    let mut study = Study::load(path)?;
    let section = study.design.get_or_insert_default();
    section.family = toml::from_str(family)?;
    section.criterion = dynident::study::CriterionChoice::DOptimal;
    section.optimiser = dynident::study::OptimiserChoice::Gradient;
    if let Some(duration_s) = duration_s {
        section.duration_s = duration_s;
    }
    if seconds.is_some() {
        section.search.time_limit_s = seconds;
    }
    let options = RunOptions { data: None, threads: 2, progress: &Silent };
    let outcome = design_study(&study, path, &options, |_| ControlFlow::Continue(()))?;
    let (true, Some(log_det)) = (outcome.file.feasible, outcome.file.log_det) else { return Ok(None) };
    let reference = Reference::new(RATE_HZ, outcome.sampled(RATE_HZ).1)?;
    let model = outcome.robot.model();
    let robot = ParametricModel::new(model.clone(), Vec::new())?;
    let truth = robot.base().values(robot.nominal());
    let task = IterationTask::new(robot, reference.clone())?;
    let identification = RunIdentificationSettings {
        differentiator: DifferentiatorSettings::Deviation {
            reference: ReferenceSettings::default(),
            smoother: Box::new(DifferentiatorSettings::Butterworth { order: 4, cutoff_hz: Some(CUTOFF_HZ) }),
            max_lag_s: None,
        },
        parallel_filter: Some(DecimationSettings {
            factor: DECIMATION,
            cutoff_hz: Some(CUTOFF_HZ),
            ..DecimationSettings::default()
        }),
        consistency: None,
        ..RunIdentificationSettings::default()
    };
    let settings = ControllerSettings::FiniteTime(FiniteTimeSettings::with_gains(100.0, 20.0));
    let known = ControllerModel::new(model, &[], &[])?;
    let (mut squares, mut tracking) = (vec![0.0; truth.len()], 0.0_f64);
    for seed in 1..=seeds {
        let sensors = SensorSettings::birdy_standard(seed);
        let integrator = Integrator::Rk4 { steps_per_sample: 1 };
        let settings_of_loop = LoopSettings { integrator, sensors: sensors.clone(), ..LoopSettings::default() };
        let mut controller = settings.build(model.dof(), Some(&known))?;
        let run = closed_loop(&mut Plant::new(model, &[], &[])?, controller.as_mut(), &reference, &settings_of_loop)?;
        if !run.status.is_done() {
            return Err(format!("seed {seed}: {}", run.status).into());
        }
        tracking = run.max_error.iter().fold(tracking, |worst, error| worst.max(*error));
        let estimate = identify_run(&task, &[sensors.record(model, &run)?], &identification)?;
        for ((square, value), truth) in squares.iter_mut().zip(&estimate.values).zip(&truth) {
            *square += (value - truth).powi(2) / seeds as f64;
        }
    }
    Ok(Some(Outcome { log_det, errors: squares.into_iter().map(f64::sqrt).collect(), tracking }))
}
