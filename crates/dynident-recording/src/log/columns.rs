//! Selects the columns of a table by name or index.

use super::channels::ColumnRef;
use super::row_count::RowCount;
use super::source::{LogSource, LogTable};
use crate::error::RecordingError;
use crate::place::LogPlace;

#[derive(Debug)]
pub(super) struct ColumnSelection {
    pub(super) label: String,
    pub(super) table: Box<dyn LogTable>,
    fields: Vec<usize>,
    pub(super) values: Vec<f64>,
    /// Number of rows read or skipped so far.
    pub(super) rows: u64,
}

impl ColumnSelection {
    pub(super) fn new(label: String, table: Box<dyn LogTable>) -> Self {
        Self { label, table, fields: Vec::new(), values: Vec::new(), rows: 0 }
    }

    /// Requests `column`; returns the slot of its values in every row.
    pub(super) fn request(&mut self, key: &str, column: &ColumnRef) -> Result<usize, RecordingError> {
        let field = self.field(key, column)?;
        if let Some(known) = self.fields.iter().position(|requested| *requested == field) {
            return Ok(known);
        }
        self.fields.push(field);
        Ok(self.fields.len() - 1)
    }

    /// Counts the data rows of the table's source in one pass without parsing numbers. Which rows exist may depend on
    /// the requested columns. The result is cached in `known`.
    pub(super) fn count_rows(&self, source: &dyn LogSource, known: &RowCount) -> Result<u64, RecordingError> {
        known.of(&self.fields, source.path(), || {
            let (mut table, mut rows) = (source.open()?, 0);
            table.select(&self.fields);
            while table.skip_row()? {
                rows += 1;
            }
            Ok(rows)
        })
    }

    pub(super) fn finish_selection(&mut self) {
        self.table.select(&self.fields);
        self.values = vec![0.0; self.fields.len()];
    }

    fn field(&self, key: &str, column: &ColumnRef) -> Result<usize, RecordingError> {
        let unknown = |requested: String, hint: String| RecordingError::UnknownColumn {
            place: self.table.place(),
            key: key.to_owned(),
            wanted: requested,
            hint,
        };
        let width = self.table.width();
        match column {
            ColumnRef::Index(index) if *index < width => Ok(*index),
            ColumnRef::Index(index) => {
                Err(unknown(index.to_string(), format!("there are {width} columns, 0 to {}", width.saturating_sub(1))))
            }
            ColumnRef::Name(name) => {
                let Some(names) = self.table.names() else {
                    // `"{1..7}"` for columns without names.
                    if let Some(index) = name.parse().ok().filter(|index| *index < width) {
                        return Ok(index);
                    }
                    let hint = match self.table.place() {
                        LogPlace::Line { .. } => {
                            "the file has no header line: give 0-based indices, or set header = true"
                        }
                        LogPlace::Whole { .. } | LogPlace::Row { .. } => {
                            "the columns have no names: give 0-based indices"
                        }
                    };
                    return Err(unknown(name.clone(), hint.to_owned()));
                };
                let mut places = names.iter().enumerate().filter(|(_, n)| *n == name).map(|(index, _)| index);
                match (places.next(), places.next()) {
                    (Some(first), Some(second)) => Err(RecordingError::DuplicateColumn {
                        place: self.table.place(),
                        name: name.clone(),
                        first,
                        second,
                    }),
                    (Some(first), None) => Ok(first),
                    (None, _) => {
                        let entry = numbered_entry(name, names).filter(|_| self.table.has_numbered_entries());
                        entry.ok_or_else(|| unknown(name.clone(), existing_names(name, names)))
                    }
                }
            }
        }
    }

    pub(super) fn next_row(&mut self) -> Result<bool, RecordingError> {
        let found = self.table.next_row(&mut self.values)?;
        self.rows += u64::from(found);
        Ok(found)
    }

    pub(super) fn skip_row(&mut self) -> Result<bool, RecordingError> {
        let found = self.table.skip_row()?;
        self.rows += u64::from(found);
        Ok(found)
    }

    /// Whether the current row has an empty, NaN or infinite field.
    pub(super) fn missing(&self) -> bool {
        !self.values.iter().all(|value| value.is_finite())
    }

    pub(super) fn missing_error(&self) -> RecordingError {
        let slot = self.values.iter().position(|value| !value.is_finite()).unwrap_or(0);
        let field = self.fields[slot];
        RecordingError::Missing {
            place: self.table.place(),
            column: column_label(self.table.names(), field),
            text: self.table.field_text(field).unwrap_or_else(|| self.values[slot].to_string()),
        }
    }

    pub(super) fn label_of_slot(&self, slot: usize) -> String {
        column_label(self.table.names(), self.fields[slot])
    }
}

/// Index of a column such as `q[2]`: the third of the columns `q[..]`, if all of them have names in place of numbers.
fn numbered_entry(requested: &str, names: &[String]) -> Option<usize> {
    let (array, number) = split_entry(requested)?;
    let number: usize = number.parse().ok()?;
    let entries = names.iter().enumerate().filter_map(|(index, name)| Some((index, split_entry(name)?)));
    let own: Vec<(usize, &str)> =
        entries.filter(|(_, (of, _))| *of == array).map(|(index, (_, entry))| (index, entry)).collect();
    let has_numbers = own.iter().any(|(_, entry)| entry.parse::<usize>().is_ok());
    own.get(number).filter(|_| !has_numbers).map(|(index, _)| *index)
}

/// Splits `q[elbow]` into `q` and `elbow`.
fn split_entry(name: &str) -> Option<(&str, &str)> {
    name.strip_suffix(']')?.rsplit_once('[')
}

pub(super) fn column_label(names: Option<&[String]>, field: usize) -> String {
    match names.and_then(|names| names.get(field)) {
        Some(name) => format!("`{}` ({field})", name.escape_debug()),
        None => field.to_string(),
    }
}

fn existing_names(requested: &str, names: &[String]) -> String {
    const MAX_SHOWN: usize = 20;
    // The number is limited, because a line of a megabyte may contain half a million names.
    const MAX_COMPARED: usize = 1000;
    let mut likely: Vec<&String> = names.iter().take(MAX_COMPARED).collect();
    // If there are many names, the message lists the most similar ones.
    let by_distance = |name: &&String| edit_distance(requested, name);
    let nearest = likely.iter().copied().min_by_key(by_distance).map_or("", String::as_str);
    if names.len() > MAX_SHOWN {
        likely.sort_by_key(by_distance);
    }
    let cut = |name: &str| name.chars().take(60).flat_map(char::escape_debug).collect::<String>();
    let list = likely.iter().take(MAX_SHOWN).map(|name| cut(name)).collect::<Vec<_>>().join(", ");
    let more = if names.len() > MAX_SHOWN { format!(", and {} more", names.len() - MAX_SHOWN) } else { String::new() };
    let delimiter = if names.len() == 1 { " (only one column: is `delimiter` right?)" } else { "" };
    format!("did you mean `{}`? There are: {list}{more}{delimiter}", cut(nearest))
}

/// Levenshtein distance (number of changed characters) over the first 64 characters. A changed digit has the distance
/// three, because `tau1` is usually not a misspelling of `tau2`.
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

    #[test]
    fn numbers_are_indices_of_named_entries() {
        let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
        let named = names(&["t", "q[pan]", "tau[pan]", "q[lift]", "tau[lift]"]);
        let found =
            ["q[0]", "q[1]", "tau[1]", "q[2]", "dq[0]", "q[elbow]", "t"].map(|name| numbered_entry(name, &named));
        assert_eq!(found, [Some(1), Some(3), Some(4), None, None, None, None]);
        // Columns that count from 1 have no column 0.
        assert_eq!(numbered_entry("q[0]", &names(&["q[1]", "q[2]"])), None);
    }

    #[test]
    fn edit_distance_is_the_number_of_edits() {
        assert_eq!(edit_distance("kitten", "sitting"), 3);
        assert_eq!(edit_distance("", "abc"), 3);
        assert_eq!(edit_distance("q1_rad", "q1_rad"), 0);
        assert_eq!(edit_distance("tau1", "tau2"), 2);
    }
}
