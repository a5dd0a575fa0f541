//! The default cut-off compared with the best possible one, as a table: robots × motions × noise.
//!
//! ```text
//! cargo run --release -p dynident-benchmark --example cutoffs -- [RUNS] [ROWS] [simultaneous]
//! ```

#![allow(clippy::print_stdout, reason = "printing a table is what this program is for")]

use dynident_benchmark::cutoffs::{CUTOFF_CELLS, cutoff_figures};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let runs: u64 = std::env::args().nth(1).map_or(Ok(8), |text| text.parse())?;
    let rows: usize = std::env::args().nth(2).map_or(Ok(CUTOFF_CELLS.len()), |text| text.parse())?;
    let simultaneous = std::env::args().nth(3).is_some_and(|text| text == "simultaneous");
    println!(
        "| robot | harmonics | length, s | rate, Hz | position noise, rad | spectrum asks for, Hz | its error, % | default, % | best, % | at, times | default over best | motion and parameters at once, % |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for cell in CUTOFF_CELLS.iter().take(rows) {
        let figures = cutoff_figures(cell, runs, simultaneous)?;
        let at_once = figures.simultaneous.map_or_else(
            || "-".to_owned(),
            |(error, unsettled)| format!("{:.2} ({unsettled} unsettled)", 100.0 * error),
        );
        println!(
            "| {} | {} | {} | {} | {:.0e} | {:.1} | {:.2} | {:.2} | {:.2} | {:.1} | {:.2} | {at_once} |",
            cell.robot.name,
            cell.log.harmonics,
            cell.log.duration_s,
            cell.log.rate_hz,
            cell.log.position_noise_rad,
            figures.spectrum_hz,
            100.0 * figures.of_spectrum,
            100.0 * figures.of_default,
            100.0 * figures.best,
            figures.best_multiple,
            figures.default_over_best()
        );
    }
    Ok(())
}
