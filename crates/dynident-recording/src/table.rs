//! One text table: delimiter and header found out, rows of numbers read one by one.

use crate::error::RecordingError;
use crate::format::{ColumnRef, Header, LogFormat};
use crate::lines::Lines;
use std::path::Path;

/// What became of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Row {
    /// All wanted fields are finite numbers.
    Values,
    /// A wanted field is empty, NaN or infinite.
    Missing,
    /// The file has ended.
    End,
}

/// A wanted column and the place its value goes to.
#[derive(Debug)]
struct Wanted {
    field: usize,
    slot: usize,
}

#[derive(Debug)]
pub(crate) struct Table {
    lines: Lines,
    delimiter: u8,
    names: Option<Vec<String>>,
    width: usize,
    first_line: u64,
    first_row_is_pending: bool,
    wanted: Vec<Wanted>,
    fields: Vec<(usize, usize)>,
    rows: u64,
    truncated_line: Option<u64>,
}

impl Table {
    pub(crate) fn open(path: &Path, format: &LogFormat) -> Result<Self, RecordingError> {
        let mut lines = Lines::open(path)?;
        if !lines.advance()? {
            return Err(RecordingError::NoRows { file: path.to_owned(), line: lines.number() });
        }
        let first = lines.line();
        if first.contains(&0) {
            return Err(RecordingError::Binary { file: path.to_owned(), line: lines.number() });
        }
        if first.contains(&b'\r') {
            return Err(RecordingError::CarriageReturns { file: path.to_owned(), line: lines.number() });
        }
        let delimiter = format.delimiter.map_or_else(|| guessed_delimiter(first), |delimiter| delimiter as u8);
        let mut fields = Vec::new();
        split(first, delimiter, &mut fields);
        let has_header = match format.header {
            Header::Present => true,
            Header::Absent => false,
            Header::Auto => !fields.iter().all(|(from, to)| number(&first[*from..*to]).is_some()),
        };
        let names = has_header.then(|| {
            fields.iter().map(|(from, to)| String::from_utf8_lossy(&first[*from..*to]).into_owned()).collect()
        });
        Ok(Self {
            delimiter,
            names,
            width: fields.len(),
            first_line: lines.number(),
            first_row_is_pending: !has_header,
            wanted: Vec::new(),
            fields,
            rows: 0,
            truncated_line: None,
            lines,
        })
    }

    pub(crate) fn path(&self) -> &Path {
        self.lines.path()
    }

    /// Rows passed so far.
    pub(crate) fn rows(&self) -> u64 {
        self.rows
    }

    /// Line of a cut-off last row that was left out.
    pub(crate) fn truncated_line(&self) -> Option<u64> {
        self.truncated_line
    }

    /// Asks for `column`; its values appear at the returned place of every row.
    pub(crate) fn want(&mut self, key: &str, column: &ColumnRef) -> Result<usize, RecordingError> {
        let field = self.field(key, column)?;
        if let Some(known) = self.wanted.iter().find(|wanted| wanted.field == field) {
            return Ok(known.slot);
        }
        let slot = self.wanted.len();
        self.wanted.push(Wanted { field, slot });
        Ok(slot)
    }

    /// Number of distinct columns asked for.
    pub(crate) fn slots(&self) -> usize {
        self.wanted.len()
    }

    fn field(&self, key: &str, column: &ColumnRef) -> Result<usize, RecordingError> {
        let unknown = |wanted: String, hint: String| RecordingError::UnknownColumn {
            file: self.path().to_owned(),
            line: self.first_line,
            key: key.to_owned(),
            wanted,
            hint,
        };
        match column {
            ColumnRef::Index(index) if *index < self.width => Ok(*index),
            ColumnRef::Index(index) => {
                Err(unknown(index.to_string(), format!("there are {} columns, 0 to {}", self.width, self.width - 1)))
            }
            ColumnRef::Name(name) => {
                let Some(names) = &self.names else {
                    let hint = "the file has no header line: give 0-based indices, or set header = true";
                    return Err(unknown(name.clone(), hint.to_owned()));
                };
                let mut places = names.iter().enumerate().filter(|(_, n)| *n == name).map(|(index, _)| index);
                match (places.next(), places.next()) {
                    (Some(first), Some(second)) => Err(RecordingError::DuplicateColumn {
                        file: self.path().to_owned(),
                        line: self.first_line,
                        name: name.clone(),
                        first,
                        second,
                    }),
                    (Some(first), None) => Ok(first),
                    (None, _) => Err(unknown(name.clone(), existing_names(name, names))),
                }
            }
        }
    }

    /// Passes over one row unread; false at the end.
    pub(crate) fn skip_row(&mut self) -> Result<bool, RecordingError> {
        let found = core::mem::take(&mut self.first_row_is_pending) || self.lines.advance()?;
        self.rows += u64::from(found);
        Ok(found)
    }

    /// Reads one row; `values` gets one number for each slot.
    pub(crate) fn next_row(&mut self, values: &mut [f64]) -> Result<Row, RecordingError> {
        if !(core::mem::take(&mut self.first_row_is_pending) || self.lines.advance()?) {
            return Ok(Row::End);
        }
        split(self.lines.line(), self.delimiter, &mut self.fields);
        if self.fields.len() != self.width {
            if self.fields.len() < self.width && self.rows > 0 && self.lines.at_end()? {
                self.truncated_line = Some(self.lines.number());
                return Ok(Row::End);
            }
            return Err(RecordingError::RaggedRow {
                file: self.path().to_owned(),
                line: self.lines.number(),
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
        let mut row = Row::Values;
        for wanted in &self.wanted {
            let (from, to) = self.fields[wanted.field];
            match number(&line[from..to]) {
                Some(value) => {
                    values[wanted.slot] = value;
                    if !value.is_finite() {
                        row = Row::Missing;
                    }
                }
                None if from == to => {
                    values[wanted.slot] = f64::NAN;
                    row = Row::Missing;
                }
                None if !self.lines.complete() && self.rows > 0 => {
                    self.truncated_line = Some(self.lines.number());
                    return Ok(Row::End);
                }
                None => return Err(self.not_a_number(wanted.field)),
            }
        }
        self.rows += 1;
        Ok(row)
    }

    /// The error for the missing value in the row last read.
    pub(crate) fn missing_error(&self, values: &[f64]) -> RecordingError {
        let field = self.wanted.iter().find(|wanted| !values[wanted.slot].is_finite()).map_or(0, |wanted| wanted.field);
        RecordingError::Missing {
            file: self.path().to_owned(),
            line: self.lines.number(),
            column: self.label(field),
            text: self.shown(field),
        }
    }

    fn not_a_number(&self, field: usize) -> RecordingError {
        let text = self.shown(field);
        let comma = text.contains(',') && text.bytes().all(|b| b.is_ascii_digit() || matches!(b, b',' | b'-' | b'+'));
        let first_row = self.rows == 0;
        RecordingError::NotANumber {
            file: self.path().to_owned(),
            line: self.lines.number(),
            column: self.label(field),
            text,
            mend: if comma {
                "write decimal points instead of decimal commas"
            } else if first_row {
                "mend the field; if this line is a header, set header = true"
            } else {
                "mend the field or delete the line"
            },
        }
    }

    /// Line last read, 1-based.
    pub(crate) fn line(&self) -> u64 {
        self.lines.number()
    }

    pub(crate) fn label_of_slot(&self, slot: usize) -> String {
        self.wanted
            .iter()
            .find(|wanted| wanted.slot == slot)
            .map_or_else(String::new, |wanted| self.label(wanted.field))
    }

    fn label(&self, field: usize) -> String {
        match &self.names {
            Some(names) => format!("`{}` ({field})", names[field].escape_debug()),
            None => field.to_string(),
        }
    }

    fn shown(&self, field: usize) -> String {
        let (from, to) = self.fields[field];
        let text = String::from_utf8_lossy(&self.lines.line()[from..to]);
        let mut short: String = text.chars().take(40).flat_map(char::escape_debug).collect();
        if text.chars().nth(40).is_some() {
            short.push_str("..");
        }
        short
    }
}

/// Data rows of a file: one cheap pass without reading numbers.
pub(crate) fn row_count(path: &Path, format: &LogFormat) -> Result<u64, RecordingError> {
    let mut table = Table::open(path, format)?;
    while table.skip_row()? {}
    Ok(table.rows())
}

fn guessed_delimiter(line: &[u8]) -> u8 {
    // Tabs and semicolons first: where they stand, commas are decimal commas.
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

/// A number as the standard library reads it, `nan` and `inf` included.
fn number(field: &[u8]) -> Option<f64> {
    short_decimal(field).or_else(|| core::str::from_utf8(field).ok()?.parse().ok())
}

/// The fast path for fields such as `-12.345678`: both the digits as an integer below 2⁵³ and the power of ten are exact, so
/// that one division rounds correctly. `None` sends the field to the standard library.
fn short_decimal(field: &[u8]) -> Option<f64> {
    const POWERS: [f64; 16] = [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];
    let (negative, digits) = match field {
        [b'-', rest @ ..] => (true, rest),
        rest => (false, rest),
    };
    // Fifteen digits and a point stay below 2^53.
    if digits.is_empty() || digits.len() > 16 {
        return None;
    }
    let (mut integer, mut point) = (0_u64, None);
    for (at, byte) in digits.iter().enumerate() {
        match byte {
            b'0'..=b'9' => integer = integer * 10 + u64::from(byte - b'0'),
            b'.' if point.is_none() => point = Some(at),
            _ => return None,
        }
    }
    let decimals = match point {
        None if digits.len() > 15 => return None,
        None => 0,
        Some(_) if digits.len() == 1 => return None,
        Some(at) => digits.len() - 1 - at,
    };
    let value = integer as f64 / POWERS[decimals];
    Some(if negative { -value } else { value })
}

fn existing_names(wanted: &str, names: &[String]) -> String {
    const SHOWN: usize = 40;
    // Bounded: a line of a megabyte may hold half a million names.
    const COMPARED: usize = 1000;
    let nearest = names.iter().take(COMPARED).min_by_key(|name| edit_distance(wanted, name)).map_or("", String::as_str);
    let cut = |name: &str| name.chars().take(60).flat_map(char::escape_debug).collect::<String>();
    let list = names.iter().take(SHOWN).map(|name| cut(name)).collect::<Vec<_>>().join(", ");
    let more = if names.len() > SHOWN { format!(", and {} more", names.len() - SHOWN) } else { String::new() };
    let delimiter = if names.len() == 1 { " (only one column: is `delimiter` right?)" } else { "" };
    format!("did you mean `{}`? There are: {list}{more}{delimiter}", cut(nearest))
}

/// Levenshtein distance over the first 64 characters; another digit counts three: `tau1` is no misspelling of `tau2`.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().take(64).collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().take(64).enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let cost = if x.is_ascii_digit() && y.is_ascii_digit() { 3 } else { 1 };
            let substituted = diagonal + if x == *y { 0 } else { cost };
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
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
    fn the_fast_path_reads_the_same_bits_as_the_standard_library() {
        let mut state = 1_u64;
        for _ in 0..20_000 {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let integer = (state >> 3) % 10_u64.pow(1 + (state % 15) as u32);
            let mut text = integer.to_string();
            text.insert((state >> 40) as usize % (text.len() + 1), '.');
            if state & 4 == 0 {
                text.insert(0, '-');
            }
            let fast = short_decimal(text.as_bytes());
            assert_eq!(fast.map(f64::to_bits), text.parse::<f64>().ok().map(f64::to_bits), "{text}");
        }
        for text in ["", "-", ".", "-.", "+1", "1e5", "nan", "1..2", "1234567890123456", "0x1", "--1"] {
            assert_eq!(short_decimal(text.as_bytes()), None, "{text}");
        }
        assert_eq!(number(b"-0").map(f64::is_sign_negative), Some(true));
    }

    #[test]
    fn edit_distance_counts_single_edits() {
        assert_eq!(edit_distance("kitten", "sitting"), 3);
        assert_eq!(edit_distance("", "abc"), 3);
        assert_eq!(edit_distance("q1_rad", "q1_rad"), 0);
        assert_eq!(edit_distance("tau1", "tau2"), 2);
    }
}
