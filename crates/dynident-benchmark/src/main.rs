//! Times dynamics, triangular factors from samples, a step of an excitation design, a step of the closed loop and
//! reading text; measures machine limits. Prints one JSON line per result, with the same lines,
//! states and method as the programs in `benchmarks/`, which `benchmarks/compare.sh` compares.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "printing figures is what this program is for")]

mod speed;

use clap::Parser;
use dynident_lanes::Level;
use dynident_model::load_robot;
use std::path::PathBuf;
use std::process::ExitCode;

/// Times Dynident on robots and prints JSON lines. Compare only results of the same run, and use the minima.
#[derive(Parser)]
#[command(version)]
struct Options {
    /// Folder of the robots' URDF files.
    #[arg(long, default_value = "robots")]
    robots: PathBuf,
    /// Only this processor level (portable, AVX2, AVX-512); default: all levels of this processor.
    #[arg(long)]
    level: Option<String>,
    /// Samples in a batch. Use an odd multiple of eight, so that the columns of a batch do not map to the same cache
    /// sets.
    #[arg(long, default_value_t = 72, value_parser = clap::value_parser!(u16).range(1..=512))]
    block: u16,
    /// Also measure machine limits: processor peak, memory, text.
    #[arg(long)]
    limits: bool,
    /// Text file for --limits: a recording of the Panda arm, created if missing.
    #[arg(long, default_value = "target/benchmark.csv")]
    csv: PathBuf,
    /// Rows of the recording if it has to be created.
    #[arg(long, default_value_t = 100_000, value_parser = clap::value_parser!(u32).range(1..=100_000_000))]
    csv_rows: u32,
    /// Measure only these quantities; with --limits also peak_flops, memory and text.
    #[arg(long, value_delimiter = ',')]
    only: Vec<String>,
    /// Names of the robots.
    #[arg(default_values_t = ["planar2r", "ur10", "panda_arm7", "iiwa14", "talos_reduced"].map(String::from))]
    names: Vec<String>,
}

/// Name of the robot whose recording is read as text.
const RECORDED: &str = "panda_arm7";

fn main() -> ExitCode {
    let options = Options::parse();
    // The clock measures only this thread, so all work must run on it.
    if let Err(error) = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global() {
        eprintln!("{error}");
        return ExitCode::FAILURE;
    }
    let available = Level::available();
    let asked = |level: &Level| options.level.as_ref().is_none_or(|name| name.eq_ignore_ascii_case(level.name()));
    let levels: Vec<Level> = available.iter().copied().filter(asked).collect();
    if levels.is_empty() {
        let names: Vec<&str> = available.iter().map(|level| level.name()).collect();
        eprintln!("unknown --level {}: use one of {}", options.level.unwrap_or_default(), names.join(", "));
        return ExitCode::from(2);
    }
    println!("{}", speed::environment(&available));
    let model = |name: &str| load_robot(options.robots.join(format!("{name}.urdf"))).map(|robot| robot.model);
    if options.limits {
        let measured = model(RECORDED).map_err(|error| error.to_string()).and_then(|model| {
            let (csv, rows) = (options.csv.as_path(), options.csv_rows as usize);
            speed::time_machine(RECORDED, &model, &levels, csv, rows, &options.only)
        });
        if let Err(error) = measured {
            eprintln!("{error}");
            return ExitCode::FAILURE;
        }
    }
    for name in &options.names {
        let model = match model(name) {
            Ok(model) => model,
            Err(error) => {
                eprintln!("{error}");
                return ExitCode::from(2);
            }
        };
        if let Err(error) = speed::time_robot(name, &model, &levels, usize::from(options.block), &options.only) {
            eprintln!("{error}");
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}
