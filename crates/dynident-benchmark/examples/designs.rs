//! Compares families and criteria of excitation design with equal limits and processor time. Prints the table of the
//! book's page on designs.
//!
//! Time is the processor time of this process on one core. Designs of a small budget are repeated with the next seed
//! until the time is used up; the table shows the best.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "printing a table is what this program is for")]

use clap::Parser;
use core::ops::ControlFlow;
use dynident::excitation::limits::AssumedLimits;
use dynident::study::{CriterionChoice, FamilyChoice, OptimiserChoice};
use dynident::{DesignFile, RunOptions, Study, design_study};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Designs of every family and criterion with equal limits and processor time.
#[derive(Parser)]
#[command(version)]
struct Options {
    /// Processor seconds for each.
    #[arg(long, default_value_t = 10.0)]
    seconds: f64,
    /// Only families whose name contains one of these.
    #[arg(long, value_delimiter = ',')]
    families: Vec<String>,
    /// Only these criteria.
    #[arg(long, value_delimiter = ',')]
    criteria: Vec<String>,
    /// Random starts of one design.
    #[arg(long, default_value_t = 4)]
    starts: usize,
    /// Rounds of restarts around the best of one design.
    #[arg(long, default_value_t = 0)]
    rounds: usize,
    /// Studies with the limits.
    #[arg(default_values_t = ["ur10", "panda", "iiwa14"].map(|robot| format!("examples/design_{robot}.toml")))]
    studies: Vec<String>,
}

/// Families by the name in the table, with their study keys.
const FAMILIES: [(&str, &str); 9] = [
    ("Fourier, 5 harmonics", r#"kind = "fourier""#),
    ("Fourier, 10 harmonics", "kind = \"fourier\"\nharmonics = 10"),
    ("multisine, 10 harmonics", "kind = \"multisine\"\nharmonics = 10"),
    ("quintics, 9 waypoints", "kind = \"quintic\"\nway_points = 9"),
    ("B-spline, 40 points", "kind = \"b-spline\"\ncontrol_points = 40"),
    ("B-spline, 60 points", "kind = \"b-spline\"\ncontrol_points = 60"),
    ("logistic strokes, 6 overlapping", r#"kind = "logistic-strokes""#),
    ("logistic strokes, 4 spliced", "kind = \"logistic-strokes\"\nstrokes = 4\norder = \"spliced\""),
    ("the paper's spliced logistic", "kind = \"spliced-logistic\"\nperiod_times_omega = 46"),
];

const CRITERIA: [(&str, CriterionChoice); 3] = [
    ("d-optimal", CriterionChoice::DOptimal),
    ("a-optimal", CriterionChoice::AOptimal),
    ("condition-number", CriterionChoice::ConditionNumber),
];

fn main() -> ExitCode {
    let options = Options::parse();
    println!(
        "| robot | family | criterion | condition number | log det | trace of D⁻¹ · 10³ | designs | evaluations | s |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    let pool = match rayon::ThreadPoolBuilder::new().num_threads(1).build() {
        Ok(pool) => pool,
        Err(error) => {
            eprintln!("{error}");
            return ExitCode::FAILURE;
        }
    };
    for path in &options.studies {
        for (name, family) in FAMILIES.iter().filter(|(name, _)| wanted(&options.families, name)) {
            for (criterion, choice) in CRITERIA.iter().filter(|(name, _)| wanted(&options.criteria, name)) {
                match pool.install(|| best(Path::new(path), family, choice, &options)) {
                    Ok(line) => println!("| {} | {name} | {criterion} | {line} |", robot(path)),
                    Err(error) => {
                        eprintln!("{path}, {name}: {error}");
                        return ExitCode::FAILURE;
                    }
                }
            }
        }
    }
    ExitCode::SUCCESS
}

fn wanted(only: &[String], name: &str) -> bool {
    only.is_empty() || only.iter().any(|part| name.contains(part.as_str()))
}

fn robot(path: &str) -> String {
    let stem = PathBuf::from(path).file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    stem.trim_start_matches("design_").replace('_', ", ")
}

/// Repeats designs until the time is used up; results of the best.
fn best(path: &Path, family: &str, choice: &CriterionChoice, options: &Options) -> Result<String, String> {
    let mut study = Study::load(path).map_err(|error| error.to_string())?;
    let section = study.design.get_or_insert_default();
    section.family = toml::from_str::<FamilyChoice>(family).map_err(|error| error.to_string())?;
    section.criterion = choice.clone();
    section.optimiser = OptimiserChoice::Gradient;
    section.search.starts = Some(options.starts);
    section.search.rounds = Some(options.rounds);
    // Only the limits listed on the page of the table.
    section.defaults = AssumedLimits::none();
    let run = RunOptions { data: None, threads: 1, progress: &dynident::Silent };
    let begun = clock();
    let (mut found, mut evaluations, mut designs): (Option<DesignFile>, usize, u64) = (None, 0, 0);
    while designs == 0 || clock() - begun < options.seconds {
        designs += 1;
        study.design.get_or_insert_default().search.seed = designs;
        // The clock ends a design early, with its best result.
        let left = options.seconds - (clock() - begun);
        let limit = clock() + left.max(0.05 * options.seconds);
        let watch = |_: &_| if clock() > limit { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        let file = design_study(&study, path, &run, watch).map_err(|error| error.to_string())?.file;
        evaluations += file.evaluations;
        let figure = |file: &DesignFile| file.criterion_figure.filter(|_| file.feasible).unwrap_or(f64::INFINITY);
        if found.as_ref().is_none_or(|found| figure(&file) < figure(found)) {
            found = Some(file);
        }
    }
    let spent = clock() - begun;
    let Some(file) = found.filter(|file| file.feasible) else {
        return Ok(format!("none inside the limits | | | {designs} | {evaluations} | {spent:.1}"));
    };
    let number = |value: Option<f64>, digits: usize| value.map_or("-".to_owned(), |value| format!("{value:.digits$}"));
    // Error bars are for the study's torque noise, here 1 Nm.
    let trace: Option<f64> = file.forecast.iter().map(|parameter| parameter.std.map(|std| std * std)).sum();
    Ok(format!(
        "{} | {} | {} | {designs} | {evaluations} | {spent:.1}",
        number(file.condition_number, 2),
        number(file.log_det, 1),
        number(trace.map(|trace| 1e3 * trace), 2)
    ))
}

fn clock() -> f64 {
    #[cfg(unix)]
    {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
        time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
    }
    #[cfg(not(unix))]
    {
        use std::{sync::OnceLock, time::Instant};
        static START: OnceLock<Instant> = OnceLock::new();
        START.get_or_init(Instant::now).elapsed().as_secs_f64()
    }
}
