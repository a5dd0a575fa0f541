//! Reads the messages of an Arrow file as a table.

use super::MAGIC;
use super::batch::{Batch, Loaded, move_to};
use super::flat::Flat;
use super::schema::{Cell, Leaf, List, Schema};
use crate::arrays::{MAX_COLUMNS, MAX_LIST_COLUMNS};
use crate::error::FileError;
use crate::kind::FileFormat;
use crate::limits::Budget;
use crate::table::Table;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

const SCHEMA: u8 = 1;
const BATCH: u8 = 3;

struct Message {
    head: Vec<u8>,
    /// Start and length of its buffers in the file.
    begin: u64,
    bytes: u64,
}

#[derive(Debug)]
struct ArrowTable {
    path: PathBuf,
    reader: BufReader<File>,
    budget: Budget,
    next_message: u64,
    end: u64,
    /// Whether it is a stream, which may end at any byte.
    stream: bool,
    truncated: bool,
    batches: usize,
    leaves: Vec<Leaf>,
    first: Vec<i64>,
    names: Vec<String>,
    notes: Vec<String>,
    /// Leaf and entry of each column, and of each requested column.
    columns: Vec<(usize, usize)>,
    wanted: Vec<(usize, usize)>,
    loaded: Vec<Option<Loaded>>,
    rows: usize,
    next_row: usize,
    estimated_rows: Option<u64>,
}

pub(crate) fn open(path: &Path, budget: Budget) -> Result<Box<dyn Table>, FileError> {
    let io = |source| FileError::Io { file: path.to_owned(), source };
    let file = dynident_files::open(path).map_err(io)?;
    let length = file.metadata().map_err(io)?.len();
    let mut reader = BufReader::with_capacity(1 << 16, file);
    let mut magic = [0; MAGIC.len()];
    let stream = reader.read_exact(&mut magic).is_err() || magic != MAGIC;
    let end = if stream { Ok(length) } else { end_of_messages(&mut reader, length).map_err(io)? };
    let end = end.map_err(|problem| broken(path, "its end", problem))?;
    let mut table = ArrowTable {
        path: path.to_owned(),
        reader,
        budget,
        next_message: if stream { 0 } else { 8 },
        end,
        stream,
        truncated: false,
        batches: 0,
        leaves: Vec::new(),
        first: Vec::new(),
        names: Vec::new(),
        notes: Vec::new(),
        columns: Vec::new(),
        wanted: Vec::new(),
        loaded: Vec::new(),
        rows: 0,
        next_row: 0,
        estimated_rows: None,
    };
    table.read_schema()?;
    table.find_columns()?;
    if table.names.is_empty() {
        let fix = "write columns of numbers, or lists of them";
        return Err(FileError::no_columns(path, FileFormat::Arrow, table.notes.join("; "), fix));
    }
    Ok(Box::new(table))
}

fn broken(path: &Path, place: impl Into<String>, problem: impl Into<String>) -> FileError {
    FileError::broken(path, FileFormat::Arrow, place, problem, "write or copy it again")
}

/// End of the messages in a file of `length` bytes, which is the start of the footer. The length of the footer and
/// the magic bytes are at the end of the file.
fn end_of_messages(reader: &mut BufReader<File>, length: u64) -> std::io::Result<Result<u64, &'static str>> {
    let mut tail = [0; 4 + MAGIC.len()];
    let Some(tail_at) = length.checked_sub(tail.len() as u64).filter(|at| *at >= 8) else {
        return Ok(Err("it is truncated"));
    };
    reader.seek(SeekFrom::Start(tail_at))?;
    reader.read_exact(&mut tail)?;
    if !tail.ends_with(MAGIC) {
        return Ok(Err("it is truncated, or its writer was not closed"));
    }
    let footer = u64::from(u32::from_le_bytes([tail[0], tail[1], tail[2], tail[3]]));
    Ok(tail_at.checked_sub(footer).filter(|at| *at >= 8).ok_or("its footer is longer than the file"))
}

impl ArrowTable {
    fn place(&self) -> String {
        format!("message at byte {}", self.next_message)
    }

    fn message(&mut self) -> Result<Option<Message>, FileError> {
        let io = |source| FileError::Io { file: self.path.clone(), source };
        let left = self.end.saturating_sub(self.next_message);
        if left == 0 {
            return Ok(None);
        }
        move_to(&mut self.reader, self.next_message).map_err(io)?;
        // Before version 0.15 a message started with its length.
        let (mut prefix, mut begin) = ([0; 4], 4);
        let mut word = |reader: &mut BufReader<File>| match reader.read_exact(&mut prefix) {
            Ok(()) => Ok(Some(u32::from_le_bytes(prefix))),
            Err(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => Ok(None),
            Err(error) => Err(io(error)),
        };
        let mut length = word(&mut self.reader)?;
        if length == Some(u32::MAX) {
            length = word(&mut self.reader)?;
            begin = 8;
        }
        let Some(length) = length.map(u64::from).filter(|length| begin + length <= left) else { return self.cut() };
        if length == 0 {
            return Ok(None);
        }
        let mut head = vec![0; length as usize];
        self.reader.read_exact(&mut head).map_err(io)?;
        let bytes = Flat::root(&head).map(|message| message.i64(3));
        let Some(bytes) = bytes.and_then(|bytes| u64::try_from(bytes).ok()) else {
            return Err(broken(&self.path, self.place(), "it is invalid"));
        };
        let begin = self.next_message + begin + length;
        if begin.checked_add(bytes).is_none_or(|end| end > self.end) {
            return self.cut();
        }
        self.next_message = begin + bytes;
        Ok(Some(Message { head, begin, bytes }))
    }

    /// Handles a message that extends beyond the end of the file.
    fn cut(&mut self) -> Result<Option<Message>, FileError> {
        if self.stream && self.batches > 0 {
            self.truncated = true;
            self.next_message = self.end;
            return Ok(None);
        }
        Err(broken(&self.path, self.place(), "the file ends inside it"))
    }

    fn read_schema(&mut self) -> Result<(), FileError> {
        let place = self.place();
        let found = self.message()?;
        let message = found.as_ref().and_then(|message| Flat::root(&message.head)).filter(|flat| flat.u8(1) == SCHEMA);
        let Some((message, schema)) = message.and_then(|message| Some((message, message.table(2)?))) else {
            return Err(broken(&self.path, place, "it is not a schema"));
        };
        if schema.i16(0).unwrap_or(0) != 0 {
            let fix = "write the file on a little-endian machine";
            let problem = "its numbers are big-endian";
            return Err(FileError::broken(&self.path, FileFormat::Arrow, place, problem, fix));
        }
        let Some(read) = Schema::read(schema, message.i16(0).unwrap_or(0)) else {
            return Err(broken(&self.path, place, "it has a column of unknown type"));
        };
        (self.leaves, self.notes) = (read.leaves, read.notes);
        Ok(())
    }

    /// Names the columns. The length of lists and the first time stamps are taken from the first batch.
    fn find_columns(&mut self) -> Result<(), FileError> {
        let after_schema = self.next_message;
        let looked_at: Vec<bool> = self
            .leaves
            .iter()
            .map(|leaf| leaf.list.is_some() || matches!(leaf.cell, Cell::Ticks { from_first: true, .. }))
            .collect();
        let found = self.next_batch(|leaf| looked_at[leaf])?;
        if found {
            let size = (self.next_message - after_schema).max(1);
            let times = (self.end - after_schema) as f64 / size as f64;
            self.estimated_rows = Some((self.rows as f64 * times) as u64);
        }
        self.first = vec![0; self.leaves.len()];
        for (index, leaf) in self.leaves.iter().enumerate() {
            let loaded = self.loaded.get(index).and_then(Option::as_ref);
            if let Some(first) = loaded.and_then(|loaded| loaded.first_ticks(self.rows)) {
                self.first[index] = first;
            }
            let (name, count) = (
                &leaf.name,
                match (&leaf.list, loaded) {
                    (None, _) => 1,
                    (Some((_, List::Fixed(length))), _) => *length,
                    (Some(_), loaded) => loaded.map_or(0, |loaded| loaded.length(0)),
                },
            );
            let count = count.min(MAX_LIST_COLUMNS);
            if self.names.len() + count > MAX_COLUMNS {
                self.notes.push(format!("column {name}: more than {MAX_COLUMNS} columns"));
                continue;
            }
            for entry in 0..count {
                self.names.push(if leaf.list.is_some() { format!("{name}[{entry}]") } else { name.clone() });
                self.columns.push((index, entry));
            }
        }
        self.wanted.clone_from(&self.columns);
        (self.next_message, self.batches, self.rows, self.truncated) = (after_schema, 0, 0, false);
        self.loaded.clear();
        Ok(())
    }

    /// Reads the requested columns of the next batch with rows; false at the end.
    fn next_batch(&mut self, asked_for: impl Fn(usize) -> bool) -> Result<bool, FileError> {
        loop {
            let Some(message) = self.message()? else { return Ok(false) };
            let Some(flat) = Flat::root(&message.head).filter(|flat| flat.u8(1) == BATCH) else { continue };
            let place = format!("batch {}", self.batches);
            let batch = Batch::read(flat, message.begin, message.bytes);
            let batch = batch.map_err(|problem| broken(&self.path, &*place, problem))?;
            self.batches += 1;
            if batch.rows == 0 {
                continue;
            }
            let loaded = batch.loaded(&self.leaves, &asked_for, &mut self.reader, self.budget);
            self.loaded = loaded.map_err(|(leaf, problem)| {
                broken(&self.path, format!("{place}, column {}", self.leaves[leaf].name), problem)
            })?;
            (self.rows, self.next_row) = (batch.rows, 0);
            return Ok(true);
        }
    }

    fn advance(&mut self) -> Result<Option<usize>, FileError> {
        if self.next_row >= self.rows {
            let mut asked_for = vec![false; self.leaves.len()];
            for (leaf, _) in &self.wanted {
                asked_for[*leaf] = true;
            }
            // Load at least one column; otherwise the number of rows is not checked against the data.
            if let (true, Some((leaf, _))) = (self.wanted.is_empty(), self.columns.first()) {
                asked_for[*leaf] = true;
            }
            if !self.next_batch(|leaf| asked_for[leaf])? {
                self.rows = 0;
                return Ok(None);
            }
        }
        self.next_row += 1;
        Ok(Some(self.next_row - 1))
    }
}

impl Table for ArrowTable {
    fn width(&self) -> usize {
        self.names.len()
    }

    fn names(&self) -> Option<&[String]> {
        Some(&self.names)
    }

    fn select(&mut self, columns: &[usize]) {
        self.wanted = columns.iter().map(|column| self.columns[*column]).collect();
    }

    fn next_row(&mut self, values: &mut [f64]) -> Result<bool, FileError> {
        let Some(row) = self.advance()? else { return Ok(false) };
        for (value, (leaf, entry)) in values.iter_mut().zip(&self.wanted) {
            let loaded = self.loaded.get(*leaf).and_then(Option::as_ref);
            *value = loaded.map_or(f64::NAN, |loaded| loaded.value(row, *entry, self.first[*leaf]));
        }
        Ok(true)
    }

    fn skip_row(&mut self) -> Result<bool, FileError> {
        Ok(self.advance()?.is_some())
    }

    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    fn estimated_rows(&self) -> Option<u64> {
        self.estimated_rows
    }

    fn truncated(&self) -> bool {
        self.truncated
    }
}
