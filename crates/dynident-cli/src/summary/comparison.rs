use super::text::{percent, table, wrapped};
use core::fmt::Write;
use dynident::explanation_words;
use dynident::result::ComparisonFile;

/// Maximum number of parameters shown; the file contains all.
const MAX_SHOWN: usize = 8;

pub(crate) fn comparison(c: &ComparisonFile) -> String {
    let mut text = String::new();
    for result in &c.results {
        let errors: Vec<String> =
            result.held_out.iter().map(|(log, error)| format!("{log} {} %", percent(*error))).collect();
        let held_out = if errors.is_empty() { "no held-out log".to_owned() } else { errors.join(", ") };
        text += &wrapped(&format!("{} ({}): torque error on held-out logs: {held_out}", result.name, result.file), 2);
    }
    for changes in &c.changes {
        let name = |index: usize| c.results.get(index).map_or("", |result| result.name.as_str());
        let from = changes.from.map_or("the robot description", name);
        text += &wrapped(&format!("\nwhat changed from {from} to {}:", name(changes.result)), 2);
        for explanation in &changes.explanations {
            let percent = format!("{:.0} %", 100.0 * explanation.probability);
            text += &wrapped(&format!("  {percent:>5}  {}", explanation_words(explanation)), 9);
        }
        let _ = writeln!(
            text,
            "  {} parameters together: chi squared {:.0}, p {:.2e} if nothing changed",
            changes.degrees_of_freedom, changes.chi_squared, changes.p_value
        );
    }
    if c.results.len() > 1 {
        let mut largest: Vec<_> = c.parameters.iter().collect();
        largest.sort_by(|a, b| b.largest_z.total_cmp(&a.largest_z));
        let rows = largest.iter().take(MAX_SHOWN).map(|own| {
            let values =
                own.values.iter().zip(&own.half_widths_95).map(|(value, bar)| format!("{value:.4} ± {bar:.4}"));
            let mut row = vec![own.symbol.clone()];
            row.extend(values);
            row.push(format!("{:.1}", own.largest_z));
            row
        });
        let columns = c.results.len() + 2;
        let header: Vec<String> = core::iter::once("parameter".to_owned())
            .chain(c.results.iter().map(|result| result.name.clone()))
            .chain(core::iter::once("std".to_owned()))
            .collect();
        text.push('\n');
        text += &table(&header, 1..columns, rows.collect());
    }
    for note in &c.notes {
        text += &wrapped(&format!("note: {note}"), 2);
    }
    text
}
