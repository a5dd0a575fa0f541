//! A study with files and columns only, compared with the best possible one, plain least squares and each estimator by
//! name: robots × motions × friction × noise × lag.
//!
//! ```text
//! cargo run --release -p dynident-benchmark --example default_study -- --runs 4 --out DIR
//! ```
//!
//! Prints the table line by line, then the goals; `DIR/default.csv` contains all results. `--quick` runs the fastest
//! cases once.

#![allow(clippy::print_stdout, reason = "printing a table is what this program is for")]

use clap::Parser;
use dynident_benchmark::default_study::{
    DEFAULT_CASES, TABLE_HEADER, case_figures, csv_header, csv_line, goals, table_line,
};
use std::error::Error;
use std::path::PathBuf;

/// Compares the defaults of `identify` with the best possible choices.
#[derive(Parser)]
struct Options {
    /// Recordings of each case.
    #[arg(long, default_value_t = 2)]
    runs: u64,
    /// Number of the first recording; other recordings than those of the book test the choices made on these.
    #[arg(long, default_value_t = 0)]
    first: u64,
    /// Only cases whose label contains this text.
    #[arg(long, default_value = "")]
    only: String,
    /// Threads; the results do not depend on their number.
    #[arg(long, default_value_t = 1)]
    threads: usize,
    /// Skip the estimators by name.
    #[arg(long)]
    without_names: bool,
    /// One recording of the three fastest cases.
    #[arg(long)]
    quick: bool,
    /// Folder for default.csv.
    #[arg(long)]
    out: Option<PathBuf>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let options = Options::parse();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(options.threads.max(1)).build()?;
    let runs = if options.quick { 1 } else { options.runs.max(1) };
    let most = if options.quick { 3 } else { usize::MAX };
    if let Some(out) = &options.out {
        std::fs::create_dir_all(out)?;
    }
    println!("{TABLE_HEADER}");
    let mut lines = csv_header() + "\n";
    let mut done = Vec::new();
    for case in DEFAULT_CASES.iter().filter(|case| case.label().contains(&options.only)).take(most) {
        let figures =
            pool.install(|| case_figures(case, options.first..options.first + runs, !options.without_names))?;
        println!("{}", table_line(case, &figures));
        lines += &(csv_line(case, &figures) + "\n");
        if let Some(out) = &options.out {
            std::fs::write(out.join("default.csv"), &lines)?;
        }
        done.push(figures);
    }
    println!();
    for goal in goals(&done) {
        println!("- {goal}");
    }
    Ok(())
}
