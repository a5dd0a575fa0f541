//! Reading of text tables (CSV and similar): detects delimiter, header and a row of units, and parses rows of numbers.

use super::columns::column_label;
use super::field::number;
use super::format::Header;
use super::lines::Lines;
use super::plain_row::read_plain_row;
use super::row_labels::RowLabels;
use super::source::LogTable;
use super::table_start::{HEAD_BYTES, TableStart, number_repeated_stamps};
use super::text_columns::{Column, are_second_names, are_units, columns, guessed_delimiter, split, text_of};
use crate::error::RecordingError;
use crate::place::LogPlace;
use std::io::Read;
use std::path::Path;

/// Number of fields of a column that contain no number, found in a pass over all rows.
#[derive(Clone, Debug)]
struct TextFields {
    count: u64,
    first_line: u64,
    first: String,
}

#[derive(Debug)]
pub(super) struct TextTable {
    label: String,
    lines: Lines,
    delimiter: u8,
    header_line: u64,
    /// The line with the names. A recorder that is started again repeats it.
    header: Option<Vec<u8>>,
    repeated_headers: u64,
    names: Option<Vec<String>>,
    /// Fields of the row below the header, if this row contains units.
    units: Option<Vec<String>>,
    columns: Vec<Column>,
    /// Names of joints in text fields.
    labels: Option<RowLabels>,
    /// Number of fields in a row.
    field_count: usize,
    first_row_is_pending: bool,
    wanted: Vec<Column>,
    /// For each field, its index among the requested fields; empty if rows need the general parser.
    places: Vec<Option<usize>>,
    fields: Vec<(usize, usize)>,
    rows: u64,
    truncated_line: Option<u64>,
    text: Vec<Option<TextFields>>,
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
        let start = TableStart::find(lines.ahead(HEAD_BYTES)?, delimiter.map(|delimiter| delimiter as u8));
        lines.skip(start.preamble_lines)?;
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
        let (comma, is_automatic) = (delimiter != b',', header == Header::Auto);
        let texts = |line: &[u8], fields: &[(usize, usize)]| -> Vec<String> {
            fields.iter().map(|(from, to)| text_of(&line[*from..*to])).collect()
        };
        let mut fields = Vec::new();
        split(first, delimiter, &mut fields);
        let has_header = match header {
            Header::Present => true,
            Header::Absent => false,
            Header::Auto => {
                !start.is_row && !fields.iter().all(|(from, to)| number(&first[*from..*to], comma).is_some())
            }
        };
        let header_line = lines.number();
        let header = has_header.then(|| first.to_vec());
        let (mut names, mut units, mut first_row_is_pending) = (None, None, true);
        let mut row = fields.clone();
        if has_header {
            names = Some(number_repeated_stamps(texts(first, &fields)));
            first_row_is_pending = lines.advance()?;
            split(lines.line(), delimiter, &mut row);
            if first_row_is_pending && row.len() == fields.len() && are_units(lines.line(), &row) {
                units = Some(texts(lines.line(), &row));
                first_row_is_pending = lines.advance()?;
                split(lines.line(), delimiter, &mut row);
            } else if let Some(names) = names.as_mut().filter(|_| first_row_is_pending)
                && row.len() == fields.len()
                && are_second_names(names, lines.line(), &row)
            {
                for (name, second) in names.iter_mut().zip(texts(lines.line(), &row)) {
                    *name = if second.is_empty() { name.clone() } else { format!("{name}[{second}]") };
                }
                first_row_is_pending = lines.advance()?;
                split(lines.line(), delimiter, &mut row);
            }
            while first_row_is_pending && lines.number() < start.first_row {
                first_row_is_pending = lines.advance()?;
                split(lines.line(), delimiter, &mut row);
            }
            // A column of comments has a name and no fields.
            if start.first_row > 0 {
                fields.truncate(row.len());
            }
        } else if is_automatic {
            names = start.names.filter(|names| names.len() == fields.len());
        }
        let columns = columns(lines.line(), &row, fields.len());
        let labelled = names.as_ref().and_then(|names| RowLabels::find(names, &columns, lines.line(), &row));
        let (labels, names) = match labelled {
            Some((labels, names)) => (Some(labels), Some(names)),
            None => (None, names.map(|names| columns.iter().map(|column| column.name(&names)).collect())),
        };
        let mut table = Self {
            label,
            delimiter,
            header_line,
            header,
            repeated_headers: 0,
            names,
            units,
            text: vec![None; columns.len()],
            columns,
            labels,
            field_count: fields.len(),
            first_row_is_pending,
            wanted: Vec::new(),
            places: Vec::new(),
            fields,
            rows: 0,
            truncated_line: None,
            lines,
        };
        table.select(&[]);
        Ok(table)
    }

    /// Number of rows read so far.
    pub(super) fn rows_read(&self) -> u64 {
        self.rows
    }

    /// Moves to the next row and skips copies of the header line.
    fn advance(&mut self) -> Result<bool, RecordingError> {
        if core::mem::take(&mut self.first_row_is_pending) {
            return Ok(true);
        }
        while self.lines.advance()? {
            if self.header.as_deref() != Some(self.lines.line()) {
                return Ok(true);
            }
            self.repeated_headers += 1;
        }
        Ok(false)
    }

    fn place_of_line(&self, line: u64) -> LogPlace {
        LogPlace::Line { log: self.label.clone(), line }
    }

    fn not_a_number(&self, column: Column) -> RecordingError {
        let text = self.shown(column.field);
        let comma = text.contains(',') && text.bytes().all(|b| b.is_ascii_digit() || matches!(b, b',' | b'-' | b'+'));
        let first_row = self.rows == 0;
        RecordingError::NotANumber {
            place: self.place(),
            column: self
                .columns
                .iter()
                .position(|known| *known == column)
                .map_or_else(String::new, |place| column_label(self.names.as_deref(), place)),
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

impl TextTable {
    /// Reads the next row, with NaN for an empty field. `unread` is called for each field without a number and decides
    /// whether this is an error.
    fn read_row(
        &mut self,
        values: &mut [f64],
        mut unread: impl FnMut(&mut Self, usize) -> Result<(), RecordingError>,
    ) -> Result<bool, RecordingError> {
        if !self.advance()? {
            return Ok(false);
        }
        if !self.places.is_empty() && read_plain_row(self.lines.line(), self.delimiter, &self.places, values) {
            self.rows += 1;
            return Ok(true);
        }
        split(self.lines.line(), self.delimiter, &mut self.fields);
        if self.fields.len() != self.field_count {
            if self.fields.len() < self.field_count && self.rows > 0 && self.lines.at_end()? {
                self.truncated_line = Some(self.lines.number());
                return Ok(false);
            }
            return Err(RecordingError::RaggedRow {
                place: self.place(),
                expected: self.field_count,
                found: self.fields.len(),
                hint: if self.delimiter == b',' && self.fields.len() == 2 * self.field_count {
                    " (decimal commas? write decimal points)"
                } else {
                    ""
                },
            });
        }
        let order = self.labels.as_ref().and_then(|labels| labels.order(self.lines.line(), &self.fields));
        for (place, value) in values.iter_mut().enumerate() {
            let moved = |order| self.labels.as_ref().and_then(|labels| labels.column(self.wanted[place], order));
            let Some(column) = order.as_ref().map_or(Some(self.wanted[place]), moved) else {
                *value = f64::NAN;
                continue;
            };
            let (from, to) = self.fields[column.field];
            *value = match column.value(&self.lines.line()[from..to], self.delimiter != b',') {
                Some(value) => value,
                None if from == to => f64::NAN,
                None if !self.lines.complete() && self.rows > 0 => {
                    self.truncated_line = Some(self.lines.number());
                    return Ok(false);
                }
                None => {
                    unread(self, place)?;
                    f64::NAN
                }
            };
        }
        self.rows += 1;
        Ok(true)
    }
}

impl LogTable for TextTable {
    fn width(&self) -> usize {
        self.columns.len()
    }

    fn names(&self) -> Option<&[String]> {
        self.names.as_deref()
    }

    fn unit(&self, column: usize) -> Option<&str> {
        self.units.as_ref()?.get(self.columns[column].field).map(String::as_str)
    }

    fn notes(&self) -> Vec<String> {
        let units = self.units.iter().map(|units| format!("row of units below the header: {}", units.join(", ")));
        let text = self.text.iter().enumerate().filter_map(|(column, text)| {
            let TextFields { count, first_line, first } = text.as_ref()?;
            let label = column_label(self.names.as_deref(), column);
            Some(if *count == self.rows {
                format!("column {label} contains text: `{first}`")
            } else {
                format!("column {label}: {count} fields are not numbers, the first is `{first}` in line {first_line}")
            })
        });
        let headers = (self.repeated_headers > 0)
            .then(|| format!("copies of the header line, which are skipped: {}", self.repeated_headers));
        units.chain(text).chain(headers).collect()
    }

    fn is_text(&self, column: usize) -> bool {
        self.text[column].as_ref().is_some_and(|text| text.count == self.rows)
    }

    fn select(&mut self, fields: &[usize]) {
        self.wanted = fields.iter().map(|column| self.columns[*column]).collect();
        let is_plain =
            self.delimiter != b' ' && self.labels.is_none() && self.columns.iter().all(|column| column.entry.is_none());
        let place = |field| fields.iter().position(|wanted| *wanted == field);
        self.places = if is_plain { (0..self.field_count).map(place).collect() } else { Vec::new() };
    }

    fn skip_row(&mut self) -> Result<bool, RecordingError> {
        let found = self.advance()?;
        self.rows += u64::from(found);
        Ok(found)
    }

    fn next_row(&mut self, values: &mut [f64]) -> Result<bool, RecordingError> {
        self.read_row(values, |table, place| Err(table.not_a_number(table.wanted[place])))
    }

    /// Reads all rows. Fields without a number are NaN and not an error, because no study key requested their column;
    /// [`notes`](Self::notes) lists them.
    fn all_rows(&mut self, each: &mut dyn FnMut(usize, &[f64])) -> Result<(), RecordingError> {
        let columns: Vec<usize> = (0..self.columns.len()).collect();
        self.select(&columns);
        let mut row = vec![0.0; columns.len()];
        let count_text = |table: &mut Self, column: usize| {
            let line = table.lines.number();
            let first = table.shown(table.columns[column].field);
            let text = table.text[column].get_or_insert(TextFields { count: 0, first_line: line, first });
            text.count += 1;
            Ok(())
        };
        while self.read_row(&mut row, count_text)? {
            each(0, &row);
        }
        Ok(())
    }

    fn place(&self) -> LogPlace {
        let is_before_rows = self.rows == 0 && self.first_row_is_pending;
        self.place_of_line(if is_before_rows { self.header_line } else { self.lines.number() })
    }

    fn field_text(&self, column: usize) -> Option<String> {
        Some(self.shown(self.columns[column].field))
    }

    fn truncated(&self) -> Option<LogPlace> {
        self.truncated_line.map(|line| self.place_of_line(line))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> TextTable {
        let text = Box::new(std::io::Cursor::new(text.as_bytes().to_vec()));
        TextTable::open(Path::new("log"), text, Header::Auto, None).unwrap()
    }

    fn all(table: &mut TextTable) -> Vec<Vec<f64>> {
        let mut rows = Vec::new();
        table.all_rows(&mut |_, row| rows.push(row.to_vec())).unwrap();
        rows
    }

    #[test]
    fn a_column_of_text_does_not_hide_the_others() {
        let mut log = table("t,q1,mode,moving\n0,1,RUNNING,True\n1,2,STOP,False\n2,3x,STOP,True\n");
        let rows = all(&mut log);
        assert_eq!(rows.iter().map(|row| row[0]).collect::<Vec<_>>(), [0.0, 1.0, 2.0]);
        assert_eq!(rows.iter().map(|row| row[3]).collect::<Vec<_>>(), [1.0, 0.0, 1.0]);
        assert!(rows.iter().all(|row| row[2].is_nan()) && rows[1][1] == 2.0 && rows[2][1].is_nan());
        assert_eq!([0, 1, 2, 3].map(|column| log.is_text(column)), [false, false, true, false]);
        let notes = log.notes();
        assert!(notes[0].contains("`q1`") && notes[0].contains("`3x` in line 4"), "{notes:?}");
        assert!(notes[1].contains("`mode`") && notes[1].contains("RUNNING"), "{notes:?}");
    }

    #[test]
    fn a_requested_column_of_text_is_an_error() {
        let mut log = table("t,mode\n0,RUNNING\n");
        log.select(&[1]);
        let error = log.next_row(&mut [0.0]).unwrap_err().to_string();
        assert!(error.contains("log:2, column `mode` (1): `RUNNING`"), "{error}");
    }

    #[test]
    fn lists_become_columns() {
        let mut log = table("t,q,mode\n0,\"[0.5, -1]\",A\n1,\"[2 3]\",B\n2,\"[4]\",B\n");
        assert_eq!(log.names().unwrap(), ["t", "q[0]", "q[1]", "mode"]);
        let rows = all(&mut log);
        assert_eq!(rows[0][..3], [0.0, 0.5, -1.0]);
        assert_eq!(rows[1][..3], [1.0, 2.0, 3.0]);
        assert!(rows[2][1].is_nan() && rows[2][2].is_nan(), "{rows:?}");
        let mut log = table("0,\"[0.5, -1]\"\n1,\"[2, 3]\"\n");
        log.select(&[1]);
        assert!(log.next_row(&mut [0.0]).unwrap());
    }

    #[test]
    fn a_row_of_units_is_no_data() {
        let mut log = table("t,q1,tau1\ns,[deg],Nm\n0,1,2\n1,2,3\n");
        assert_eq!([0, 1, 2].map(|column| log.unit(column)), [Some("s"), Some("[deg]"), Some("Nm")]);
        assert_eq!(all(&mut log), [[0.0, 1.0, 2.0], [1.0, 2.0, 3.0]]);
        // Text that names no unit is data.
        assert_eq!(all(&mut table("mode,state\nA,B\nC,D\n")).len(), 2);
    }

    /// Columns as `rostopic echo -p` and as bagpy write them; the order of the joints changes in the last row.
    #[test]
    fn names_in_text_fields_name_the_columns() {
        let numbered = "t,m.name0,m.name1,m.pos0,m.pos1,other_0,other_1\n0,b,a,1,2,5,6\n1,b,a,3,4,5,6\n2,a,b,7,8,5,6\n";
        let lists =
            "t,name,pos\n0,\"['b', 'a']\",\"[1, 2]\"\n1,\"['b', 'a']\",\"[3, 4]\"\n2,\"['a', 'b']\",\"[7, 8]\"\n";
        for (text, names) in [(numbered, ["m.pos[b]", "m.pos[a]"]), (lists, ["pos[b]", "pos[a]"])] {
            let mut log = table(text);
            let columns = names.map(|name| log.names().unwrap().iter().position(|known| known == name).unwrap());
            log.select(&columns);
            let mut rows = [[0.0; 2]; 3];
            for row in &mut rows {
                assert!(log.next_row(row).unwrap());
            }
            assert_eq!(rows, [[1.0, 2.0], [3.0, 4.0], [8.0, 7.0]], "{text}");
        }
        assert!(table(numbered).names().unwrap().ends_with(&["other_0".to_owned(), "other_1".to_owned()]));
        // If a row lacks a joint, its value is missing. If two names are equal, the joints are not named.
        let mut log = table("name0,name1,q0,q1\na,b,1,2\na,c,3,4\n");
        assert_eq!(log.names().unwrap()[2..], ["q[a]", "q[b]"]);
        assert!(all(&mut log)[1][2..].iter().zip([3.0, f64::NAN]).all(|(a, b)| a.to_bits() == b.to_bits()));
        assert_eq!(table("name0,name1,q0,q1\na,a,1,2\n").names().unwrap()[2..], ["q0", "q1"]);
    }

    #[test]
    fn repeated_headers_are_no_rows() {
        let text = "t,q1\n0,1\nt,q1\n1,2\n";
        let mut log = table(text);
        assert_eq!(all(&mut log), [[0.0, 1.0], [1.0, 2.0]]);
        assert!(log.notes()[0].ends_with("skipped: 1"), "{:?}", log.notes());
        let mut log = table(text);
        assert!(log.skip_row().unwrap() && log.skip_row().unwrap() && !log.skip_row().unwrap());
    }

    #[test]
    fn two_header_lines_become_one() {
        let mut log = table("time,pos,pos,eff,eff\ns,j1,j2,j1,j2\n0,1,2,3,4\n");
        assert_eq!(log.names().unwrap(), ["time[s]", "pos[j1]", "pos[j2]", "eff[j1]", "eff[j2]"]);
        assert_eq!(all(&mut log), [[0.0, 1.0, 2.0, 3.0, 4.0]]);
        // A row of text below different names is data.
        assert_eq!(table("mode,state\nA,B\nC,D\n").names().unwrap(), ["mode", "state"]);
    }

    #[test]
    fn decimal_commas_are_read_where_they_do_not_separate_fields() {
        assert_eq!(all(&mut table("t;q1\n0,004;-1,5\n0,008;2\n")), [[0.004, -1.5], [0.008, 2.0]]);
        assert_eq!(all(&mut table("0,5\t1,5\n1,5\t2,5\n")), [[0.5, 1.5], [1.5, 2.5]]);
    }

    #[test]
    fn errors_name_the_line() {
        let mut log = table("# a comment\nt,q1\n\n0,1\n1\n2,3\n");
        assert_eq!(log.place().to_string(), "log:2");
        log.select(&[0]);
        assert!(log.next_row(&mut [0.0]).unwrap());
        assert!(log.next_row(&mut [0.0]).unwrap_err().to_string().contains("log:5: 1 fields where 2"));
        let mut empty = table("t,q1\n");
        assert!(!empty.next_row(&mut []).unwrap() && !empty.skip_row().unwrap());
    }
}
