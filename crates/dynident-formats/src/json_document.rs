//! JSON documents: a list of objects, one per sample, an object that contains such a list, or an object of lists, one
//! per quantity.

use crate::arrays::{Array, ArrayTable};
use crate::error::FileError;
use crate::json_numbers::flattened;
use crate::kind::FileFormat;
use crate::table::Table;
use core::fmt::Write;
use serde_json::{Map, Value};
use std::collections::HashMap;
use std::io::Read;
use std::path::Path;

/// Maximum length of a document. Its numbers need up to 16 times as much memory.
pub(crate) const MAX_BYTES: u64 = 1 << 25;

/// Maximum number of numbers in a table: each needs two bytes in the document, unless columns have gaps.
const MAX_NUMBERS: usize = (MAX_BYTES / 2) as usize;

const FIX: &str =
    "write one object per line (pandas: `frame.to_json(\"log.jsonl\", orient=\"records\", lines=True)`), or CSV";

/// Reads a document.
///
/// # Errors
/// If it is too long, not JSON, or contains no numbers.
pub(crate) fn open(path: &Path, reader: impl Read) -> Result<Box<dyn Table>, FileError> {
    let mut bytes = Vec::new();
    let read = reader.take(MAX_BYTES + 1).read_to_end(&mut bytes);
    read.map_err(|source| FileError::Io { file: path.to_owned(), source })?;
    let broken = |problem: String| FileError::broken(path, FileFormat::Json, "the document", problem, FIX);
    if bytes.len() as u64 > MAX_BYTES {
        return Err(broken(format!("it is longer than {} MiB", MAX_BYTES >> 20)));
    }
    let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&bytes);
    let value = serde_json::from_slice(text).map_err(|error| broken(format!("it is not JSON ({error})")))?;
    let nothing = || FileError::no_columns(path, FileFormat::Json, "no lists of numbers", FIX);
    Ok(Box::new(table(&value).ok_or_else(nothing)?))
}

/// The table in a document; `None` if it has fewer than two rows.
pub(crate) fn table(value: &Value) -> Option<ArrayTable> {
    let mut arrays = Vec::new();
    match value {
        Value::Array(rows) => arrays.extend(columns(rows)?),
        Value::Object(entries) => {
            if let Some(columns) = split_frame(entries) {
                arrays.extend(columns);
            } else {
                lists(entries, &mut String::new(), &mut arrays);
                without_common_object(&mut arrays);
            }
        }
        _ => return None,
    }
    ArrayTable::new(arrays).filter(|table| table.estimated_rows() > Some(1))
}

fn vector(name: String, values: Vec<f64>) -> Array {
    Array::row_major(name, [values.len(), 1], values)
}

/// One column for each number in the objects `rows`, by its path; NaN where an object does not have it. `None` for
/// objects with few common names, whose table would be larger than the document.
fn columns(rows: &[Value]) -> Option<Vec<Array>> {
    let most = MAX_NUMBERS / rows.len().max(1);
    let (mut names, mut columns) = (HashMap::<String, usize>::new(), Vec::<(String, Vec<f64>)>::new());
    for (row, value) in rows.iter().enumerate() {
        flattened(value, &mut String::new(), &mut |name, number| {
            if columns.len() > most {
                return;
            }
            let column = *names.entry(name.to_owned()).or_insert_with(|| {
                columns.push((name.to_owned(), Vec::new()));
                columns.len() - 1
            });
            columns[column].1.resize(row, f64::NAN);
            columns[column].1.push(number);
        });
    }
    if columns.len() > most {
        return None;
    }
    let full = columns.into_iter().map(|(name, mut values)| {
        values.resize(rows.len(), f64::NAN);
        vector(name, values)
    });
    Some(full.collect())
}

/// The columns of `{"columns": ["t", ..], "data": [[0.0, ..], ..]}`, which pandas writes with `orient="split"`.
fn split_frame(entries: &Map<String, Value>) -> Option<Vec<Array>> {
    let names = entries.get("columns")?.as_array()?;
    let rows = entries.get("data")?.as_array()?;
    if names.len() > MAX_NUMBERS / rows.len().max(1) {
        return None;
    }
    let column = |place: usize, name: &Value| {
        let values = rows.iter().map(|row| row.get(place).and_then(number).unwrap_or(f64::NAN)).collect();
        Some(vector(name.as_str()?.to_owned(), values))
    };
    let columns: Option<Vec<Array>> = names.iter().enumerate().map(|(place, name)| column(place, name)).collect();
    // A column of text has no numbers.
    columns.map(|columns| columns.into_iter().filter(|column| column.values.iter().any(|x| x.is_finite())).collect())
}

/// Adds the lists of numbers, of lists of numbers, and of objects with numbers in an object, named by their path.
fn lists(entries: &Map<String, Value>, path: &mut String, found: &mut Vec<Array>) {
    let length = path.len();
    for (name, value) in entries {
        let _ = if length == 0 { write!(path, "{name}") } else { write!(path, ".{name}") };
        match value {
            Value::Array(items) if items.first().is_some_and(Value::is_object) => {
                let own = columns(items).unwrap_or_default().into_iter();
                found.extend(own.map(|array| Array { name: format!("{path}.{}", array.name), ..array }));
            }
            Value::Array(items) => found.extend(list(path, items)),
            Value::Object(inner) => match by_row(inner) {
                Some(values) => found.push(vector(path.clone(), values)),
                None => lists(inner, path, found),
            },
            _ => {}
        }
        path.truncate(length);
    }
}

/// Removes the name of an object or list from the names of all columns if it contains all of them.
fn without_common_object(arrays: &mut [Array]) {
    let object = |array: &Array| Some(array.name.split_once('.')?.0.to_owned());
    if let Some(common) = arrays.first().and_then(object)
        && arrays.iter().all(|array| object(array).as_ref() == Some(&common))
    {
        for array in arrays {
            array.name.drain(..=common.len());
        }
    }
}

fn list(name: &str, items: &[Value]) -> Option<Array> {
    if let Some(values) = items.iter().map(number).collect::<Option<Vec<f64>>>() {
        return (!values.is_empty()).then(|| vector(name.to_owned(), values));
    }
    let width = items.first()?.as_array()?.len();
    // The list grows with the numbers, not with the length of the first row.
    let mut values = Vec::new();
    for item in items {
        let row = item.as_array().filter(|row| row.len() == width)?;
        for entry in row {
            values.push(number(entry)?);
        }
    }
    (width > 0).then(|| Array::row_major(name.to_owned(), [items.len(), width], values))
}

/// The values of an object from row number to value, such as `{"0": 0.5, "1": 0.7}`, in the order of the rows.
fn by_row(entries: &Map<String, Value>) -> Option<Vec<f64>> {
    let row = |(row, value): (&String, &Value)| Some((row.parse::<u64>().ok()?, number(value)?));
    let mut rows = entries.iter().map(row).collect::<Option<Vec<_>>>()?;
    rows.sort_by_key(|(row, _)| *row);
    (!rows.is_empty()).then(|| rows.into_iter().map(|(_, value)| value).collect())
}

fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Number(number) => number.as_f64(),
        Value::Bool(flag) => Some(f64::from(u8::from(*flag))),
        Value::Null => Some(f64::NAN),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(text: &str) -> (Vec<String>, Vec<Vec<f64>>) {
        let mut table = open(Path::new("log.json"), text.as_bytes()).unwrap();
        let names = table.names().unwrap().to_vec();
        let mut rows = Vec::new();
        let mut row = vec![0.0; names.len()];
        while table.next_row(&mut row).unwrap() {
            rows.push(row.clone());
        }
        (names, rows)
    }

    #[test]
    fn documents_of_every_layout_give_the_same_table() {
        let expected =
            (["q[0]", "q[1]", "t"].map(str::to_owned).to_vec(), vec![vec![1.0, 2.0, 0.0], vec![3.0, 4.0, 0.5]]);
        let sorted = |(names, rows): (Vec<String>, Vec<Vec<f64>>)| {
            let mut order: Vec<usize> = (0..names.len()).collect();
            order.sort_by_key(|column| names[*column].clone());
            let rows = rows.iter().map(|row| order.iter().map(|column| row[*column]).collect::<Vec<_>>());
            (order.iter().map(|column| names[*column].clone()).collect::<Vec<_>>(), rows.collect::<Vec<_>>())
        };
        for text in [
            r#"[{"t": 0.0, "q": [1, 2], "mode": "A"}, {"t": 0.5, "q": [3, 4], "mode": "B"}]"#,
            r#"{"t": [0.0, 0.5], "q": [[1, 2], [3, 4]], "robot": "ur10", "rate": 2}"#,
            r#"{"columns": ["t", "q[0]", "q[1]", "mode"], "index": [0, 1], "data": [[0.0, 1, 2, "A"], [0.5, 3, 4, "B"]]}"#,
            r#"{"t": {"0": 0.0, "1": 0.5}, "q[0]": {"1": 3, "0": 1}, "q[1]": {"0": 2, "1": 4}}"#,
        ] {
            assert_eq!(sorted(rows(text)), expected, "{text}");
        }
        let (names, rows) = rows(r#"[{"t": 0}, {"t": 1, "q": 5}, {"t": 2, "q": null}]"#);
        assert_eq!(names, ["t", "q"]);
        assert!(rows[0][1].is_nan() && rows[1][1] == 5.0 && rows[2][1].is_nan());
    }

    #[test]
    fn rows_may_be_one_entry_of_a_document() {
        // A bench of servos writes its constants next to the rows.
        let text = r#"{"mass": 0.5, "motor": "demo", "entries": [{"t": 0, "q": 1, "on": true}, {"t": 1, "q": 2, "on": true}]}"#;
        let (names, rows) = rows(text);
        assert_eq!(names, ["on", "q", "t"]);
        assert_eq!(rows, [[1.0, 1.0, 0.0], [1.0, 2.0, 1.0]]);
    }

    #[test]
    fn documents_without_a_table_are_refused() {
        // Tables that would be much larger than their documents: names that no two rows share, empty rows, a long row.
        let rows = 20_000;
        let different: Vec<String> = (0..rows).map(|row| format!("{{\"a{row}\":1}}")).collect();
        let names = vec!["\"a\""; rows].join(",");
        let empty = vec!["[]"; rows].join(",");
        let long = vec!["1"; rows].join(",");
        for text in [
            format!("[{}]", different.join(",")),
            format!("{{\"columns\":[{names}],\"data\":[{empty}]}}"),
            format!("{{\"q\":[[{long}],{empty}]}}"),
        ] {
            assert!(open(Path::new("log.json"), text.as_bytes()).is_err(), "{}", &text[..40]);
        }
        for text in ["[{\"t\": 0}]", "{\n\"robot\": \"ur10\"}", "[{\"t\": 0}, ", "[]"] {
            assert!(open(Path::new("log.json"), text.as_bytes()).is_err(), "{text}");
        }
    }
}
