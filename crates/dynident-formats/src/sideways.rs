//! Text tables with one line for each quantity: its name (if it has one), followed by its values.

use crate::arrays::{Array, ArrayTable, MAX_COLUMNS};
use crate::error::FileError;
use crate::kind::FileFormat;
use crate::limits::{Budget, SPLIT_FIX};
use crate::table::Table;
use crate::text_number::{number, plain_lines};
use std::collections::HashSet;
use std::io::{BufRead, Read};
use std::path::Path;

/// Maximum length of a line, bytes; enough for ten million values.
const MAX_LINE_BYTES: u64 = 1 << 28;
/// Number of values that the first line must have so that the format is detected.
const MIN_VALUES: usize = 8;

/// How it is known that a text has one line for each quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Layout {
    /// It is detected: every line has a different name, and there are more values than lines.
    Recognised,
    /// The caller says so.
    Stated,
}

/// Whether these first bytes may be those of such a table: a name, and then only numbers.
pub(crate) fn may_begin(head: &[u8]) -> bool {
    let Some(line) = plain_lines(head).next() else { return false };
    let delimiter = delimiter(line);
    let mut fields = line.split(|byte| *byte == delimiter);
    let is_named = fields.next().is_some_and(|name| is_name(unquoted(name)));
    // The last field may be incomplete, because only the first bytes of the file are tested.
    let values: Vec<&[u8]> = fields.take(MIN_VALUES + 1).collect();
    is_named && values.len() > MIN_VALUES && values[..MIN_VALUES].iter().all(|text| number(text, delimiter).is_some())
}

/// The table in a text; `None` if the text is not recognised as such a table.
///
/// # Errors
/// Same as for [`open`](crate::open); for a stated layout also lines of different length.
pub(crate) fn open(
    path: &Path,
    mut reader: impl BufRead,
    mut budget: Budget,
    layout: Layout,
) -> Result<Option<Box<dyn Table>>, FileError> {
    let fault = |line: u64, problem: String, fix: &'static str| {
        FileError::broken(path, FileFormat::SidewaysText, format!("line {line}"), problem, fix)
    };
    let (mut arrays, mut names): (Vec<Array>, HashSet<String>) = (Vec::new(), HashSet::new());
    let (mut line, mut bytes, mut own_delimiter) = (0, Vec::new(), None);
    loop {
        bytes.clear();
        let read = reader.by_ref().take(MAX_LINE_BYTES).read_until(b'\n', &mut bytes);
        let read = read.map_err(|source| FileError::Io { file: path.to_owned(), source })?;
        if read == 0 {
            break;
        }
        line += 1;
        if read as u64 == MAX_LINE_BYTES {
            return Err(fault(line, "it is longer than 256 MiB".to_owned(), SPLIT_FIX));
        }
        let Some(text) = plain_lines(&bytes).next() else { continue };
        let delimiter = *own_delimiter.get_or_insert_with(|| delimiter(text));
        let found = quantity(text, delimiter, &mut budget).map_err(|problem| fault(line, problem, SPLIT_FIX))?;
        let expected = arrays.first().map(|array| array.shape[0]);
        let problem = match &found {
            Err(text) => Some((format!("`{text}` is not a number"), "write numbers after the name of each line")),
            Ok((_, values)) if expected.is_some_and(|count| count != values.len()) => Some((
                format!("{} values, the lines before it have {}", values.len(), expected.unwrap_or(0)),
                "give each line one value per sample",
            )),
            Ok((Some(name), _)) if !names.insert(name.clone()) => {
                Some((format!("the name `{name}` is that of another line"), "give each line a different name"))
            }
            Ok((name, _)) if !arrays.is_empty() && name.is_none() != names.is_empty() => {
                Some(("only some lines have names".to_owned(), "give each line a name, or none"))
            }
            Ok((None, _)) if layout == Layout::Recognised => Some((String::new(), "")),
            Ok(_) if arrays.len() == MAX_COLUMNS => {
                Some((format!("more than {MAX_COLUMNS} lines"), "remove transposed = true: this is a usual table"))
            }
            Ok(_) => None,
        };
        match (problem, found, layout) {
            (None, Ok((name, values)), _) => {
                arrays.push(Array::row_major(name.unwrap_or_default(), [values.len(), 1], values));
            }
            (Some((problem, fix)), _, Layout::Stated) => return Err(fault(line, problem, fix)),
            _ => return Ok(None),
        }
    }
    let samples = arrays.first().map_or(0, |array| array.shape[0]);
    if layout == Layout::Recognised && (samples <= arrays.len() || samples < MIN_VALUES) {
        return Ok(None);
    }
    let table = ArrayTable::new(arrays).ok_or_else(|| {
        FileError::no_columns(path, FileFormat::SidewaysText, "empty lines", "write one line for each quantity")
    })?;
    Ok(Some(Box::new(if names.is_empty() { table.nameless() } else { table })))
}

/// Name and values of a line; or the text of a field that is not a number.
type Quantity = Result<(Option<String>, Vec<f64>), String>;

/// # Errors
/// If the values do not fit into memory.
fn quantity(line: &[u8], delimiter: u8, budget: &mut Budget) -> Result<Quantity, String> {
    // A delimiter at the end has no value after it.
    let line = line.strip_suffix(&[delimiter]).unwrap_or(line);
    let count = line.split(|byte| *byte == delimiter).count();
    budget.take((count as u64).checked_mul(8))?;
    let is_blank = delimiter == b' ';
    let mut fields =
        line.split(|byte| *byte == delimiter).map(unquoted).filter(|field| !(is_blank && field.is_empty())).peekable();
    let name = fields
        .next_if(|field| number(field, delimiter).is_none())
        .map(|name| String::from_utf8_lossy(name).into_owned());
    let mut values = Vec::with_capacity(count);
    for field in fields {
        match number(field, delimiter) {
            Some(value) => values.push(value),
            None if field.is_empty() => values.push(f64::NAN),
            None => return Ok(Err(String::from_utf8_lossy(field).chars().take(40).collect())),
        }
    }
    Ok(Ok((name, values)))
}

/// Delimiter of the fields in a line. Tabs and semicolons are tried first, because files with them may have decimal
/// commas.
fn delimiter(line: &[u8]) -> u8 {
    b"\t;,".iter().copied().find(|delimiter| line.contains(delimiter)).unwrap_or(b' ')
}

fn unquoted(field: &[u8]) -> &[u8] {
    match field.trim_ascii() {
        [b'"', inner @ .., b'"'] => inner.trim_ascii(),
        other => other,
    }
}

/// Whether a field is the name of a quantity: text that begins with a letter, or a ROS topic.
fn is_name(field: &[u8]) -> bool {
    field.first().is_some_and(|first| first.is_ascii_alphabetic() || matches!(first, b'/' | b'_') || *first >= 0x80)
        && number(field, b';').is_none()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::ReadLimits;

    /// Names and rows.
    type Read = (Option<Vec<String>>, Vec<Vec<f64>>);

    fn read(text: &str, layout: Layout) -> Result<Option<Read>, String> {
        let budget = Budget::new(&ReadLimits::default(), text.len() as u64);
        let found = open(Path::new("log.csv"), text.as_bytes(), budget, layout).map_err(|error| error.to_string())?;
        Ok(found.map(|mut table| {
            let names = table.names().map(<[String]>::to_vec);
            let mut rows = Vec::new();
            table.all_rows(&mut |_, row| rows.push(row.to_vec())).unwrap();
            (names, rows)
        }))
    }

    #[test]
    fn lines_with_names_are_columns() {
        let text = "# a comment\nt;0;0,5;1;1,5;2;2,5;3;3,5;4\n\"q1\";1;2;;4;5;6;7;8;9;\n";
        assert!(may_begin(text.as_bytes()));
        let (names, rows) = read(text, Layout::Recognised).unwrap().unwrap();
        assert_eq!(names.unwrap(), ["t", "q1"]);
        assert!(rows.len() == 9 && rows[1] == [0.5, 2.0] && rows[2][1].is_nan() && rows[8] == [4.0, 9.0], "{rows:?}");
    }

    #[test]
    fn usual_tables_are_not_recognised() {
        let labelled = "RUN,1,2,3,4,5,6,7,8,9\nRUN,1,2,3,4,5,6,7,8,9\n";
        assert!(may_begin(labelled.as_bytes()) && read(labelled, Layout::Recognised).unwrap().is_none());
        let short = ('a'..='m').map(|name| format!("{name},1,2,3,4,5,6,7,8,9")).collect::<Vec<_>>().join("\n");
        assert!(read(&short, Layout::Recognised).unwrap().is_none());
        for head in [
            "t,q1,q2\n0,1,2\n",
            "0,1,2,3,4,5,6,7,8,9\n",
            "",
            "2026-01-31 10:00:00,1,2,3,4,5,6,7,8,9\n",
            "nan,1,2,3,4,5,6,7,8,9\n",
        ] {
            assert!(!may_begin(head.as_bytes()), "{head}");
        }
    }

    #[test]
    fn a_stated_layout_needs_no_names_and_names_its_faults() {
        let (names, rows) = read("0 1 2\n3 4 5\n", Layout::Stated).unwrap().unwrap();
        assert!(names.is_none() && rows == [[0.0, 3.0], [1.0, 4.0], [2.0, 5.0]]);
        for (text, words) in [
            ("0,1\n2,3,4\n", "line 2: 3 values, the lines before it have 2"),
            ("t,1\nq,x\n", "line 2: `x` is not a number"),
            ("t,1\n2,3\n", "line 2"),
            ("t,1\nt,2\n", "the name `t` is that of another line"),
            ("", "without a column"),
        ] {
            let message = read(text, Layout::Stated).unwrap_err();
            assert!(message.contains(words), "{message}");
        }
    }
}
