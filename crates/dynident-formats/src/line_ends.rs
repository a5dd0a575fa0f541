//! Converts text in UTF-16, and text whose lines end with a carriage return only, to UTF-8 with line feeds.

use std::io::{BufRead, Read, Result};

/// The text of `reader`, which begins with `head`; in UTF-16 if it begins with a byte-order mark.
pub(crate) fn plain(mut reader: impl BufRead + Send + 'static, head: &[u8]) -> Box<dyn Read + Send> {
    let big_endian = match head {
        [0xFF, 0xFE, ..] => Some(false),
        [0xFE, 0xFF, ..] => Some(true),
        _ => None,
    };
    let units = |wanted: u8| match big_endian {
        None => head.contains(&wanted),
        Some(big_endian) => {
            let unit = if big_endian { [0, wanted] } else { [wanted, 0] };
            head.chunks_exact(2).any(|pair| pair == unit)
        }
    };
    let returns_only = units(b'\r') && !units(b'\n');
    if big_endian.is_none() && !returns_only {
        return Box::new(reader);
    }
    if big_endian.is_some() {
        // The byte-order mark is one of the bytes of `head`, which are still in the reader.
        reader.consume(2);
    }
    Box::new(Plain { reader, big_endian, returns_only, high: None, ready: Vec::new(), at: 0 })
}

struct Plain<R> {
    reader: R,
    /// Byte order of UTF-16; `None` for text that is not in UTF-16.
    big_endian: Option<bool>,
    returns_only: bool,
    /// First half of a character that UTF-16 stores in two parts.
    high: Option<u16>,
    /// Converted bytes, and how many of them were read.
    ready: Vec<u8>,
    at: usize,
}

impl<R: BufRead> Plain<R> {
    fn push(&mut self, c: char) {
        let c = if self.returns_only && c == '\r' { '\n' } else { c };
        self.ready.extend_from_slice(c.encode_utf8(&mut [0; 4]).as_bytes());
    }

    fn push_unit(&mut self, unit: u16) {
        let units = match self.high.take() {
            Some(high) => vec![high, unit],
            None if (0xD800..0xDC00).contains(&unit) => {
                self.high = Some(unit);
                return;
            }
            None => vec![unit],
        };
        for c in char::decode_utf16(units) {
            self.push(c.unwrap_or(char::REPLACEMENT_CHARACTER));
        }
    }

    /// Converts the next bytes; false at the end.
    fn fill(&mut self) -> Result<bool> {
        self.at = 0;
        self.ready.clear();
        let Some(big_endian) = self.big_endian else {
            let bytes = self.reader.fill_buf()?;
            self.ready.extend(bytes.iter().map(|byte| if *byte == b'\r' { b'\n' } else { *byte }));
            let read = bytes.len();
            self.reader.consume(read);
            return Ok(read > 0);
        };
        let mut block = Vec::new();
        self.reader.by_ref().take(1 << 12).read_to_end(&mut block)?;
        for pair in block.chunks(2) {
            match *pair {
                [first, second] => {
                    let pair = [first, second];
                    self.push_unit(if big_endian { u16::from_be_bytes(pair) } else { u16::from_le_bytes(pair) });
                }
                _ => self.push(char::REPLACEMENT_CHARACTER),
            }
        }
        Ok(!block.is_empty())
    }
}

impl<R: BufRead> Read for Plain<R> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        while self.at == self.ready.len() {
            if !self.fill()? {
                return Ok(0);
            }
        }
        let count = buffer.len().min(self.ready.len() - self.at);
        buffer[..count].copy_from_slice(&self.ready[self.at..self.at + count]);
        self.at += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::plain;
    use std::io::{Cursor, Read};

    fn read(bytes: &[u8]) -> String {
        let mut text = String::new();
        plain(Cursor::new(bytes.to_vec()), bytes).read_to_string(&mut text).unwrap();
        text
    }

    #[test]
    fn text_of_other_programs_becomes_plain() {
        // Longer than a block, with a character of two units.
        let text = format!("t,\u{b0},\u{1d70f}\r\n{}", "0.5,1,2\r\n".repeat(900));
        let marked = format!("\u{feff}{text}");
        let little: Vec<u8> = marked.encode_utf16().flat_map(u16::to_le_bytes).collect();
        let big: Vec<u8> = marked.encode_utf16().flat_map(u16::to_be_bytes).collect();
        assert_eq!([read(&little), read(&big)], [text.clone(), text.clone()]);
        assert_eq!(read(text.as_bytes()), text);
        assert_eq!(read(b"a,b\r1,2\r"), "a,b\n1,2\n");
        let old: Vec<u8> = "\u{feff}a\r1\r".encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert_eq!(read(&old), "a\n1\n");
        // Half a character, half a unit.
        assert_eq!(read(&[0xFF, 0xFE, 0, 0xD8, 0x61, 0, 0x62]), "\u{fffd}a\u{fffd}");
    }
}
