//! Reads text tables (CSV and similar): detects delimiter and header, parses rows of numbers.

use super::columns::column_label;
use super::format::Header;
use super::lines::Lines;
use super::plain_row::{plain_decimal, read_plain_row};
use super::source::LogTable;
use crate::error::RecordingError;
use crate::place::LogPlace;
use std::io::Read;
use std::path::Path;

#[derive(Debug)]
pub(super) struct TextTable {
    label: String,
    lines: Lines,
    delimiter: u8,
    names: Option<Vec<String>>,
    width: usize,
    first_row_is_pending: bool,
    wanted: Vec<usize>,
    /// For each field, its index among the requested fields; empty if the delimiter is blanks.
    places: Vec<Option<usize>>,
    fields: Vec<(usize, usize)>,
    rows: u64,
    truncated_line: Option<u64>,
}

impl TextTable {
    pub(super) fn open(
        path: &Path,
        text: Box<dyn Read + Send>,
        header: Header,
        delimiter: Option<char>,
    ) -> Result<Self, RecordingError> {
        let label = path.display().to_string();
        let mut lines = Lines::new(path, text);
        if !lines.advance()? {
            return Err(RecordingError::NoRows { place: LogPlace::Line { log: label, line: lines.number() } });
        }
        let first = lines.line();
        if first.contains(&0) {
            return Err(RecordingError::Binary { file: path.to_owned(), line: lines.number() });
        }
        if first.contains(&b'\r') {
            return Err(RecordingError::CarriageReturns { file: path.to_owned(), line: lines.number() });
        }
        let delimiter = delimiter.map_or_else(|| guessed_delimiter(first), |delimiter| delimiter as u8);
        let mut fields = Vec::new();
        split(first, delimiter, &mut fields);
        let has_header = match header {
            Header::Present => true,
            Header::Absent => false,
            Header::Auto => !fields.iter().all(|(from, to)| number(&first[*from..*to]).is_some()),
        };
        let names = has_header.then(|| {
            fields.iter().map(|(from, to)| String::from_utf8_lossy(&first[*from..*to]).into_owned()).collect()
        });
        Ok(Self {
            label,
            delimiter,
            names,
            width: fields.len(),
            first_row_is_pending: !has_header,
            wanted: Vec::new(),
            places: Vec::new(),
            fields,
            rows: 0,
            truncated_line: None,
            lines,
        })
    }

    fn place_of_line(&self, line: u64) -> LogPlace {
        LogPlace::Line { log: self.label.clone(), line }
    }

    fn not_a_number(&self, field: usize) -> RecordingError {
        let text = self.shown(field);
        let comma = text.contains(',') && text.bytes().all(|b| b.is_ascii_digit() || matches!(b, b',' | b'-' | b'+'));
        let first_row = self.rows == 0;
        RecordingError::NotANumber {
            place: self.place(),
            column: column_label(self.names.as_deref(), field),
            text,
            fix: if comma {
                "write decimal points instead of decimal commas"
            } else if first_row {
                "fix the field; if this line is a header, set header = true"
            } else {
                "fix the field or delete the line"
            },
        }
    }

    fn shown(&self, field: usize) -> String {
        let mut fields = Vec::new();
        split(self.lines.line(), self.delimiter, &mut fields);
        let (from, to) = fields[field];
        let text = String::from_utf8_lossy(&self.lines.line()[from..to]);
        let mut short: String = text.chars().take(40).flat_map(char::escape_debug).collect();
        if text.chars().nth(40).is_some() {
            short.push_str("..");
        }
        short
    }
}

impl LogTable for TextTable {
    fn width(&self) -> usize {
        self.width
    }

    fn names(&self) -> Option<&[String]> {
        self.names.as_deref()
    }

    fn select(&mut self, fields: &[usize]) {
        self.wanted = fields.to_vec();
        let place = |field| fields.iter().position(|wanted| *wanted == field);
        self.places = if self.delimiter == b' ' { Vec::new() } else { (0..self.width).map(place).collect() };
    }

    fn skip_row(&mut self) -> Result<bool, RecordingError> {
        let found = core::mem::take(&mut self.first_row_is_pending) || self.lines.advance()?;
        self.rows += u64::from(found);
        Ok(found)
    }

    fn next_row(&mut self, values: &mut [f64]) -> Result<bool, RecordingError> {
        if !(core::mem::take(&mut self.first_row_is_pending) || self.lines.advance()?) {
            return Ok(false);
        }
        if !self.places.is_empty() && read_plain_row(self.lines.line(), self.delimiter, &self.places, values) {
            self.rows += 1;
            return Ok(true);
        }
        split(self.lines.line(), self.delimiter, &mut self.fields);
        if self.fields.len() != self.width {
            if self.fields.len() < self.width && self.rows > 0 && self.lines.at_end()? {
                self.truncated_line = Some(self.lines.number());
                return Ok(false);
            }
            return Err(RecordingError::RaggedRow {
                place: self.place(),
                expected: self.width,
                found: self.fields.len(),
                hint: if self.delimiter == b',' && self.fields.len() == 2 * self.width {
                    " (decimal commas? write decimal points)"
                } else {
                    ""
                },
            });
        }
        let line = self.lines.line();
        for (value, &field) in values.iter_mut().zip(&self.wanted) {
            let (from, to) = self.fields[field];
            *value = match number(&line[from..to]) {
                Some(value) => value,
                None if from == to => f64::NAN,
                None if !self.lines.complete() && self.rows > 0 => {
                    self.truncated_line = Some(self.lines.number());
                    return Ok(false);
                }
                None => return Err(self.not_a_number(field)),
            };
        }
        self.rows += 1;
        Ok(true)
    }

    fn place(&self) -> LogPlace {
        self.place_of_line(self.lines.number())
    }

    fn field_text(&self, field: usize) -> Option<String> {
        Some(self.shown(field))
    }

    fn truncated(&self) -> Option<LogPlace> {
        self.truncated_line.map(|line| self.place_of_line(line))
    }
}

fn guessed_delimiter(line: &[u8]) -> u8 {
    // Tabs and semicolons first, because their files may have decimal commas.
    for delimiter in *b"\t;," {
        if line.contains(&delimiter) {
            return delimiter;
        }
    }
    b' '
}

/// Splits `line` into trimmed, unquoted fields, as byte ranges.
fn split(line: &[u8], delimiter: u8, fields: &mut Vec<(usize, usize)>) {
    fields.clear();
    if delimiter == b' ' {
        let mut at = 0;
        while let Some(skip) = line[at..].iter().position(|byte| !byte.is_ascii_whitespace()) {
            let from = at + skip;
            let length = line[from..].iter().position(u8::is_ascii_whitespace).unwrap_or(line.len() - from);
            fields.push(trimmed(line, from, from + length));
            at = from + length;
        }
        return;
    }
    let quotes = line.contains(&b'"');
    let (mut from, mut quoted) = (0, false);
    for (at, byte) in line.iter().enumerate() {
        if quotes && *byte == b'"' {
            quoted = !quoted;
        } else if *byte == delimiter && !quoted {
            fields.push(trimmed(line, from, at));
            from = at + 1;
        }
    }
    fields.push(trimmed(line, from, line.len()));
}

/// The range without outer blanks and one pair of quotes.
fn trimmed(line: &[u8], mut from: usize, mut to: usize) -> (usize, usize) {
    while from < to && line[from].is_ascii_whitespace() {
        from += 1;
    }
    while from < to && line[to - 1].is_ascii_whitespace() {
        to -= 1;
    }
    if to - from >= 2 && line[from] == b'"' && line[to - 1] == b'"' {
        return (from + 1, to - 1);
    }
    (from, to)
}

/// A number in the syntax of the standard library, including `nan` and `inf`.
fn number(field: &[u8]) -> Option<f64> {
    match plain_decimal(field) {
        Some((value, length)) if length == field.len() => Some(value),
        _ => core::str::from_utf8(field).ok()?.parse().ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fields(line: &str, delimiter: u8) -> Vec<String> {
        let mut ranges = Vec::new();
        split(line.as_bytes(), delimiter, &mut ranges);
        ranges.into_iter().map(|(from, to)| line[from..to].to_owned()).collect()
    }

    #[test]
    fn fields_are_split_trimmed_and_unquoted() {
        assert_eq!(fields("a, \"b,c\" ,,d", b','), ["a", "b,c", "", "d"]);
        assert_eq!(fields("  1 \t 2  3 ", b' '), ["1", "2", "3"]);
        assert_eq!(fields("1;2,5;", b';'), ["1", "2,5", ""]);
    }

    #[test]
    fn numbers_are_read_as_the_standard_library_does() {
        assert_eq!(number(b"-0").map(f64::is_sign_negative), Some(true));
        assert_eq!([number(b"1e5"), number(b"+1"), number(b"1.5")], [Some(1e5), Some(1.0), Some(1.5)]);
        assert_eq!([number(b""), number(b"1..2"), number(b"1,5")], [None; 3]);
    }
}
