//! Lines of a text table: capped in length, counted, comments and blanks left out.

use crate::error::RecordingError;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

/// Longest line that is read; a humanoid's log row has a few thousand bytes.
const MAX_LINE_BYTES: usize = 1 << 20;

/// The lines that matter of one file.
pub(super) struct Lines {
    path: PathBuf,
    reader: BufReader<Box<dyn Read + Send>>,
    buffer: Vec<u8>,
    /// 1-based number of the line last read.
    number: u64,
    /// Whether the line last read ended with a newline: a last line without one may be cut off.
    complete: bool,
}

impl core::fmt::Debug for Lines {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Lines").field("path", &self.path).field("number", &self.number).finish_non_exhaustive()
    }
}

impl Lines {
    /// The lines of `text`, which stands in the file at `path`.
    pub(super) fn new(path: &Path, text: Box<dyn Read + Send>) -> Self {
        let reader = BufReader::with_capacity(1 << 18, text);
        Self { path: path.to_owned(), reader, buffer: Vec::new(), number: 0, complete: true }
    }

    pub(super) fn number(&self) -> u64 {
        self.number
    }

    pub(super) fn complete(&self) -> bool {
        self.complete
    }

    /// Whether nothing follows the line last read.
    pub(super) fn at_end(&mut self) -> Result<bool, RecordingError> {
        let rest = self.reader.fill_buf();
        Ok(rest.map_err(|source| RecordingError::Io { file: self.path.clone(), source })?.is_empty())
    }

    /// The line that [`advance`](Self::advance) moved to, without byte-order mark, newline and outer blanks.
    pub(super) fn line(&self) -> &[u8] {
        let line = self.buffer.strip_suffix(b"\n").unwrap_or(&self.buffer);
        let line = if self.number == 1 { line.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(line) } else { line };
        line.strip_suffix(b"\r").unwrap_or(line)
    }

    /// Moves to the next line that is neither blank nor a comment; false at the end of the file.
    pub(super) fn advance(&mut self) -> Result<bool, RecordingError> {
        loop {
            self.buffer.clear();
            let limit = MAX_LINE_BYTES as u64 + 1;
            let read = self
                .reader
                .by_ref()
                .take(limit)
                .read_until(b'\n', &mut self.buffer)
                .map_err(|source| RecordingError::Io { file: self.path.clone(), source })?;
            if read == 0 {
                return Ok(false);
            }
            self.number += 1;
            self.complete = self.buffer.ends_with(b"\n");
            if !self.complete && self.buffer.len() > MAX_LINE_BYTES {
                return Err(RecordingError::LineTooLong {
                    file: self.path.clone(),
                    line: self.number,
                    limit: MAX_LINE_BYTES,
                });
            }
            let first = self.line().iter().find(|byte| !byte.is_ascii_whitespace());
            if first.is_some_and(|byte| *byte != b'#') {
                return Ok(true);
            }
        }
    }
}
