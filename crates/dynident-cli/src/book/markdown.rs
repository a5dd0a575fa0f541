//! Converts the Markdown of the documentation pages to text for the terminal or a pipe.

use comfy_table::{ContentArrangement, Table, presets};
use core::fmt::Write;

/// Smallest width of the text, columns.
const MIN_WIDTH: usize = 40;

/// A page as text of `width` columns: wrapped paragraphs and tables, indented code, and a list of the pages that it
/// refers to. Headings are bold if `is_styled`.
pub(crate) fn rendered(text: &str, width: usize, is_styled: bool) -> String {
    let width = width.max(MIN_WIDTH);
    let mut out = String::new();
    let mut lines = text.lines().peekable();
    let mut is_code = false;
    while let Some(line) = lines.next() {
        if line.trim_start().starts_with("```") {
            is_code = !is_code;
        } else if is_code {
            let _ = writeln!(out, "    {line}");
        } else if line.starts_with("{{#include") || line.starts_with("<!--") {
            // Of the pages on paper.
        } else if line.starts_with('#') {
            out += &heading(line, is_styled);
        } else if line.starts_with('|') {
            let mut rows = vec![cells(line)];
            while let Some(row) = lines.next_if(|line| line.starts_with('|')) {
                rows.push(cells(row));
            }
            out += &table(&rows, width);
        } else {
            out += &wrapped(line, width);
        }
    }
    let mut linked: Vec<&str> = text.split("](").skip(1).filter_map(linked_page).collect();
    linked.sort_unstable();
    linked.dedup();
    if !linked.is_empty() {
        out += "\n";
        out += &wrapped(&format!("Pages mentioned here (dynident docs PAGE): {}", linked.join(", ")), width);
    }
    out
}

fn heading(line: &str, is_styled: bool) -> String {
    let level = line.len() - line.trim_start_matches('#').len();
    let title = inline(line.trim_start_matches('#').trim());
    let rule = match level {
        1 => "=",
        2 => "-",
        _ => "",
    };
    if is_styled {
        return format!("\u{1b}[1m{title}\u{1b}[0m\n");
    }
    let rule = rule.repeat(title.chars().count());
    if rule.is_empty() { format!("{title}\n") } else { format!("{title}\n{rule}\n") }
}

/// Name of the page in the target of a link; `target` may continue after the closing bracket.
fn linked_page(target: &str) -> Option<&str> {
    let file = target.split(')').next()?.split('#').next()?;
    file.strip_suffix(".md").filter(|name| !name.contains('/'))
}

/// The cells of a table row; `\|` does not end a cell.
pub(super) fn cells(row: &str) -> Vec<&str> {
    let row = row.trim().trim_start_matches('|');
    let row = row.strip_suffix('|').unwrap_or(row);
    let (mut cells, mut start, mut before) = (Vec::new(), 0, ' ');
    for (at, letter) in row.char_indices() {
        if letter == '|' && before != '\\' {
            cells.push(row[start..at].trim());
            start = at + 1;
        }
        before = letter;
    }
    cells.push(row[start..].trim());
    cells
}

fn table(rows: &[Vec<&str>], width: usize) -> String {
    let texts = |row: &Vec<&str>| row.iter().map(|cell| inline(cell)).collect::<Vec<_>>();
    let is_rule =
        |row: &&Vec<&str>| row.iter().all(|cell| !cell.is_empty() && cell.trim_matches(['-', ':']).is_empty());
    let mut table = Table::new();
    table.load_style(presets::UTF8_HORIZONTAL_ONLY).set_content_arrangement(ContentArrangement::Dynamic);
    table.set_width(u16::try_from(width).unwrap_or(u16::MAX));
    if let Some(header) = rows.first() {
        table.set_header(texts(header));
    }
    table.add_rows(rows.iter().skip(1).filter(|row| !is_rule(row)).map(texts));
    let lines: Vec<String> = table.to_string().lines().map(|line| line.trim_end().to_owned()).collect();
    lines.join("\n") + "\n"
}

/// Text of a line without Markdown marks: links become their text, pictures their description, bold text becomes
/// plain.
pub(crate) fn inline(text: &str) -> String {
    let mut plain = String::new();
    let mut rest = text;
    while let Some(at) = rest.find(['[', '!', '`', '*', '\\']) {
        plain += &rest[..at];
        let here = &rest[at..];
        let (shown, behind) = if let Some((words, behind)) = link(here) {
            (inline(words), behind)
        } else if let Some((code, behind)) = code(here) {
            (code, behind)
        } else if let Some(behind) = here.strip_prefix("**") {
            (String::new(), behind)
        } else if let Some(behind) = here.strip_prefix("\\|") {
            ("|".to_owned(), behind)
        } else {
            (here[..1].to_owned(), &here[1..])
        };
        plain += &shown;
        rest = behind;
    }
    plain + rest
}

/// Text of a link or description of a picture at the beginning of `text`, and the text that follows it.
fn link(text: &str) -> Option<(&str, &str)> {
    let inner = text.strip_prefix("![").or_else(|| text.strip_prefix('['))?;
    let (words, behind) = inner.split_once("](")?;
    let mut depth = 0;
    let is_closed_before = words.chars().any(|letter| {
        depth += i32::from(letter == '[') - i32::from(letter == ']');
        depth < 0
    });
    let (_, behind) = behind.split_once(')').filter(|_| !is_closed_before)?;
    Some((words, behind))
}

/// Code at the beginning of `text` with its backquotes, and the text that follows it. Double backquotes are removed.
fn code(text: &str) -> Option<(String, &str)> {
    let (mark, inner) = match text.strip_prefix("``") {
        Some(inner) => ("``", inner),
        None => ("`", text.strip_prefix('`')?),
    };
    let (code, behind) = inner.split_once(mark)?;
    let code = code.replace("\\|", "|");
    Some((if mark.len() == 2 { code.trim().to_owned() } else { format!("`{code}`") }, behind))
}

/// A line of text, wrapped; further lines of a list entry are indented.
pub(crate) fn wrapped(line: &str, width: usize) -> String {
    let lead = line.len() - line.trim_start().len();
    let entry = line.trim_start();
    let number = entry.trim_start_matches(|c: char| c.is_ascii_digit());
    let mark = match number.strip_prefix(". ") {
        Some(_) if number.len() < entry.len() => entry.len() - number.len() + 2,
        _ if entry.starts_with("- ") || entry.starts_with("* ") || entry.starts_with("> ") => 2,
        _ => 0,
    };
    let mut text = " ".repeat(lead);
    let mut column = lead;
    for (index, word) in inline(entry).split_whitespace().enumerate() {
        let length = word.chars().count();
        if index > 0 && column + 1 + length > width {
            let indent = lead + mark;
            let _ = write!(text, "\n{}", " ".repeat(indent));
            column = indent;
        } else if index > 0 {
            text.push(' ');
            column += 1;
        }
        text += word;
        column += length;
    }
    text.push('\n');
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_removed() {
        let text = "see **the** [study *file*](study.md#a), `a | b`, `` x `y` `` and ![a picture](a.svg); q[0] * 2, [`[[x]]`](b.md)";
        assert_eq!(inline(text), "see the study *file*, `a | b`, x `y` and a picture; q[0] * 2, `[[x]]`");
        assert_eq!(cells(r"| a \| b | `c` |  |"), [r"a \| b", "`c`", ""]);
    }

    #[test]
    fn pages_keep_the_width() {
        let words = "several words of a sentence ".repeat(12);
        let page = format!(
            "# Title\n\n{words}\n\n1. {words}\n\n| a | b |\n| --- | --- |\n| {words} | {words} |\n\n```text\ncode\n```\n\nSee [x](friction.md).\n"
        );
        let plain = rendered(&page, 60, false);
        assert!(plain.starts_with("Title\n=====\n\nseveral words"), "{plain}");
        assert!(plain.lines().all(|line| line.chars().count() <= 60), "{plain}");
        assert!(plain.contains("\n1. several") && plain.contains("\n   several"), "{plain}");
        assert!(plain.contains("\n    code\n") && plain.ends_with("(dynident docs PAGE): friction\n"), "{plain}");
        assert!(!plain.contains("---|") && !plain.contains('\u{1b}'), "{plain}");
        assert!(rendered(&page, 60, true).starts_with("\u{1b}[1mTitle\u{1b}[0m\n"));
    }
}
