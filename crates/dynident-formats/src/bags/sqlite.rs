//! Reads the rows of tables in an SQLite file sequentially. Format: <https://www.sqlite.org/fileformat2.html>.

use super::unpacked;
use crate::error::FileError;
use crate::kind::FileFormat;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

const MAX_RECORD_BYTES: u64 = 1 << 28;
/// Maximum depth of a table's B-tree; 2^64 rows need less.
const MAX_TREE_DEPTH: usize = 20;

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Null,
    Integer(i64),
    Real(f64),
    Text(String),
    Blob(Vec<u8>),
}

#[derive(Debug)]
pub(super) struct Sqlite {
    path: PathBuf,
    file: File,
    page_size: usize,
    /// Usable bytes of a page.
    usable: usize,
    pages: u64,
}

/// A traversal of the rows of one table, by row number.
#[derive(Debug)]
pub(super) struct Rows {
    /// Pages from the root of the tree down to the current one, with the next cell of each.
    way: Vec<(Vec<u8>, u64, usize)>,
    /// Number of pages read. It exceeds the number of pages in the file only if pages refer to each other in a
    /// circle.
    read: u64,
}

fn number(bytes: &[u8], at: usize, count: usize) -> Option<u64> {
    Some(bytes.get(at..at.checked_add(count)?)?.iter().fold(0, |all, byte| all << 8 | u64::from(*byte)))
}

fn varint(bytes: &[u8], at: usize) -> Option<(u64, usize)> {
    let mut value = 0_u64;
    for k in 0..9 {
        let byte = *bytes.get(at + k)?;
        if k == 8 {
            return Some((value << 8 | u64::from(byte), at + 9));
        }
        value = value << 7 | u64::from(byte & 127);
        if byte < 128 {
            return Some((value, at + k + 1));
        }
    }
    None
}

impl Sqlite {
    pub(super) fn open(path: &Path) -> Result<Self, FileError> {
        let io = |source| FileError::Io { file: path.to_owned(), source };
        let mut file = unpacked::open(path)?;
        let mut head = Vec::new();
        file.by_ref().take(100).read_to_end(&mut head).map_err(io)?;
        let size = file.seek(SeekFrom::End(0)).map_err(io)?;
        let mut found = Self { path: path.to_owned(), file, page_size: 0, usable: 0, pages: 0 };
        if head.len() < 100 {
            return Err(found.broken("its header", "it is truncated"));
        }
        let page_size = match number(&head, 16, 2) {
            Some(1) => 65536,
            Some(size) if size.is_power_of_two() && size >= 512 => size as usize,
            _ => return Err(found.broken("its header", "invalid page size")),
        };
        if number(&head, 56, 4) != Some(1) {
            return Err(found.broken("its header", "its text is not UTF-8"));
        }
        found.page_size = page_size;
        found.usable = page_size.saturating_sub(usize::from(head[20]));
        found.pages = size / page_size as u64;
        if found.usable < 480 {
            return Err(found.broken("its header", "its pages have no usable bytes"));
        }
        // An interrupted recorder leaves rows in a -wal file.
        let beside = format!("{}-wal", path.display());
        if std::fs::metadata(&beside).is_ok_and(|wal| wal.len() > 0) {
            return Err(FileError::broken(
                path,
                FileFormat::Rosbag2,
                "the file",
                "rows are still in its -wal file: the recording was interrupted",
                "open and close it once with sqlite3 (`sqlite3 FILE .tables`)",
            ));
        }
        Ok(found)
    }

    pub(super) fn broken(&self, place: impl Into<String>, problem: impl Into<String>) -> FileError {
        FileError::broken(
            &self.path,
            FileFormat::Rosbag2,
            place,
            problem,
            "record or copy it again, or try `sqlite3 FILE .recover`",
        )
    }

    fn page(&mut self, index: u64) -> Result<Vec<u8>, FileError> {
        if index == 0 || index > self.pages {
            return Err(self.broken(format!("page {index}"), "it is missing: the file is truncated"));
        }
        let io = |source| FileError::Io { file: self.path.clone(), source };
        self.file.seek(SeekFrom::Start((index - 1) * self.page_size as u64)).map_err(io)?;
        let mut page = vec![0; self.page_size];
        self.file.read_exact(&mut page).map_err(io)?;
        Ok(page)
    }

    /// The tables: name, first page, and the SQL statement that created each.
    pub(super) fn tables(&mut self) -> Result<Vec<(String, u64, String)>, FileError> {
        let mut rows = self.rows(1)?;
        let mut tables = Vec::new();
        while let Some((_, row)) = self.next(&mut rows)? {
            if let [Value::Text(kind), Value::Text(name), _, Value::Integer(page), Value::Text(text), ..] = &row[..]
                && kind == "table"
            {
                tables.push((name.clone(), u64::try_from(*page).unwrap_or(0), text.clone()));
            }
        }
        Ok(tables)
    }

    pub(super) fn rows(&mut self, page: u64) -> Result<Rows, FileError> {
        Ok(Rows { way: vec![(self.page(page)?, page, 0)], read: 1 })
    }

    pub(super) fn next(&mut self, rows: &mut Rows) -> Result<Option<(i64, Vec<Value>)>, FileError> {
        while let Some((page, index, cell)) = rows.way.last_mut() {
            let index = *index;
            let place = || format!("page {index}");
            let begin = if index == 1 { 100 } else { 0 };
            let kind = page[begin];
            let (Some(count), true) = (number(page, begin + 3, 2), matches!(kind, 5 | 13)) else {
                return Err(self.broken(place(), "it is not a page of a table"));
            };
            let head = begin + if kind == 5 { 12 } else { 8 };
            let at = *cell;
            *cell += 1;
            if at as u64 > count || kind == 13 && at as u64 == count {
                rows.way.pop();
                continue;
            }
            let child = if kind == 5 && at as u64 == count {
                number(page, begin + 8, 4)
            } else {
                let Some(offset) = number(page, head + 2 * at, 2) else {
                    return Err(self.broken(place(), "its list of cells is truncated"));
                };
                if kind == 13 {
                    let page = core::mem::take(page);
                    let row = self.row(&page, offset as usize);
                    if let Some((slot, _, _)) = rows.way.last_mut() {
                        *slot = page;
                    }
                    return row?.map(Some).ok_or_else(|| self.broken(place(), format!("row {at} is invalid")));
                }
                number(page, offset as usize, 4)
            };
            let child = child.ok_or_else(|| self.broken(place(), "a cell is truncated"))?;
            rows.read += 1;
            if rows.way.len() >= MAX_TREE_DEPTH || rows.read > self.pages {
                return Err(self.broken(place(), "its pages refer to each other in a circle"));
            }
            let page = self.page(child)?;
            rows.way.push((page, child, 0));
        }
        Ok(None)
    }

    fn row(&mut self, page: &[u8], at: usize) -> Result<Option<(i64, Vec<Value>)>, FileError> {
        let Some((length, at)) = varint(page, at) else { return Ok(None) };
        let Some((id, at)) = varint(page, at) else { return Ok(None) };
        if length > MAX_RECORD_BYTES || length > self.pages * self.page_size as u64 {
            return Ok(None);
        }
        let length = length as usize;
        // Length of the part in this page; the rest is on overflow pages (section 1.6 of the format).
        let most = self.usable - 35;
        let kept = if length <= most {
            length
        } else {
            let least = (self.usable - 12) * 32 / 255 - 23;
            let kept = least + (length - least) % (self.usable - 4);
            if kept <= most { kept } else { least }
        };
        let Some(first) = page.get(at..at + kept) else { return Ok(None) };
        let mut payload = first.to_vec();
        if kept < length {
            let Some(mut next) = number(page, at + kept, 4) else { return Ok(None) };
            while payload.len() < length {
                let page = self.page(next)?;
                let part = (length - payload.len()).min(self.usable - 4);
                payload.extend_from_slice(&page[4..4 + part]);
                next = number(&page, 0, 4).unwrap_or(0);
            }
        }
        Ok(record(&payload).map(|values| (id as i64, values)))
    }
}

fn record(payload: &[u8]) -> Option<Vec<Value>> {
    let (head, mut at) = varint(payload, 0)?;
    let head = usize::try_from(head).ok()?;
    let mut body = head;
    let mut values = Vec::new();
    while at < head {
        let (kind, next) = varint(payload, at)?;
        at = next;
        let size = match kind {
            0 | 8 | 9 => 0,
            1..=4 => kind as usize,
            5 => 6,
            6 | 7 => 8,
            10 | 11 => return None,
            _ => usize::try_from((kind - 12) / 2).ok()?,
        };
        let bytes = payload.get(body..body.checked_add(size)?)?;
        body += size;
        values.push(match kind {
            0 => Value::Null,
            1..=6 => {
                let bits = 64 - 8 * size as u32;
                Value::Integer((number(bytes, 0, size)? << bits) as i64 >> bits)
            }
            7 => Value::Real(f64::from_bits(number(bytes, 0, 8)?)),
            8 | 9 => Value::Integer(kind as i64 - 8),
            _ if kind % 2 == 0 => Value::Blob(bytes.to_vec()),
            _ => Value::Text(String::from_utf8_lossy(bytes).into_owned()),
        });
    }
    Some(values)
}
