//! A file of any supported format as a source of rows.

use super::format::{Header, LogFormat};
use super::part::PartTable;
use super::sage::SageTable;
use super::source::{LogGroup, LogSource, LogTable};
use super::split_stamps::SplitStamps;
use super::text::TextTable;
use crate::error::RecordingError;
use crate::place::LogPlace;
use dynident_files::SeenFiles;
use dynident_formats::{Contents, FileError, FileFormat, ReadLimits, SAGE_FILES, Table};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A file with rows of numbers in any supported format (`docs/src/logs.md`), detected from its content. The folder of a
/// rosbag2, LeRobot or SAGE recording is treated as a file.
///
/// A log is read several times. Every pass and every clone compares the file's length, modification time and inode with
/// those of the first pass; a replaced file is an error.
#[derive(Clone, Debug)]
pub struct FileLog {
    path: PathBuf,
    header: Header,
    delimiter: Option<char>,
    transposed: bool,
    part: Option<String>,
    seen: Arc<SeenFiles>,
}

impl FileLog {
    /// A file at `path`. `header` and `delimiter` of `format` apply to text, `part` to a file with several recordings.
    /// Does not read the file yet.
    pub fn new(path: &Path, format: &LogFormat) -> Self {
        Self {
            path: path.to_owned(),
            header: format.header,
            delimiter: format.delimiter,
            transposed: format.transposed,
            part: format.part.clone(),
            seen: Arc::default(),
        }
    }

    /// A file at `path`, without a format: header and delimiter of a text file are detected.
    pub fn described_by_itself(path: &Path) -> Self {
        Self {
            path: path.to_owned(),
            header: Header::Auto,
            delimiter: None,
            transposed: false,
            part: None,
            seen: Arc::default(),
        }
    }

    /// Opens the file for one pass over its rows; also returns its format.
    ///
    /// # Errors
    /// If it cannot be read, does not contain a table, or changed since the first pass.
    pub fn open_with_format(&self) -> Result<(FileFormat, Box<dyn LogTable>), RecordingError> {
        // Errors in listing the files are reported when the file is opened.
        for file in dynident_formats::files(&self.path).unwrap_or_default() {
            if self.seen.is_unchanged(&file).is_ok_and(|unchanged| !unchanged) {
                return Err(RecordingError::Changed { file });
            }
        }
        let opened = if self.transposed {
            dynident_formats::open_transposed(&self.path, &ReadLimits::default())?
        } else {
            dynident_formats::open(&self.path)?
        };
        let table: Box<dyn LogTable> = match opened.contents {
            Contents::Text(_) if opened.format == FileFormat::Sage => Box::new(SageTable::open(&self.path)?),
            Contents::Text(text) => Box::new(TextTable::open(&self.path, text, self.header, self.delimiter)?),
            Contents::Table(table) => Box::new(FileTable { label: self.label(), table, rows: 0 }),
        };
        let table = SplitStamps::joined(table);
        match &self.part {
            Some(part) => Ok((opened.format, Box::new(PartTable::new(table, part)?))),
            None => Ok((opened.format, table)),
        }
    }
}

impl LogSource for FileLog {
    fn label(&self) -> String {
        self.path.display().to_string()
    }

    fn open(&self) -> Result<Box<dyn LogTable>, RecordingError> {
        self.open_with_format().map(|(_, table)| table)
    }

    fn path(&self) -> Option<&Path> {
        Some(&self.path)
    }

    /// Number of rows from the file's metadata. For text, it is estimated from the file size and the length of the
    /// first lines.
    fn estimated_rows(&self) -> Option<u64> {
        use std::io::Read;
        match dynident_formats::open(&self.path).ok()?.contents {
            Contents::Table(table) => table.estimated_rows(),
            Contents::Text(mut text) => {
                // In a SAGE recording, the last text file contains the measurements.
                let files = dynident_formats::files(&self.path).ok()?;
                let file = files.iter().find(|file| file.ends_with(SAGE_FILES[1])).unwrap_or(&self.path);
                let size = std::fs::metadata(file).ok()?.len();
                let mut head = Vec::new();
                text.by_ref().take(1 << 16).read_to_end(&mut head).ok()?;
                let lines = head.split(|byte| *byte == b'\n').count().max(2) - 1;
                Some(size * lines as u64 / (head.len() as u64).max(1))
            }
        }
    }
}

#[derive(Debug)]
struct FileTable {
    label: String,
    table: Box<dyn Table>,
    rows: u64,
}

impl LogTable for FileTable {
    fn width(&self) -> usize {
        self.table.width()
    }

    fn names(&self) -> Option<&[String]> {
        self.table.names()
    }

    fn has_numbered_entries(&self) -> bool {
        self.table.has_numbered_entries()
    }

    fn groups(&self) -> Vec<LogGroup> {
        let groups = self.table.groups().into_iter();
        groups.map(|group| LogGroup { name: group.name, columns: group.columns, time: group.time }).collect()
    }

    fn notes(&self) -> Vec<String> {
        self.table.notes()
    }

    fn select(&mut self, fields: &[usize]) {
        self.table.select(fields);
    }

    fn next_row(&mut self, values: &mut [f64]) -> Result<bool, RecordingError> {
        let found = self.table.next_row(values)?;
        self.rows += u64::from(found);
        Ok(found)
    }

    fn skip_row(&mut self) -> Result<bool, RecordingError> {
        let found = self.table.skip_row()?;
        self.rows += u64::from(found);
        Ok(found)
    }

    fn all_rows(&mut self, each: &mut dyn FnMut(usize, &[f64])) -> Result<(), RecordingError> {
        let rows = &mut self.rows;
        self.table.all_rows(&mut |group, row| {
            *rows += 1;
            each(group, row);
        })?;
        Ok(())
    }

    fn place(&self) -> LogPlace {
        match self.rows.checked_sub(1) {
            Some(row) => LogPlace::Row { log: self.label.clone(), row },
            None => LogPlace::Whole { log: self.label.clone() },
        }
    }

    fn truncated(&self) -> Option<LogPlace> {
        self.table.truncated().then(|| self.place())
    }
}

impl From<FileError> for RecordingError {
    fn from(error: FileError) -> Self {
        match error {
            FileError::Io { file, source } => Self::Io { file, source },
            other => Self::File(other),
        }
    }
}
