//! Times Dynident's dynamics, its way from samples to triangular factors, a step of an excitation design and one of the
//! closed loop, and prints one JSON line a figure: the same lines, states and method as the programs in `benchmarks/`,
//! which `benchmarks/compare.sh` sets side by side.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "printing figures is what this program is for")]

mod speed;

use clap::Parser;
use dynident_lanes::Level;
use dynident_model::load_robot;
use std::path::PathBuf;
use std::process::ExitCode;

/// Times Dynident on robots and prints JSON lines. Compare figures of one run only, and read the minima.
#[derive(Parser)]
#[command(version)]
struct Options {
    /// Folder of the robots' URDF files.
    #[arg(long, default_value = "robots")]
    robots: PathBuf,
    /// Only this processor level (portable, AVX2, AVX-512); all that this processor has unless given.
    #[arg(long)]
    level: Option<String>,
    /// Samples in a batch. Best is an odd multiple of eight: the columns of a panel then do not fall on the same few
    /// cache sets.
    #[arg(long, default_value_t = 72, value_parser = clap::value_parser!(u16).range(1..=512))]
    block: u16,
    /// Only these quantities.
    #[arg(long, value_delimiter = ',')]
    only: Vec<String>,
    /// Robots by name.
    #[arg(default_values_t = ["planar2r", "ur10", "panda_arm7", "iiwa14", "talos_reduced"].map(String::from))]
    names: Vec<String>,
}

fn main() -> ExitCode {
    let options = Options::parse();
    let available = Level::available();
    let levels: Vec<Level> = available
        .iter()
        .copied()
        .filter(|level| options.level.as_ref().is_none_or(|name| name.eq_ignore_ascii_case(level.name())))
        .collect();
    if levels.is_empty() {
        let names: Vec<&str> = available.iter().map(|level| level.name()).collect();
        eprintln!("--level {}: this processor has {}", options.level.unwrap_or_default(), names.join(", "));
        return ExitCode::from(2);
    }
    println!("{}", speed::environment(&available));
    for name in &options.names {
        let model = match load_robot(options.robots.join(format!("{name}.urdf"))) {
            Ok(robot) => robot.model,
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
