//! JSON lines: one object per line. Columns are the numbers in the objects, named by their path; entries of an array
//! are named by the joint names in another array of the same object.

use crate::error::FileError;
use crate::table::Table;
use std::io::BufRead;
use std::path::Path;

#[cfg(not(feature = "json"))]
pub(crate) fn open(path: &Path, _: Box<dyn BufRead + Send>) -> Result<Box<dyn Table>, FileError> {
    Err(FileError::NotBuilt { file: path.to_owned(), format: "JSON lines", feature: "json" })
}

#[cfg(feature = "json")]
pub(crate) use json::open;

#[cfg(feature = "json")]
mod json {
    use super::{BufRead, FileError, Path, Table};
    use crate::arrays::MAX_COLUMNS;
    use crate::json_document;
    use crate::json_numbers::flattened_message;
    use crate::kind::FileFormat;
    use crate::table::slots;
    use serde_json::Value;
    use std::collections::{HashMap, VecDeque};
    use std::io::Read;
    use std::path::PathBuf;

    /// Maximum length of the first line; a single line may be a whole document.
    const MAX_FIRST_LINE_BYTES: u64 = json_document::MAX_BYTES;
    const MAX_LINE_BYTES: u64 = 1 << 22;
    const SEARCHED_LINES: usize = 64;

    struct JsonLines {
        path: PathBuf,
        reader: Box<dyn BufRead + Send>,
        line: u64,
        /// Buffers for the bytes of a line and for the path of a number.
        bytes: Vec<u8>,
        number_path: String,
        names: Vec<String>,
        column_of: HashMap<String, usize>,
        waiting: VecDeque<(u64, Value)>,
        /// Index of each column among the selected ones.
        slot_of: Vec<Option<usize>>,
        truncated: bool,
    }

    impl core::fmt::Debug for JsonLines {
        fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
            f.debug_struct("JsonLines").field("path", &self.path).field("line", &self.line).finish_non_exhaustive()
        }
    }

    pub(crate) fn open(path: &Path, reader: Box<dyn BufRead + Send>) -> Result<Box<dyn Table>, FileError> {
        let mut table = JsonLines {
            path: path.to_owned(),
            reader,
            line: 0,
            bytes: Vec::new(),
            number_path: String::new(),
            names: Vec::new(),
            column_of: HashMap::new(),
            waiting: VecDeque::new(),
            slot_of: Vec::new(),
            truncated: false,
        };
        while table.waiting.len() < SEARCHED_LINES {
            let Some(value) = table.read()? else { break };
            flattened_message(&value, &mut String::new(), &mut |name, _| {
                if !table.column_of.contains_key(name) && table.names.len() < MAX_COLUMNS {
                    table.column_of.insert(name.to_owned(), table.names.len());
                    table.names.push(name.to_owned());
                }
            });
            table.waiting.push_back((table.line, value));
        }
        // A file with one line is read as a document, unless that gives no rows.
        if let [(_, value)] = table.waiting.make_contiguous()
            && let Some(document) = json_document::table(value)
        {
            return Ok(Box::new(document));
        }
        if table.names.is_empty() {
            let fix = "each line should be an object with numbers, {\"t\": 0.0, \"q\": [0.1, 0.2]}";
            return Err(FileError::no_columns(path, FileFormat::JsonLines, "objects only", fix));
        }
        table.slot_of = (0..table.names.len()).map(Some).collect();
        Ok(Box::new(table))
    }

    impl JsonLines {
        fn broken(&self, problem: impl Into<String>) -> FileError {
            let fix = "write one complete object per line";
            FileError::broken(&self.path, FileFormat::JsonLines, format!("line {}", self.line), problem, fix)
        }

        fn read(&mut self) -> Result<Option<Value>, FileError> {
            let mut line = core::mem::take(&mut self.bytes);
            let value = self.read_into(&mut line);
            self.bytes = line;
            value
        }

        fn read_into(&mut self, line: &mut Vec<u8>) -> Result<Option<Value>, FileError> {
            loop {
                line.clear();
                let most = if self.line == 0 { MAX_FIRST_LINE_BYTES } else { MAX_LINE_BYTES };
                let read = self.reader.by_ref().take(most).read_until(b'\n', line);
                let read = read.map_err(|source| FileError::Io { file: self.path.clone(), source })?;
                if read == 0 {
                    return Ok(None);
                }
                self.line += 1;
                if read as u64 == most {
                    return Err(self.broken(format!("it is longer than {} MiB", most >> 20)));
                }
                let text = if self.line == 1 { line.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(line) } else { &line[..] };
                if text.trim_ascii().is_empty() {
                    continue;
                }
                return match serde_json::from_slice(text) {
                    Ok(value @ Value::Object(_)) => Ok(Some(value)),
                    // An invalid last line without a newline was truncated.
                    Err(_) if !line.ends_with(b"\n") && self.line > 1 => {
                        self.truncated = true;
                        Ok(None)
                    }
                    Ok(_) => Err(self.broken("it is not an object")),
                    Err(error) => Err(self.broken(format!("it is not JSON ({error})"))),
                };
            }
        }

        fn next(&mut self) -> Result<Option<Value>, FileError> {
            match self.waiting.pop_front() {
                Some((_, value)) => Ok(Some(value)),
                None => self.read(),
            }
        }
    }

    impl Table for JsonLines {
        fn width(&self) -> usize {
            self.names.len()
        }

        fn names(&self) -> Option<&[String]> {
            Some(&self.names)
        }

        fn select(&mut self, columns: &[usize]) {
            self.slot_of = slots(self.names.len(), columns);
        }

        fn next_row(&mut self, values: &mut [f64]) -> Result<bool, FileError> {
            let Some(value) = self.next()? else { return Ok(false) };
            values.fill(f64::NAN);
            let mut path = core::mem::take(&mut self.number_path);
            // Most lines have the same numbers in the same order, so the expected name is tried first.
            let mut next = 0;
            flattened_message(&value, &mut path, &mut |name, number| {
                let is_next = self.names.get(next).is_some_and(|expected| expected == name);
                let column = if is_next { Some(next) } else { self.column_of.get(name).copied() };
                let Some(column) = column else { return };
                next = column + 1;
                if let Some(slot) = self.slot_of[column] {
                    values[slot] = number;
                }
            });
            self.number_path = path;
            Ok(true)
        }

        fn skip_row(&mut self) -> Result<bool, FileError> {
            Ok(self.next()?.is_some())
        }

        fn truncated(&self) -> bool {
            self.truncated
        }
    }
}
