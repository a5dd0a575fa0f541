use super::{Context, json, message_of, pretty_json};
use crate::{Verdict, summary, terminal};
use dynident::{OutputSet, check_writable};
use dynident_benchmark::accuracy::{BenchmarkSettings, benchmark, cells_csv};
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct Options {
    /// Robots, comma-separated; all by default.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    robots: Vec<String>,
    /// Noise levels, comma-separated; all by default.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    noise: Vec<String>,
    /// Estimators, comma-separated; all by default.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    estimators: Vec<String>,
    /// Runs of each robot at each noise level.
    #[arg(long, value_name = "N", default_value_t = 100)]
    runs: usize,
    /// Seed of excitation, noise and starts.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Folder for benchmark.csv and benchmark.json; without it the table is only printed.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    let all = BenchmarkSettings::default();
    let or_all = |given: &Vec<String>, all: Vec<String>| if given.is_empty() { all } else { given.clone() };
    let settings = BenchmarkSettings {
        robots: or_all(&options.robots, all.robots),
        noise: or_all(&options.noise, all.noise),
        estimators: or_all(&options.estimators, all.estimators),
        runs: options.runs,
        seed: options.seed,
    };
    settings.validate().map_err(|error| error.to_string())?;
    if let Some(out) = &options.out {
        check_writable(out).map_err(message_of)?;
    }
    let file = benchmark(&settings, &*context.progress()).map_err(|error| error.to_string())?;
    if let Some(out) = &options.out {
        let set = OutputSet::new(out).file("benchmark.json", pretty_json(&file)?);
        set.file("benchmark.csv", cells_csv(&file.cells)).write().map_err(message_of)?;
    }
    if context.json {
        terminal::print_document(&json(&file)?)?;
    } else if !context.quiet || options.out.is_none() {
        terminal::print(&summary::benchmark(&file))?;
    }
    Ok(Verdict::Good)
}
