//! Division of a line of a text table into fields, and of fields into columns.

use super::field::{entry, list_length, number};

/// Maximum number of entries of a list in a field that become columns.
const MAX_ENTRIES: usize = 1024;
/// Texts that identify a row of units, in upper or lower case and with or without brackets.
const UNITS: [&str; 20] = [
    "s", "sec", "seconds", "ms", "us", "ns", "rad", "deg", "degrees", "rad/s", "deg/s", "rpm", "m", "mm", "nm", "n m",
    "n", "a", "ma", "v",
];

/// A column: a field, or an entry of the list in a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Column {
    pub(super) field: usize,
    /// Index of the entry, and length of the list.
    pub(super) entry: Option<(usize, usize)>,
}

/// The text of a field; Latin-1 if it is not UTF-8, as in files of Excel: `[°]`.
pub(super) fn text_of(field: &[u8]) -> String {
    let latin = || field.iter().map(|byte| char::from(*byte)).collect();
    core::str::from_utf8(field).map_or_else(|_| latin(), str::to_owned)
}

pub(super) fn guessed_delimiter(line: &[u8]) -> u8 {
    // Tabs and semicolons are tried first, because files with these separators may have decimal commas.
    for delimiter in *b"\t;," {
        if line.contains(&delimiter) {
            return delimiter;
        }
    }
    b' '
}

/// Splits `line` into fields without outer blanks and quotes, as byte ranges.
pub(super) fn split(line: &[u8], delimiter: u8, fields: &mut Vec<(usize, usize)>) {
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

impl Column {
    pub(super) fn name(self, names: &[String]) -> String {
        let name = &names[self.field];
        self.entry.map_or_else(|| name.clone(), |(place, _)| format!("{name}[{place}]"))
    }

    pub(super) fn value(self, field: &[u8], comma: bool) -> Option<f64> {
        match self.entry {
            None => number(field, comma),
            Some((place, count)) => entry(field, place, count),
        }
    }
}

/// Columns of a table with this first row: one for each field, or one for each entry if a field contains a list.
pub(super) fn columns(line: &[u8], row: &[(usize, usize)], fields: usize) -> Vec<Column> {
    let of_field = |field: usize| {
        let list = row.get(field).and_then(|(from, to)| list_length(&line[*from..*to]));
        let list = list.filter(|count| *count <= MAX_ENTRIES);
        (0..list.unwrap_or(1)).map(move |place| Column { field, entry: list.map(|count| (place, count)) })
    };
    (0..fields).flat_map(of_field).collect()
}

/// Whether most fields of a row are names of units, and no field is a number.
pub(super) fn are_units(line: &[u8], row: &[(usize, usize)]) -> bool {
    let fields = || row.iter().map(|(from, to)| &line[*from..*to]).filter(|field| !field.is_empty());
    let is_unit = |field: &[u8]| UNITS.iter().any(|unit| bare(field).eq_ignore_ascii_case(unit.as_bytes()));
    let units = fields().filter(|field| is_unit(field)).count();
    2 * units > fields().count() && fields().all(|field| number(field, true).is_none() && list_length(field).is_none())
}

/// Whether the row below `names` also contains names. This is the case if `names` repeat: quantities are written above
/// the joints, as in pandas.
pub(super) fn are_second_names(names: &[String], line: &[u8], row: &[(usize, usize)]) -> bool {
    let is_repeated = (1..names.len()).any(|at| !names[at].is_empty() && names[..at].contains(&names[at]));
    let mut fields = row.iter().map(|(from, to)| &line[*from..*to]);
    is_repeated
        && row.iter().any(|(from, to)| from < to)
        && fields.all(|field| number(field, true).is_none() && list_length(field).is_none())
}

/// A unit without the brackets around it.
fn bare(field: &[u8]) -> &[u8] {
    match field {
        [b'[', inner @ .., b']'] | [b'(', inner @ .., b')'] => inner,
        _ => field,
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
}
