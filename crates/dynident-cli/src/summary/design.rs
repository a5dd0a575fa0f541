use super::text::{name, percent, shortened, table, wrapped};
use core::fmt::Write;
use dynident::DesignFile;
use dynident::result::WindowedFile;
use std::path::Path;

/// Maximum number of limits and of parameters shown; the file contains all.
const MAX_SHOWN: usize = 5;
/// Columns available for the expression of a base parameter.
const EXPRESSION_COLUMNS: usize = 40;

pub(crate) fn design(d: &DesignFile, out: &Path, files: &[&str]) -> String {
    let mut text = wrapped(&d.name, 2);
    let _ = writeln!(
        text,
        "{} joints, {} base columns, {}, {} s, {}\n",
        d.joints.len(),
        d.base_columns,
        d.family,
        d.duration_s,
        d.criterion
    );
    if let Some(given) = &d.given {
        text += &wrapped(&format!("checked: {given}"), 2);
        text += &wrapped(&format!("limits on {}", d.check_of), 2);
        text.push('\n');
    }
    let number = |value: Option<f64>, digits: usize| value.map_or("-".to_owned(), |value| format!("{value:.digits$}"));
    let _ = writeln!(
        text,
        "condition number {} ({} with scaled columns), log det {}",
        number(d.condition_number, 2),
        number(d.condition_number_scaled, 2),
        number(d.log_det, 1)
    );
    if let Some(windowed) = &d.windowed {
        text.push('\n');
        text += &strokes(windowed);
        text.push('\n');
    }
    let khz = format!("{:.4}", d.check_rate_hz / 1000.0);
    let khz = khz.trim_end_matches('0').trim_end_matches('.');
    if d.feasible {
        let _ = writeln!(text, "feasible: every limit is kept, checked at {khz} kHz");
        text += &items("NOT checked:", &d.not_checked);
        text += &items("assumed:", &d.assumed);
        text.push('\n');
    } else {
        let _ = writeln!(text, "NOT FEASIBLE, checked at {khz} kHz:");
        for sentence in &d.diagnosis {
            text += &wrapped(&format!("  {sentence}"), 4);
        }
        text += &items("assumed:", &d.assumed);
        text.push('\n');
    }
    text += &limits(d);
    text.push('\n');
    text += &forecast(d);
    for note in &d.notes {
        text += &wrapped(&format!("note: {note}"), 2);
    }
    if d.given.is_none() {
        let stopped = if d.stopped { "; stopped before its end" } else { "" };
        let _ = writeln!(text, "\n{} evaluations in {:.2} s, seed {}{stopped}", d.evaluations, d.seconds, d.seed);
    }
    text += &wrapped(&format!("wrote {}, {}", out.join("design.json").display(), files.join(", ")), 2);
    text
}

/// A heading with one line for each item; empty without items.
fn items(heading: &str, items: &[String]) -> String {
    if items.is_empty() {
        return String::new();
    }
    let lines = items.iter().map(|item| wrapped(&format!("  {item}"), 4));
    core::iter::once(format!("{heading}\n")).chain(lines).collect()
}

/// The strokes of a windowed design, compared with the optimum.
fn strokes(w: &WindowedFile) -> String {
    let rows = w.strokes.iter().map(|stroke| {
        let numbers = [
            stroke.amplitude_rad,
            stroke.steepness_per_s,
            stroke.offset_rad,
            stroke.period_s,
            stroke.window_s,
            stroke.condition_number,
        ];
        core::iter::once(name(&stroke.joint)).chain(numbers.map(|number| format!("{number:.3}"))).collect()
    });
    let head = ["stroke of", "A rad", "w 1/s", "h rad", "T s", "delta s", "condition"];
    let mut text = table(&head.map(str::to_owned), 1..7, rows.collect());
    let _ = writeln!(text, "H {:.3} by {}, condition numbers alone {:.3}", w.fitness, w.optimiser, w.condition_sum);
    match w.optimum.zip(w.above_optimum_percent) {
        Some((optimum, above)) => {
            let _ = writeln!(text, "optimum inside the limits {optimum:.3}: {above:+.2} % from it");
        }
        None => text.push_str("no strokes inside the limits were found\n"),
    }
    text
}

fn limits(d: &DesignFile) -> String {
    let mut used: Vec<_> = d.limits.iter().collect();
    used.sort_by(|a, b| b.worst_ratio.total_cmp(&a.worst_ratio));
    let rows = used.iter().take(MAX_SHOWN).map(|limit| {
        let part = format!("{:.2}", 100.0 * limit.worst_ratio);
        vec![limit.kind.to_string(), name(&limit.joint), part, format!("{:.3}", limit.at_s)]
    });
    table(&["limit", "of", "used %", "at s"].map(str::to_owned), 2..4, rows.collect())
}

/// The parameters with the smallest and largest error bars, relative if there is a prior.
fn forecast(d: &DesignFile) -> String {
    let dark: Vec<&str> = d.forecast.iter().filter(|p| p.std.is_none()).map(|p| p.symbol.as_str()).collect();
    let mut known: Vec<_> = d.forecast.iter().filter(|p| p.std.is_some()).collect();
    // Parameters with a prior of zero have no relative error.
    if known.iter().any(|p| p.relative_std_percent.is_some()) {
        known.retain(|p| p.relative_std_percent.is_some());
    }
    known.sort_by(|a, b| {
        let key = |p: &dynident::result::ParameterForecast| p.relative_std_percent.unwrap_or(f64::INFINITY);
        key(a).total_cmp(&key(b))
    });
    let with_prior = d.forecast.iter().any(|p| p.std_with_prior.is_some());
    let row = |p: &&dynident::result::ParameterForecast| {
        let short = |std: Option<f64>| std.map_or("-".to_owned(), |std| format!("{std:.2e}"));
        let std = short(p.std);
        let prior = p.prior.map_or("-".to_owned(), |prior| format!("{prior:.4}"));
        let mut row = vec![shortened(&p.expression, EXPRESSION_COLUMNS), prior, std, percent(p.relative_std_percent)];
        if with_prior {
            row[0] = shortened(&p.expression, EXPRESSION_COLUMNS - 12);
            row.push(short(p.std_with_prior));
        }
        row
    };
    let ends = known.len().min(MAX_SHOWN / 2);
    let rows: Vec<_> =
        known[..ends].iter().chain(&known[ends.max(known.len().saturating_sub(MAX_SHOWN - ends))..]).map(row).collect();
    let mut text = String::from("forecast, best and worst known:\n");
    let heads = ["parameter", "prior", "std", "std %", "with prior"].map(str::to_owned);
    let columns = if with_prior { 5 } else { 4 };
    text += &table(&heads[..columns], 1..columns, rows);
    if !dark.is_empty() {
        text += &wrapped(&format!("  not excited: {}", dark.join(", ")), 4);
    }
    text
}
