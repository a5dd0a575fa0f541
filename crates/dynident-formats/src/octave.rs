//! Octave's text format (`save FILE`): scalars, matrices, ranges and structs.
//! Format: libinterp/octave-value/ov-*.cc of GNU Octave.

use crate::arrays::{Array, ArrayTable};
use crate::error::FileError;
use crate::kind::FileFormat;
use crate::limits::{Budget, SPLIT_FIX};
use crate::table::Table;
use std::io::{BufRead, Read};
use std::path::{Path, PathBuf};

/// The possible first lines of a file.
pub(crate) const BEGINNINGS: [&[u8]; 2] = [b"# Created by Octave", b"% Created by Octave"];
/// Maximum length of a line, bytes: a matrix of a hundred thousand columns has longer ones.
const MAX_LINE_BYTES: u64 = 1 << 22;
const MAX_NESTING: usize = 8;

struct Reader<R> {
    path: PathBuf,
    input: R,
    line: u64,
    text: Vec<u8>,
    budget: Budget,
    arrays: Vec<Array>,
    others: Vec<String>,
}

pub(crate) fn open(path: &Path, reader: impl BufRead, budget: Budget) -> Result<Box<dyn Table>, FileError> {
    let mut found = Reader {
        path: path.to_owned(),
        input: reader,
        line: 0,
        text: Vec::new(),
        budget,
        arrays: Vec::new(),
        others: Vec::new(),
    };
    while let Some(name) = found.next_name()? {
        found.variable(&name, 0)?;
    }
    let Reader { arrays, others, .. } = found;
    let names = if others.is_empty() { "no variables".to_owned() } else { others.join(", ") };
    let table = ArrayTable::new(arrays).ok_or_else(|| {
        FileError::no_columns(path, FileFormat::Octave, names, "save vectors or matrices of real numbers")
    })?;
    Ok(Box::new(table.with_notes(others)))
}

impl<R: BufRead> Reader<R> {
    fn broken(&self, problem: impl Into<String>, fix: &'static str) -> FileError {
        FileError::broken(&self.path, FileFormat::Octave, format!("line {}", self.line), problem, fix)
    }

    /// Reads the next line; false at the end.
    fn next_line(&mut self) -> Result<bool, FileError> {
        self.text.clear();
        let read = self.input.by_ref().take(MAX_LINE_BYTES).read_until(b'\n', &mut self.text);
        let read = read.map_err(|source| FileError::Io { file: self.path.clone(), source })?;
        self.line += 1;
        if read as u64 == MAX_LINE_BYTES {
            return Err(self.broken("it is longer than 4 MiB", "save the transposed matrix"));
        }
        Ok(read > 0)
    }

    /// The value of the header line `# key: value`, if this line is one.
    fn header(&self, key: &str) -> Option<String> {
        let text = core::str::from_utf8(&self.text).ok()?.trim();
        let rest = text.strip_prefix(['#', '%'])?.trim_start().strip_prefix(key)?;
        Some(rest.strip_prefix(':')?.trim().to_owned())
    }

    fn next_header(&mut self, key: &str) -> Result<Option<String>, FileError> {
        Ok(if self.next_line()? { self.header(key) } else { None })
    }

    /// The name of the next variable; other lines are not read.
    fn next_name(&mut self) -> Result<Option<String>, FileError> {
        while self.next_line()? {
            if let Some(name) = self.header("name") {
                return Ok(Some(name));
            }
        }
        Ok(None)
    }

    fn variable(&mut self, name: &str, depth: usize) -> Result<(), FileError> {
        const COPY: &str = "save it again";
        let kind = self.next_header("type")?.ok_or_else(|| self.broken("the type of a variable is missing", COPY))?;
        match kind.as_str() {
            "scalar" | "float scalar" | "bool" => self.values(name, [1, 1]),
            "matrix" | "float matrix" | "bool matrix" => self.matrix(name),
            _ if kind.ends_with("int8 matrix")
                || kind.ends_with("int16 matrix")
                || kind.ends_with("int32 matrix")
                || kind.ends_with("int64 matrix") =>
            {
                self.matrix(name)
            }
            "range" => self.range(name),
            "scalar struct" if depth < MAX_NESTING => {
                let mut length = None;
                while length.is_none() && self.next_line()? {
                    length = self.header("length");
                }
                let count: u64 = length
                    .and_then(|length| length.parse().ok())
                    .ok_or_else(|| self.broken("the length of a struct is missing", COPY))?;
                for _ in 0..count {
                    let Some(field) = self.next_name()? else { break };
                    self.variable(&format!("{name}.{field}"), depth + 1)?;
                }
                Ok(())
            }
            _ => {
                self.others.push(format!("{name}: {kind}"));
                Ok(())
            }
        }
    }

    /// Reads a matrix. It is stored with its numbers of rows and columns; or with a list of its dimensions and one
    /// number on each line, column by column.
    fn matrix(&mut self, name: &str) -> Result<(), FileError> {
        const COPY: &str = "save it again";
        if !self.next_line()? {
            return Err(self.broken("a matrix has no dimensions", COPY));
        }
        let number = |text: Option<String>| text.and_then(|text| text.parse::<usize>().ok());
        if let Some(rows) = number(self.header("rows")) {
            let columns = number(self.next_header("columns")?);
            let columns = columns.ok_or_else(|| self.broken("a matrix has no number of columns", COPY))?;
            return self.values(name, [rows, columns]);
        }
        if self.header("ndims").is_none() || !self.next_line()? {
            return Err(self.broken("a matrix has no dimensions", COPY));
        }
        let sides = String::from_utf8_lossy(&self.text);
        let sides: Option<Vec<usize>> = sides.split_whitespace().map(|side| side.parse().ok()).collect();
        let sides = sides.ok_or_else(|| self.broken("a dimension is invalid", COPY))?;
        let count = sides.iter().try_fold(1_usize, |all, side| all.checked_mul(*side));
        let (Some(shape), Some(count)) = (Array::two_sides(&sides), count) else {
            self.others.push(format!("{name}: more than two dimensions"));
            return Ok(());
        };
        let values = self.read_values(count)?;
        self.arrays.push(Array::column_major(name.to_owned(), shape, values));
        Ok(())
    }

    fn values(&mut self, name: &str, [rows, columns]: [usize; 2]) -> Result<(), FileError> {
        let count = rows.checked_mul(columns).ok_or_else(|| self.broken("it has too many numbers", SPLIT_FIX))?;
        let values = self.read_values(count)?;
        // A row vector becomes a column of samples.
        let shape = if rows == 1 { [columns, 1] } else { [rows, columns] };
        self.arrays.push(Array::row_major(name.to_owned(), shape, values));
        Ok(())
    }

    /// Base, limit and increment of a range.
    fn range(&mut self, name: &str) -> Result<(), FileError> {
        self.next_line()?;
        let ends = self.read_values(3)?;
        let steps = ((ends[1] - ends[0]) / ends[2] * (1.0 + f64::EPSILON)).floor();
        if !(0.0..1e12).contains(&steps) {
            self.others.push(format!("{name}: an empty range"));
            return Ok(());
        }
        let count = steps as u64 + 1;
        self.budget.take(count.checked_mul(8)).map_err(|problem| self.broken(problem, SPLIT_FIX))?;
        let values: Vec<f64> = (0..count).map(|k| ends[0] + k as f64 * ends[2]).collect();
        self.arrays.push(Array::row_major(name.to_owned(), [values.len(), 1], values));
        Ok(())
    }

    fn read_values(&mut self, count: usize) -> Result<Vec<f64>, FileError> {
        self.budget.take((count as u64).checked_mul(8)).map_err(|problem| self.broken(problem, SPLIT_FIX))?;
        // Grow with the numbers in the file.
        let mut values = Vec::new();
        while values.len() < count {
            let is_end = !self.next_line()? || self.text.starts_with(b"# name:") || self.text.starts_with(b"% name:");
            if is_end {
                return Err(self.broken("a variable has fewer numbers than stated", "save or copy it again"));
            }
            for word in self.text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()) {
                let number = core::str::from_utf8(word).ok().and_then(|word| match word {
                    "NA" => Some(f64::NAN),
                    word => word.parse().ok(),
                });
                let number = number.ok_or_else(|| {
                    let word = String::from_utf8_lossy(word);
                    self.broken(format!("`{word}` is not a real number"), "save real and imaginary parts separately")
                })?;
                values.push(number);
            }
        }
        if values.len() > count {
            return Err(self.broken("a variable has more numbers than stated", "save or copy it again"));
        }
        Ok(values)
    }
}
