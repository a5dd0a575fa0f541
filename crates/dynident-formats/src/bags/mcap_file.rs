//! Reads MCAP sequentially: <https://mcap.dev/spec>.

use super::part::{Channel, Encoding, Part};
use super::unpacked;
use crate::bytes::Bytes;
use crate::error::FileError;
use crate::kind::FileFormat;
use mcap::McapError;
use mcap::records::{ChunkHeader, Record};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Maximum length of a record, and of a decompressed chunk, bytes.
const MAX_RECORD_BYTES: usize = 1 << 28;
const RECORD_HEAD_BYTES: usize = 9;

/// A schema: name of the message type, encoding and text (or bytes) of its definition.
#[derive(Clone, Debug, Default)]
struct Schema {
    kind: String,
    encoding: String,
    data: Vec<u8>,
}

pub(super) struct McapFile {
    path: PathBuf,
    file: File,
    reader: LinearReader,
    schemas: HashMap<u16, Schema>,
    channels: HashMap<u16, Channel>,
    /// Current chunk, decompressed, and the position of its next record.
    chunk: Vec<u8>,
    at: usize,
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
        let file = unpacked::open(path)?;
        // Chunks are decompressed here and not by the library, because the lengths in them may be wrong.
        let options = LinearReaderOptions::default()
            .with_record_length_limit(MAX_RECORD_BYTES)
            .with_emit_chunks(true)
            .with_validate_data_section_crc(true);
        Ok(Self {
            path: path.to_owned(),
            file,
            reader: LinearReader::new_with_options(options),
            schemas: HashMap::new(),
            channels: HashMap::new(),
            chunk: Vec::new(),
            at: 0,
            records: 0,
            truncated: false,
            ended: false,
        })
    }

    fn broken(&self, error: &McapError) -> FileError {
        let fix = "use `mcap recover` to keep the intact part";
        FileError::broken(&self.path, FileFormat::Mcap, format!("record {}", self.records), error.to_string(), fix)
    }

    fn unpack(&mut self, header: &ChunkHeader, packed: &[u8]) -> Result<(), FileError> {
        let size = header.uncompressed_size;
        if size > MAX_RECORD_BYTES as u64 {
            return Err(self.broken(&McapError::ChunkTooLarge(size)));
        }
        let mut unpacked = Vec::new();
        // Read one byte more than declared, to detect a wrong length.
        let most = size + 1;
        let read = match header.compression.as_str() {
            "" => packed.take(most).read_to_end(&mut unpacked),
            "zstd" => zstd::stream::read::Decoder::new(packed)
                .and_then(|decoder| decoder.take(most).read_to_end(&mut unpacked)),
            "lz4" => lz4::Decoder::new(packed).and_then(|decoder| decoder.take(most).read_to_end(&mut unpacked)),
            other => return Err(self.broken(&McapError::UnsupportedCompression(other.to_owned()))),
        };
        read.map_err(|error| self.broken(&McapError::DecompressionError(error.to_string())))?;
        let calculated = crc32fast::hash(&unpacked);
        if unpacked.len() as u64 != size {
            return Err(self.broken(&McapError::UnexpectedEoc));
        }
        if header.uncompressed_crc != 0 && header.uncompressed_crc != calculated {
            return Err(self.broken(&McapError::BadChunkCrc { saved: header.uncompressed_crc, calculated }));
        }
        (self.chunk, self.at) = (unpacked, 0);
        Ok(())
    }

    fn next_in_chunk(&mut self) -> Result<Option<Record<'static>>, FileError> {
        let rest = &self.chunk[self.at..];
        if rest.is_empty() {
            return Ok(None);
        }
        let mut head = Bytes::new(rest, false);
        let body = head.u8().zip(head.u64()).and_then(|(opcode, length)| {
            let length = usize::try_from(length).ok()?;
            Some((opcode, head.take(length)?))
        });
        let Some((opcode, body)) = body else { return Err(self.broken(&McapError::UnexpectedEoc)) };
        let (length, record) = (body.len(), mcap::parse_record(opcode, body).map(Record::into_owned));
        self.at += RECORD_HEAD_BYTES + length;
        self.records += 1;
        record.map(Some).map_err(|error| self.broken(&error))
    }

    /// Stores a schema or a channel. For a message, it returns the channel and the time, and writes the bytes to
    /// `message`.
    fn take(&mut self, record: Record, message: &mut Vec<u8>) -> Result<Option<(usize, i64)>, FileError> {
        match record {
            Record::Schema { header, data } => {
                let schema = Schema { kind: header.name, encoding: header.encoding, data: data.into_owned() };
                self.schemas.insert(header.id, schema);
            }
            Record::Channel(channel) => self.add_channel(&channel),
            Record::Message { header, data } => {
                if !self.channels.contains_key(&header.channel_id) {
                    return Err(self.broken(&McapError::UnknownChannel(header.sequence, header.channel_id)));
                }
                *message = data.into_owned();
                let log_ns = i64::try_from(header.log_time).unwrap_or(i64::MAX);
                return Ok(Some((usize::from(header.channel_id), log_ns)));
            }
            _ => {}
        }
        Ok(None)
    }

    fn add_channel(&mut self, channel: &mcap::records::Channel) {
        let Schema { kind, encoding, data } = self.schemas.get(&channel.schema_id).cloned().unwrap_or_default();
        let text = |data: &[u8]| String::from_utf8_lossy(data).into_owned();
        let encoding = match (channel.message_encoding.as_str(), encoding.as_str()) {
            ("cdr", "ros2msg") => Encoding::Cdr(vec![text(&data)]),
            ("ros1", "ros1msg") => Encoding::Ros1(text(&data)),
            ("json", _) => Encoding::Json,
            ("cbor", _) => Encoding::Cbor,
            ("protobuf", "protobuf") => Encoding::Protobuf(data),
            (encoding, schema) => Encoding::Other(format!("{encoding} with a schema in {schema}")),
        };
        self.channels.insert(channel.id, Channel { topic: channel.topic.clone(), kind, encoding });
    }
}

impl Part for McapFile {
    fn next(&mut self, message: &mut Vec<u8>) -> Result<Option<(usize, i64)>, FileError> {
        while !self.ended {
            if let Some(record) = self.next_in_chunk()? {
                if let Some(found) = self.take(record, message)? {
                    return Ok(Some(found));
                }
                continue;
            }
            let wanted = match self.reader.next_event() {
                None => break,
                Some(Ok(LinearReadEvent::ReadRequest(wanted))) => wanted,
                Some(Ok(LinearReadEvent::Record { data, opcode })) => {
                    self.records += 1;
                    let record = mcap::parse_record(opcode, data).map(Record::into_owned);
                    match record.map_err(|error| self.broken(&error))? {
                        Record::Chunk { header, data } => self.unpack(&header, &data)?,
                        // Copies of channels and schemas, and indices, follow the data.
                        Record::DataEnd(_) => break,
                        record => {
                            if let Some(found) = self.take(record, message)? {
                                return Ok(Some(found));
                            }
                        }
                    }
                    continue;
                }
                Some(Err(McapError::UnexpectedEof)) => {
                    self.truncated = true;
                    break;
                }
                Some(Err(error)) => return Err(self.broken(&error)),
            };
            // Read in steps, because a wrong length may exceed the file.
            let space = self.reader.insert(wanted.clamp(1, 1 << 18));
            let read = self.file.read(space);
            let read = read.map_err(|source| FileError::Io { file: self.path.clone(), source })?;
            self.reader.notify_read(read);
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
