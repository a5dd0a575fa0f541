//! Automatically selected friction compared with the true laws, as a table: robots × motions × friction laws.
//!
//! ```text
//! cargo run --release -p dynident-benchmark --example friction -- [RUNS] [ROWS]
//! ```

#![allow(clippy::print_stdout, reason = "printing a table is what this program is for")]

use dynident_benchmark::friction_truths::{friction_cells, friction_figures};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let runs: u64 = std::env::args().nth(1).map_or(Ok(8), |text| text.parse())?;
    let rows: usize = std::env::args().nth(2).map_or(Ok(usize::MAX), |text| text.parse())?;
    println!(
        "| robot | length, s | rate, Hz | position noise, rad | friction | true term chosen | chosen, % | true terms stated, % | plain, % | chosen over true |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for cell in friction_cells().iter().take(rows) {
        let figures = friction_figures(cell, runs)?;
        println!(
            "| {} | {} | {} | {:.0e} | {} | {} of {} | {:.2} | {:.2} | {:.2} | {:.2} |",
            cell.robot.name,
            cell.log.duration_s,
            cell.log.rate_hz,
            cell.log.position_noise_rad,
            cell.truth.name(),
            figures.told,
            figures.tellable,
            100.0 * figures.of_choice,
            100.0 * figures.of_truth,
            100.0 * figures.of_plain,
            figures.of_choice / figures.of_truth
        );
    }
    Ok(())
}
