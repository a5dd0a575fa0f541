use super::text::{table, wrapped};
use dynident_paper::PaperFile;
use std::path::Path;

pub(crate) fn reproduction(file: &PaperFile, out: &Path) -> String {
    let header = ["goal", "value", "at most", ""].map(str::to_owned);
    let rows = file
        .reached
        .iter()
        .map(|goal| {
            let number = |value: f64| if value.abs() < 1e-2 { format!("{value:.1e}") } else { format!("{value:.3}") };
            let verdict = if goal.met { "reached" } else { "missed" };
            vec![goal.what.clone(), number(goal.value), number(goal.goal), verdict.to_owned()]
        })
        .collect();
    let words = format!(
        "{} tables and {} figures in {:.1} s, {} deviations from the paper's text with their reasons: open {}",
        file.tables.len(),
        file.figures.len(),
        file.seconds,
        file.deviations.len(),
        out.join("report.html").display()
    );
    format!("{}{}", table(&header, 1..3, rows), wrapped(&words, 0))
}
