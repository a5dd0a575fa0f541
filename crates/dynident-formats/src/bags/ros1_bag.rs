//! Reads ROS 1 bags (version 2.0) sequentially: <http://wiki.ros.org/Bags/Format/2.0>.

use super::part::{Channel, Encoding, Part};
use super::unpacked;
use crate::bytes::Bytes;
use crate::error::FileError;
use crate::kind::FileFormat;
use std::collections::HashMap;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

const MAGIC: &[u8] = b"#ROSBAG V2.0\n";
/// Maximum length of the header or the data of a record, and of an unpacked chunk, bytes.
const MAX_RECORD_BYTES: u32 = 1 << 28;

/// Maximum length of the definitions of all connections, bytes, because compressed definitions could fill the memory.
const MAX_DEFINITION_BYTES: usize = 1 << 26;

const MESSAGE: u8 = 2;
const CHUNK: u8 = 5;
const CONNECTION: u8 = 7;

/// Header and data of a record.
type Record = (Vec<u8>, Vec<u8>);

pub(super) struct Ros1Bag {
    path: PathBuf,
    reader: Box<dyn Read + Send>,
    channels: HashMap<usize, Channel>,
    /// Number of bytes of definitions that were read.
    definition_bytes: usize,
    /// The current chunk, unpacked, and the position of its next record.
    chunk: Vec<u8>,
    at: usize,
    records: u64,
    truncated: bool,
}

impl core::fmt::Debug for Ros1Bag {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Ros1Bag").field("path", &self.path).field("records", &self.records).finish_non_exhaustive()
    }
}

/// Fields of the header of a record or connection; each is `name=value`, preceded by its length.
fn fields(bytes: &[u8]) -> Option<HashMap<&[u8], &[u8]>> {
    let mut bytes = Bytes::new(bytes, false);
    let mut found = HashMap::new();
    while bytes.left() > 0 {
        let length = bytes.u32()? as usize;
        let field = bytes.take(length)?;
        let at = field.iter().position(|byte| *byte == b'=')?;
        found.insert(&field[..at], &field[at + 1..]);
    }
    Some(found)
}

fn word(fields: &HashMap<&[u8], &[u8]>, name: &str) -> Option<u32> {
    Bytes::new(fields.get(name.as_bytes())?, false).u32()
}

fn text(fields: &HashMap<&[u8], &[u8]>, name: &str) -> Option<String> {
    fields.get(name.as_bytes()).map(|bytes| String::from_utf8_lossy(bytes).into_owned())
}

impl Ros1Bag {
    pub(super) fn open(path: &Path) -> Result<Self, FileError> {
        let mut reader = BufReader::with_capacity(1 << 16, unpacked::open(path)?);
        let mut magic = [0; MAGIC.len()];
        let read = reader.read_exact(&mut magic);
        let bag = Self {
            path: path.to_owned(),
            reader: Box::new(reader),
            channels: HashMap::new(),
            definition_bytes: 0,
            chunk: Vec::new(),
            at: 0,
            records: 0,
            truncated: false,
        };
        match read {
            Ok(()) if magic == MAGIC => Ok(bag),
            _ => Err(bag.broken("its version is not 2.0")),
        }
    }

    fn broken(&self, problem: impl Into<String>) -> FileError {
        let fix = "use `rosbag reindex` to keep the intact part";
        FileError::broken(&self.path, FileFormat::Ros1Bag, format!("record {}", self.records), problem, fix)
    }

    /// The next block of the file after its length; `None` at its end.
    fn block(&mut self) -> Result<Option<Vec<u8>>, FileError> {
        let io = |source| FileError::Io { file: self.path.clone(), source };
        let mut bytes = Vec::new();
        self.reader.by_ref().take(4).read_to_end(&mut bytes).map_err(io)?;
        let Some(length) = Bytes::new(&bytes, false).u32() else {
            self.truncated |= !bytes.is_empty();
            return Ok(None);
        };
        if length > MAX_RECORD_BYTES {
            return Err(self.broken("it is longer than 256 MiB"));
        }
        bytes.clear();
        // The buffer grows with the available bytes, not with the given length, which may be wrong.
        self.reader.by_ref().take(u64::from(length)).read_to_end(&mut bytes).map_err(io)?;
        if bytes.len() < length as usize {
            self.truncated = true;
            return Ok(None);
        }
        Ok(Some(bytes))
    }

    fn unpack(&mut self, compression: &str, size: u32, packed: Vec<u8>) -> Result<(), FileError> {
        if size > MAX_RECORD_BYTES {
            return Err(self.broken("its chunk is longer than 256 MiB"));
        }
        // Read one byte more than declared, to detect a wrong length.
        let most = u64::from(size) + 1;
        let mut bytes = Vec::new();
        let read = match compression {
            "none" => {
                bytes = packed;
                Ok(0)
            }
            "bz2" => bzip2::read::MultiBzDecoder::new(&packed[..]).take(most).read_to_end(&mut bytes),
            "lz4" => lz4::Decoder::new(&packed[..]).and_then(|decoder| decoder.take(most).read_to_end(&mut bytes)),
            other => return Err(self.broken(format!("its compression `{other}` is unknown"))),
        };
        read.map_err(|error| self.broken(format!("its chunk cannot be decompressed ({error})")))?;
        if bytes.len() != size as usize {
            return Err(self.broken("the length of its chunk is wrong"));
        }
        (self.chunk, self.at) = (bytes, 0);
        Ok(())
    }

    /// The next record in the current chunk: header and data.
    fn in_chunk(&mut self) -> Result<Option<Record>, FileError> {
        let rest = &self.chunk[self.at..];
        if rest.is_empty() {
            return Ok(None);
        }
        let mut bytes = Bytes::new(rest, false);
        let mut block = || {
            let length = bytes.u32()? as usize;
            bytes.take(length)
        };
        let found = block().zip(block()).map(|(header, data)| (header.to_vec(), data.to_vec()));
        let left = bytes.left();
        let found = found.ok_or_else(|| self.broken("its chunk is truncated"))?;
        self.at = self.chunk.len() - left;
        Ok(Some(found))
    }

    fn connect(&mut self, header: &HashMap<&[u8], &[u8]>, data: &[u8]) -> Option<()> {
        let connection = fields(data)?;
        let kind = text(&connection, "type")?;
        let channel = Channel {
            topic: text(header, "topic")?,
            encoding: Encoding::Ros1(text(&connection, "message_definition")?),
            kind,
        };
        self.channels.insert(word(header, "conn")? as usize, channel);
        Some(())
    }
}

impl Part for Ros1Bag {
    fn next(&mut self, message: &mut Vec<u8>) -> Result<Option<(usize, i64)>, FileError> {
        loop {
            let (header, data) = match self.in_chunk()? {
                Some(record) => record,
                None => match (self.block()?, self.block()?) {
                    (Some(header), Some(data)) => (header, data),
                    (header, _) => {
                        self.truncated |= header.is_some();
                        return Ok(None);
                    }
                },
            };
            self.records += 1;
            let header = fields(&header).ok_or_else(|| self.broken("its header is invalid"))?;
            match header.get(&b"op"[..]).and_then(|op| op.first()) {
                Some(&CHUNK) => {
                    let compression = text(&header, "compression").unwrap_or_default();
                    let size = word(&header, "size").ok_or_else(|| self.broken("its chunk has no size"))?;
                    self.unpack(&compression, size, data)?;
                }
                Some(&CONNECTION) => {
                    self.definition_bytes += data.len();
                    if self.definition_bytes > MAX_DEFINITION_BYTES {
                        return Err(self.broken("the definitions of its connections are longer than 64 MiB"));
                    }
                    self.connect(&header, &data).ok_or_else(|| self.broken("its connection is invalid"))?;
                }
                Some(&MESSAGE) => {
                    let connection = word(&header, "conn").map(|connection| connection as usize);
                    let connection = connection.filter(|connection| self.channels.contains_key(connection));
                    let mut time = Bytes::new(header.get(&b"time"[..]).copied().unwrap_or_default(), false);
                    let (Some(connection), Some((seconds, ns))) = (connection, time.u32().zip(time.u32())) else {
                        return Err(self.broken("its message has no known connection, or no time"));
                    };
                    *message = data;
                    return Ok(Some((connection, i64::from(seconds) * 1_000_000_000 + i64::from(ns))));
                }
                // The header of the bag and the indices are not needed.
                _ => {}
            }
        }
    }

    fn channel(&self, index: usize) -> Option<&Channel> {
        self.channels.get(&index)
    }

    fn truncated(&self) -> bool {
        self.truncated
    }
}
