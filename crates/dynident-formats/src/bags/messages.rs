//! Messages of all parts of a recording in sequence.

use super::part::{Channel, Part};
use super::{database, mcap_file, ros1_bag, ulog};
use crate::error::FileError;
use crate::kind::FileFormat;
use std::path::{Path, PathBuf};

#[derive(Debug)]
pub(super) struct Messages {
    parts: Vec<(PathBuf, FileFormat)>,
    current: usize,
    part: Option<Box<dyn Part>>,
    truncated: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Header {
    /// Index of the part, and of the channel in it.
    pub(super) channel: (usize, usize),
    pub(super) log_ns: i64,
}

impl Messages {
    pub(super) fn new(parts: &[(PathBuf, FileFormat)]) -> Self {
        Self { parts: parts.to_vec(), current: 0, part: None, truncated: false }
    }

    pub(super) fn next(&mut self, message: &mut Vec<u8>) -> Result<Option<Header>, FileError> {
        while let Some((path, format)) = self.parts.get(self.current) {
            let part = match &mut self.part {
                Some(part) => part,
                None => self.part.insert(begin(path, *format)?),
            };
            if let Some((channel, log_ns)) = part.next(message)? {
                return Ok(Some(Header { channel: (self.current, channel), log_ns }));
            }
            self.truncated |= part.truncated();
            // Keep the last part, because its channels are still needed.
            if self.current + 1 == self.parts.len() {
                return Ok(None);
            }
            self.part = None;
            self.current += 1;
        }
        Ok(None)
    }

    pub(super) fn channel(&self, header: Header) -> Option<&Channel> {
        self.part.as_ref()?.channel(header.channel.1)
    }

    pub(super) fn truncated(&self) -> bool {
        self.truncated
    }
}

fn begin(path: &Path, format: FileFormat) -> Result<Box<dyn Part>, FileError> {
    match format {
        FileFormat::Mcap => Ok(Box::new(mcap_file::McapFile::open(path)?)),
        FileFormat::Ros1Bag => Ok(Box::new(ros1_bag::Ros1Bag::open(path)?)),
        FileFormat::Ulog => Ok(Box::new(ulog::Ulog::open(path)?)),
        _ => Ok(Box::new(database::Database::open(path)?)),
    }
}
