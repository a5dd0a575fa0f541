//! Reads the lines of a text table, without comments and blank lines, with a maximum length.

use crate::error::RecordingError;
use core::ops::Range;
use memchr::memchr;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

/// Maximum length of a line; a row of a humanoid's log has a few thousand bytes.
const MAX_LINE_BYTES: usize = 1 << 20;
/// Initial size of the buffer, bytes. Reads of this size bypass the buffer of an underlying reader.
const BUFFER_BYTES: usize = 1 << 19;

pub(super) struct Lines {
    path: PathBuf,
    text: Box<dyn Read + Send>,
    /// Bytes that were read; the current line is not copied.
    buffer: Vec<u8>,
    filled: usize,
    /// Range of the current line in the buffer, including its newline.
    line: Range<usize>,
    ended: bool,
    /// 1-based number of the current line.
    number: u64,
    /// Whether the current line ends with a newline. A last line without a newline may be truncated.
    complete: bool,
}

impl core::fmt::Debug for Lines {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Lines").field("path", &self.path).field("number", &self.number).finish_non_exhaustive()
    }
}

impl Lines {
    pub(super) fn new(path: &Path, text: Box<dyn Read + Send>) -> Self {
        Self {
            path: path.to_owned(),
            text,
            buffer: vec![0; BUFFER_BYTES],
            filled: 0,
            line: 0..0,
            ended: false,
            number: 0,
            complete: true,
        }
    }

    pub(super) fn number(&self) -> u64 {
        self.number
    }

    pub(super) fn complete(&self) -> bool {
        self.complete
    }

    pub(super) fn at_end(&mut self) -> Result<bool, RecordingError> {
        while self.line.end == self.filled && !self.ended {
            self.read_on()?;
        }
        Ok(self.line.end == self.filled)
    }

    /// Up to `most` bytes after the current line, which remain to be read.
    pub(super) fn ahead(&mut self, most: usize) -> Result<&[u8], RecordingError> {
        while self.filled - self.line.end < most && !self.ended {
            self.read_on()?;
        }
        Ok(&self.buffer[self.line.end..self.filled.min(self.line.end + most)])
    }

    /// Moves over `count` lines of any content.
    pub(super) fn skip(&mut self, count: u64) -> Result<(), RecordingError> {
        (0..count).try_for_each(|_| self.next_line())
    }

    /// The current line (see [`advance`](Self::advance)) without byte-order mark, newline and carriage return.
    pub(super) fn line(&self) -> &[u8] {
        let line = &self.buffer[self.line.clone()];
        let line = line.strip_suffix(b"\n").unwrap_or(line);
        let line = if self.number == 1 { line.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(line) } else { line };
        line.strip_suffix(b"\r").unwrap_or(line)
    }

    /// Moves to the next line that is neither blank nor a comment; returns false at the end of the file.
    pub(super) fn advance(&mut self) -> Result<bool, RecordingError> {
        loop {
            self.next_line()?;
            if self.line.is_empty() {
                return Ok(false);
            }
            let first = self.line().iter().find(|byte| !byte.is_ascii_whitespace());
            if first.is_some_and(|byte| *byte != b'#') {
                return Ok(true);
            }
        }
    }

    /// Moves to the next line; the range is empty at the end of the file.
    fn next_line(&mut self) -> Result<(), RecordingError> {
        self.line.start = self.line.end;
        let mut seen = 0;
        loop {
            let found = memchr(b'\n', &self.buffer[self.line.start + seen..self.filled]);
            seen = found.map_or(self.filled - self.line.start, |at| seen + at + 1);
            self.line.end = self.line.start + seen;
            if found.is_some() || self.ended || seen > MAX_LINE_BYTES {
                self.complete = found.is_some();
                break;
            }
            self.read_on()?;
        }
        self.number += u64::from(seen > 0);
        if seen > MAX_LINE_BYTES + usize::from(self.complete) {
            let file = self.path.clone();
            return Err(RecordingError::LineTooLong { file, line: self.number, limit: MAX_LINE_BYTES });
        }
        Ok(())
    }

    /// Moves the current line to the start of the buffer and reads more bytes after it.
    fn read_on(&mut self) -> Result<(), RecordingError> {
        self.buffer.copy_within(self.line.start..self.filled, 0);
        self.filled -= self.line.start;
        self.line = 0..self.line.len();
        if self.filled == self.buffer.len() {
            self.buffer.resize(2 * self.filled, 0);
        }
        let read = loop {
            match self.text.read(&mut self.buffer[self.filled..]) {
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                read => break read,
            }
        };
        let read = read.map_err(|source| RecordingError::Io { file: self.path.clone(), source })?;
        self.ended = read == 0;
        self.filled += read;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A reader that returns a few bytes at a time.
    struct Dribble(std::io::Cursor<Vec<u8>>, usize);

    impl Read for Dribble {
        fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
            let most = buffer.len().min(self.1);
            self.0.read(&mut buffer[..most])
        }
    }

    fn lines(text: &[u8], most: usize) -> Result<Vec<(u64, Vec<u8>, bool)>, RecordingError> {
        let mut lines = Lines::new(Path::new("log"), Box::new(Dribble(std::io::Cursor::new(text.to_vec()), most)));
        let mut found = Vec::new();
        while lines.advance()? {
            found.push((lines.number(), lines.line().to_vec(), lines.complete()));
        }
        assert!(lines.at_end()?);
        Ok(found)
    }

    #[test]
    fn lines_are_independent_of_the_read_size() {
        let text = b"\xEF\xBB\xBFa,b\r\n\n  # no\n1,2\n   \n3,4";
        for most in [1, 2, 5, 100] {
            let [first, second, third] = &lines(text, most).unwrap()[..] else { panic!("three lines") };
            assert_eq!((first.0, &first.1[..], first.2), (1, &b"a,b"[..], true));
            assert_eq!((second.0, &second.1[..], second.2), (4, &b"1,2"[..], true));
            assert_eq!((third.0, &third.1[..], third.2), (6, &b"3,4"[..], false));
        }
        assert!(lines(b"", 1).unwrap().is_empty());
    }

    #[test]
    fn a_line_may_be_a_megabyte_long_and_no_longer() {
        for (length, newline, is_read) in [(0, true, true), (0, false, true), (1, true, false), (1, false, false)] {
            let mut text = vec![b'1'; MAX_LINE_BYTES + length];
            text.extend(newline.then_some(b'\n'));
            assert_eq!(lines(&text, usize::MAX).is_ok(), is_read, "{length} {newline}");
            assert_eq!(lines(&text, 4096).is_ok(), is_read, "{length} {newline}");
        }
    }
}
