//! MCAP, read from front to end: <https://mcap.dev/spec>.

use super::messages::{Channel, Encoding, Part};
use crate::error::FileError;
use crate::kind::FileFormat;
use mcap::McapError;
use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Longest record outside of chunks, and longest one in a chunk.
const LONGEST_RECORD: usize = 1 << 28;

pub(super) struct McapFile {
    path: PathBuf,
    file: File,
    reader: LinearReader,
    schemas: HashMap<u16, (String, String, String)>,
    channels: HashMap<u16, Channel>,
    records: u64,
    truncated: bool,
    ended: bool,
}

impl core::fmt::Debug for McapFile {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("McapFile").field("path", &self.path).field("records", &self.records).finish_non_exhaustive()
    }
}

impl McapFile {
    pub(super) fn open(path: &Path) -> Result<Self, FileError> {
        let file = File::open(path).map_err(|source| FileError::Io { file: path.to_owned(), source })?;
        let options =
            LinearReaderOptions::default().with_record_length_limit(LONGEST_RECORD).with_validate_chunk_crcs(true);
        Ok(Self {
            path: path.to_owned(),
            file,
            reader: LinearReader::new_with_options(options),
            schemas: HashMap::new(),
            channels: HashMap::new(),
            records: 0,
            truncated: false,
            ended: false,
        })
    }

    fn broken(&self, error: &McapError) -> FileError {
        let fix = "`mcap recover` keeps what is whole";
        FileError::broken(&self.path, FileFormat::Mcap, format!("record {}", self.records), error.to_string(), fix)
    }

    fn add_channel(&mut self, channel: &mcap::records::Channel) {
        let none = (String::new(), String::new(), String::new());
        let (kind, schema_encoding, text) = self.schemas.get(&channel.schema_id).cloned().unwrap_or(none);
        let encoding = match (channel.message_encoding.as_str(), schema_encoding.as_str()) {
            ("cdr", "ros2msg") => Encoding::Cdr(vec![text]),
            ("json", _) => Encoding::Json,
            (encoding, schema) => Encoding::Other(format!("{encoding} with a schema in {schema}")),
        };
        self.channels.insert(channel.id, Channel { topic: channel.topic.clone(), kind, encoding });
    }
}

impl Part for McapFile {
    fn next(&mut self, message: &mut Vec<u8>) -> Result<Option<(usize, i64)>, FileError> {
        while !self.ended {
            let (record, wanted) = match self.reader.next_event() {
                None => break,
                Some(Ok(LinearReadEvent::ReadRequest(wanted))) => (None, wanted),
                Some(Ok(LinearReadEvent::Record { data, opcode })) => {
                    self.records += 1;
                    (Some(mcap::parse_record(opcode, data).map(Record::into_owned)), 0)
                }
                Some(Err(McapError::UnexpectedEof)) => {
                    self.truncated = true;
                    break;
                }
                Some(Err(error)) => return Err(self.broken(&error)),
            };
            match record {
                None => {
                    // In steps: what a broken length asks for may not be there.
                    let space = self.reader.insert(wanted.clamp(1, 1 << 18));
                    let read = self.file.read(space);
                    let read = read.map_err(|source| FileError::Io { file: self.path.clone(), source })?;
                    self.reader.notify_read(read);
                }
                Some(Err(error)) => return Err(self.broken(&error)),
                Some(Ok(Record::Schema { header, data })) => {
                    let text = String::from_utf8_lossy(&data).into_owned();
                    self.schemas.insert(header.id, (header.name, header.encoding, text));
                }
                Some(Ok(Record::Channel(channel))) => self.add_channel(&channel),
                Some(Ok(Record::Message { header, data })) => {
                    if !self.channels.contains_key(&header.channel_id) {
                        return Err(self.broken(&McapError::UnknownChannel(header.sequence, header.channel_id)));
                    }
                    *message = data.into_owned();
                    return Ok(Some((
                        usize::from(header.channel_id),
                        i64::try_from(header.log_time).unwrap_or(i64::MAX),
                    )));
                }
                // Behind the data lie copies of channels and schemas, and indices.
                Some(Ok(Record::DataEnd(_))) => break,
                Some(Ok(_)) => {}
            }
        }
        self.ended = true;
        Ok(None)
    }

    fn channel(&self, index: usize) -> Option<&Channel> {
        self.channels.get(&u16::try_from(index).ok()?)
    }

    fn truncated(&self) -> bool {
        self.truncated
    }
}
