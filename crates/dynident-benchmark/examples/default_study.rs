//! A study of files and columns alone against the best with the truth in hand, plain least squares and each estimator
//! by name: robots × motions × friction × noise × lag.
//!
//! ```text
//! cargo run --release -p dynident-benchmark --example default_study -- --runs 4 --out DIR
//! ```
//!
//! The table goes to the screen, line by line, then what was to be reached; `DIR/default.csv` has all figures.
//! `--quick` is one run of the cheapest cases.

#![allow(clippy::print_stdout, reason = "printing a table is what this program is for")]

use clap::Parser;
use dynident_benchmark::default_study::{
    DEFAULT_CASES, TABLE_HEADER, case_figures, csv_header, csv_line, goals, table_line,
};
use std::error::Error;
use std::path::PathBuf;

/// Sets what `identify` does without keys against what can be done with the truth in hand.
#[derive(Parser)]
struct Options {
    /// Recordings of each case.
    #[arg(long, default_value_t = 2)]
    runs: u64,
    /// Number of the first: others than those of the book tell whether what was chosen on these holds.
    #[arg(long, default_value_t = 0)]
    first: u64,
    /// Only cases whose line of numbers and words holds this text.
    #[arg(long, default_value = "")]
    only: String,
    /// Threads; figures are the same for any number.
    #[arg(long, default_value_t = 1)]
    threads: usize,
    /// Leave the estimators by name out.
    #[arg(long)]
    without_names: bool,
    /// One recording of the three cheapest cases.
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
