//! Reads ULog, the format of PX4, sequentially: <https://docs.px4.io/main/en/dev_log/ulog_file_format.html>.

use super::part::{Channel, Encoding, Part};
use super::unpacked;
use crate::bytes::Bytes;
use crate::error::FileError;
use crate::kind::FileFormat;
use core::fmt::Write;
use std::collections::{HashMap, HashSet};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

const HEADER_BYTES: usize = 16;
const MAX_NESTING: usize = 8;
/// Maximum number of subscriptions, and maximum number of bytes of each definition: a few bytes in the file could
/// define a long text.
const MAX_CHANNELS: usize = 2000;
const MAX_DEFINITION_BYTES: usize = 1 << 16;

#[derive(Debug)]
pub(super) struct Ulog {
    path: PathBuf,
    reader: BufReader<File>,
    /// Fields of each message type, `type name;..`.
    formats: HashMap<String, String>,
    channels: HashMap<usize, Channel>,
    records: u64,
    truncated: bool,
}

impl Ulog {
    pub(super) fn open(path: &Path) -> Result<Self, FileError> {
        let mut reader = BufReader::with_capacity(1 << 16, unpacked::open(path)?);
        let mut header = [0; HEADER_BYTES];
        let read = reader.read_exact(&mut header);
        let (formats, channels) = (HashMap::new(), HashMap::new());
        let log = Self { path: path.to_owned(), reader, formats, channels, records: 0, truncated: false };
        if read.is_ok() { Ok(log) } else { Err(log.broken("its header is truncated")) }
    }

    fn broken(&self, problem: &str) -> FileError {
        let fix = "copy it from the vehicle again";
        FileError::broken(&self.path, FileFormat::Ulog, format!("message {}", self.records), problem, fix)
    }

    /// The definition of a message type in the notation of ROS, with the types that it uses.
    fn definition(&self, name: &str) -> Option<String> {
        let (mut text, mut waiting) = (String::new(), vec![(name, 0)]);
        let mut known = HashSet::from([name]);
        while let Some((name, depth)) = waiting.pop() {
            if depth > 0 {
                let _ = write!(text, "{}\nMSG: ulog/{name}\n", "=".repeat(80));
            }
            let fields: Vec<&str> = self.formats.get(name)?.split(';').filter(|field| !field.is_empty()).collect();
            for (at, field) in fields.iter().enumerate() {
                let (kind, own) = field.split_once(' ')?;
                let (kind, count) = match kind.split_once('[') {
                    Some((kind, count)) => (kind, format!("[{count}")),
                    None => (kind, String::new()),
                };
                let is_padding = own.starts_with("_padding");
                // Padding at the end of a message is not logged.
                if is_padding && depth == 0 && at + 1 == fields.len() {
                    continue;
                }
                let kind = match kind {
                    "int8_t" | "uint8_t" | "int16_t" | "uint16_t" | "int32_t" | "uint32_t" | "int64_t" | "uint64_t" => {
                        if is_padding {
                            "skipped"
                        } else {
                            kind.trim_end_matches("_t")
                        }
                    }
                    "float" => "float32",
                    "double" => "float64",
                    "bool" => "bool",
                    "char" => "skipped",
                    nested => {
                        if depth >= MAX_NESTING {
                            return None;
                        }
                        if let (Some((nested, _)), true) = (self.formats.get_key_value(nested), known.insert(nested)) {
                            waiting.push((nested, depth + 1));
                        }
                        nested
                    }
                };
                let _ = writeln!(text, "{kind}{count} {own}");
                if text.len() > MAX_DEFINITION_BYTES {
                    return None;
                }
            }
        }
        Some(text)
    }

    fn subscribe(&mut self, body: &[u8]) -> Option<()> {
        let mut bytes = Bytes::new(body, false);
        let (instance, id) = (bytes.u8()?, bytes.u16()?);
        let kind = String::from_utf8_lossy(bytes.take(bytes.left())?).into_owned();
        let topic = if instance == 0 { kind.clone() } else { format!("{kind}_{instance}") };
        let encoding = match self.definition(&kind) {
            Some(text) => Encoding::Ros1(text),
            None => Encoding::Other("without a definition".to_owned()),
        };
        self.channels.insert(usize::from(id), Channel { topic, kind: format!("ulog/{kind}"), encoding });
        Some(())
    }
}

impl Part for Ulog {
    fn next(&mut self, message: &mut Vec<u8>) -> Result<Option<(usize, i64)>, FileError> {
        loop {
            let io = |source| FileError::Io { file: self.path.clone(), source };
            let mut head = Vec::new();
            self.reader.by_ref().take(3).read_to_end(&mut head).map_err(io)?;
            let mut bytes = Bytes::new(&head, false);
            let Some((size, kind)) = bytes.u16().zip(bytes.u8()) else {
                self.truncated |= !head.is_empty();
                return Ok(None);
            };
            let mut body = Vec::new();
            self.reader.by_ref().take(u64::from(size)).read_to_end(&mut body).map_err(io)?;
            if body.len() < usize::from(size) {
                self.truncated = true;
                return Ok(None);
            }
            self.records += 1;
            match kind {
                b'F' => {
                    let text = String::from_utf8_lossy(&body).into_owned();
                    let (name, fields) = text.split_once(':').ok_or_else(|| self.broken("its format has no name"))?;
                    self.formats.insert(name.to_owned(), fields.to_owned());
                }
                b'A' if self.channels.len() >= MAX_CHANNELS => {
                    return Err(self.broken("it has more than 2000 subscriptions"));
                }
                b'A' => self.subscribe(&body).ok_or_else(|| self.broken("its subscription is truncated"))?,
                b'D' => {
                    let mut bytes = Bytes::new(&body, false);
                    let id = bytes.u16().map(usize::from).filter(|id| self.channels.contains_key(id));
                    let id = id.ok_or_else(|| self.broken("its data have no subscription"))?;
                    // Every message begins with its time stamp, us.
                    let stamp_us = bytes.u64().ok_or_else(|| self.broken("it has no time stamp"))?;
                    *message = body[2..].to_vec();
                    let log_ns = stamp_us.checked_mul(1000).and_then(|ns| i64::try_from(ns).ok());
                    return Ok(Some((id, log_ns.ok_or_else(|| self.broken("its time stamp is too large"))?)));
                }
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
