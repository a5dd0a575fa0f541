//! Formatting of words and numbers within a given width.

use comfy_table::{CellAlignment, Table, presets};
use std::collections::BTreeSet;

pub(super) const WIDTH: usize = 80;

/// Maximum length of the name of a joint or body in a table.
const MAX_NAME_COLUMNS: usize = 24;

/// Wraps `words` at [`WIDTH`] columns; all lines but the first are indented by `indent` blanks. Longer words are not
/// split, and no-break spaces become plain spaces without a line break.
pub(super) fn wrapped(words: &str, indent: usize) -> String {
    let (mut text, mut column) = (String::new(), 0);
    let lead = words.len() - words.trim_start().len();
    text.push_str(&words[..lead]);
    column += lead;
    for (index, word) in words.split([' ', '\n']).filter(|word| !word.is_empty()).enumerate() {
        let length = word.chars().count();
        if index > 0 && column + 1 + length > WIDTH {
            text.push('\n');
            text.push_str(&" ".repeat(indent));
            column = indent;
        } else if index > 0 {
            text.push(' ');
            column += 1;
        }
        text.push_str(word);
        column += length;
    }
    text.push('\n');
    text.replace('\u{a0}', " ")
}

/// The line that names the codes of findings and the command that explains them; empty without codes.
pub(super) fn explained<'a>(codes: impl Iterator<Item = &'a str>) -> String {
    let codes: BTreeSet<&str> = codes.filter(|code| !code.is_empty()).collect();
    let codes: Vec<&str> = codes.into_iter().collect();
    if codes.is_empty() {
        return String::new();
    }
    wrapped(&format!("  help: dynident docs CODE explains {}", codes.join(", ")), 4)
}

/// A table without ruled lines: names left-aligned, numbers right-aligned, no trailing blanks.
pub(super) fn table(header: &[String], numbers: core::ops::Range<usize>, rows: Vec<Vec<String>>) -> String {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(header);
    table.add_rows(rows);
    for index in 0..header.len() {
        let Some(column) = table.column_mut(index) else { continue };
        column.set_padding((0, 2));
        if numbers.contains(&index) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let lines: Vec<String> = table.to_string().lines().map(|line| format!("  {}", line.trim_end())).collect();
    lines.join("\n") + "\n"
}

pub(super) fn name(name: &str) -> String {
    end_of_name(name, MAX_NAME_COLUMNS)
}

/// A name shortened to at most `columns` columns. Its end is kept, because the end distinguishes joints.
pub(super) fn end_of_name(name: &str, columns: usize) -> String {
    let length = name.chars().count();
    if length <= columns {
        return name.to_owned();
    }
    format!("..{}", name.chars().skip(length - columns + 2).collect::<String>())
}

pub(super) fn percent(value: Option<f64>) -> String {
    match value {
        Some(value) if value >= 1000.0 => format!("{value:.0}"),
        Some(value) => format!("{value:.2}"),
        None => "-".to_owned(),
    }
}

/// A value and its standard deviation, both to the second significant digit of the deviation.
pub(super) fn with_deviation(value: f64, std: f64) -> [String; 2] {
    if !(std.is_finite() && std > 0.0) {
        return [format!("{value:.5}"), "-".to_owned()];
    }
    let decimals = 1.0 - std.log10().floor();
    if decimals > 7.0 {
        return [format!("{value:.3e}"), format!("{std:.1e}")];
    }
    let decimals = decimals.max(0.0) as usize;
    [format!("{value:.decimals$}"), format!("{std:.decimals$}")]
}

/// A sum shortened to at most `longest` columns: its first terms, and the number of all terms.
pub(super) fn shortened(expression: &str, longest: usize) -> String {
    if expression.len() <= longest {
        return expression.to_owned();
    }
    let terms = expression.matches(" + ").count() + expression.matches(" - ").count() + 1;
    let tail = format!(" .. ({terms} terms)");
    let room = longest.saturating_sub(tail.len());
    let ends = expression.match_indices(" + ").chain(expression.match_indices(" - ")).map(|(at, _)| at);
    let cut = ends.filter(|&at| at <= room).max().unwrap_or(0);
    format!("{}{tail}", &expression[..cut])
}

/// A list of names such as `a, b, c and 4 more`, with at most `most` names.
pub(super) fn listed(names: &[&str], most: usize) -> String {
    let shown = names[..names.len().min(most)].join(", ");
    if names.len() > most { format!("{shown} and {} more", names.len() - most) } else { shown }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_stay_within_the_width() {
        let text = wrapped(&format!("  {}", "several words of a sentence ".repeat(12)), 4);
        assert!(text.lines().count() > 3 && text.lines().all(|line| line.chars().count() <= WIDTH), "{text}");
        assert!(text.starts_with("  several") && text.lines().skip(1).all(|line| line.starts_with("    ")), "{text}");
    }

    #[test]
    fn values_have_the_digits_that_are_known() {
        assert_eq!(with_deviation(3.48444, 0.0078), ["3.4844", "0.0078"]);
        assert_eq!(with_deviation(1234.5, 120.0), ["1234", "120"]);
        assert_eq!(with_deviation(1.0, 0.0), ["1.00000", "-"]);
        assert_eq!(with_deviation(1.5e-9, 2e-10), ["1.500e-9", "2.0e-10"]);
    }

    #[test]
    fn long_sums_are_cut_between_terms() {
        assert_eq!(shortened("Izz1 + m2", 20), "Izz1 + m2");
        assert_eq!(shortened("Izz1 + 0.5 m2 + 0.5 m3 + 0.5 m4", 30), "Izz1 + 0.5 m2 .. (4 terms)");
        assert!(shortened(&"abc + ".repeat(40), 44).len() <= 44);
    }
}
