//! Decodes the numbers of a message in CDR, the serialisation of ROS 2 (OMG DDS-XTypes 1.3, section 7.4; plain
//! encodings), or in that of ROS 1.

use super::definition::{Count, Definition, Field, Kind};
use super::names_entries;
use crate::bytes::Bytes;

/// Maximum length of an array that becomes columns; longer ones are images, point clouds or maps.
pub(crate) const MAX_ARRAY_COLUMNS: usize = 1024;
pub(crate) const MAX_LEAVES: usize = 1 << 14;

#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Leaves {
    pub(crate) values: Vec<f64>,
    /// Time stamps as integer nanoseconds, with the index of their leaf.
    pub(crate) stamps_ns: Vec<(usize, i64)>,
    /// Lengths of arrays, and names of their entries. Messages of one definition with equal shapes have equal paths.
    pub(crate) shape: Vec<u8>,
    /// Path of each leaf, if requested.
    pub(crate) paths: Vec<String>,
}

impl Leaves {
    pub(crate) fn clear(&mut self) {
        self.values.clear();
        self.stamps_ns.clear();
        self.shape.clear();
        self.paths.clear();
    }
}

/// Serialisation of messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Layout {
    /// CDR: after a header of four bytes, numbers are aligned to their length.
    Cdr,
    /// ROS 1: little-endian, without alignment.
    Ros1,
}

#[derive(Clone, Debug)]
pub(crate) struct Decoder {
    definition: Definition,
    layout: Layout,
}

struct Pass<'a, 'l> {
    messages: &'a [Vec<Field>],
    bytes: Bytes<'a>,
    /// Maximum alignment, bytes: 8, or 4 in version 2 of the encoding, or 1 without alignment.
    widest: usize,
    leaves: &'l mut Leaves,
    path: Option<String>,
}

impl Decoder {
    pub(crate) fn new(definition: Definition, layout: Layout) -> Self {
        Self { definition, layout }
    }

    /// Reads the numbers of `message` into `leaves`, with their paths if `named`.
    ///
    /// # Errors
    /// The problem of the message.
    pub(crate) fn read(&self, message: &[u8], named: bool, leaves: &mut Leaves) -> Result<(), String> {
        leaves.clear();
        let (body, big_endian, widest) = match self.layout {
            Layout::Ros1 => (message, false, 1),
            Layout::Cdr => {
                let (header, body) = message.split_at_checked(4).ok_or("it is truncated")?;
                match header[..2] {
                    [0, 0] => (body, true, 8),
                    [0, 1] => (body, false, 8),
                    [0, 6] => (body, true, 4),
                    [0, 7] => (body, false, 4),
                    _ => return Err(format!("its encoding {:#04x}{:02x} is not plain CDR", header[0], header[1])),
                }
            }
        };
        let bytes = Bytes::new(body, big_endian);
        let path = named.then(String::new);
        let mut pass = Pass { messages: &self.definition.messages, bytes, widest, leaves, path };
        pass.message(0, &[])?;
        // The middleware may pad the message to a multiple of its alignment, so a few bytes may be left.
        if pass.bytes.left() >= 8 { Err("it is longer than defined".to_owned()) } else { Ok(()) }
    }
}

impl<'a> Pass<'a, '_> {
    fn align(&mut self, size: usize) -> Result<(), String> {
        self.bytes.align(size.min(self.widest)).ok_or_else(cut)
    }

    fn length(&mut self) -> Result<usize, String> {
        self.align(4)?;
        self.bytes.u32().map(|length| length as usize).ok_or_else(cut)
    }

    fn text(&mut self) -> Result<&'a [u8], String> {
        let length = self.length()?;
        let text = self.bytes.take(length).ok_or_else(cut)?;
        Ok(text.strip_suffix(b"\0").unwrap_or(text))
    }

    fn leaf(&mut self, value: f64) -> Result<(), String> {
        if self.leaves.values.len() >= MAX_LEAVES {
            return Err(format!("it has more than {MAX_LEAVES} numbers"));
        }
        self.leaves.values.push(value);
        if let Some(path) = &self.path {
            self.leaves.paths.push(path.clone());
        }
        Ok(())
    }

    /// Reads a message. Its arrays with as many entries as `labels` are named by them, unless the message has a field
    /// of names.
    fn message(&mut self, index: usize, labels: &[&'a [u8]]) -> Result<(), String> {
        let messages = self.messages;
        let fields = &messages[index];
        if fields.is_empty() && self.widest == 1 {
            return Ok(());
        }
        if fields.is_empty() {
            // The code generator of ROS 2, rosidl, adds one byte to an empty message.
            return self.bytes.u8().map(|_| ()).ok_or_else(cut);
        }
        let mut own: Option<Vec<&'a [u8]>> = None;
        for field in fields {
            let length = self.path.as_ref().map_or(0, String::len);
            if let Some(path) = &mut self.path {
                if length > 0 {
                    path.push('.');
                }
                *path += &field.name;
            }
            let found = match field.count {
                // Names also apply to nested messages: joint names also name the entries of the arrays of a
                // trajectory point.
                Count::One => self.element(field.kind, own.as_deref().unwrap_or(labels)).map(|()| None),
                Count::Exactly(count) => self.array(field, count, own.as_deref().unwrap_or(labels)),
                Count::Any => {
                    let count = self.length()?;
                    // Every element needs at least one byte.
                    if count > self.bytes.left() {
                        return Err(cut());
                    }
                    self.leaves.shape.extend_from_slice(&(count as u32).to_le_bytes());
                    self.array(field, count, own.as_deref().unwrap_or(labels))
                }
            };
            if let Some(names) = found? {
                own.get_or_insert(names);
            }
            if let Some(path) = &mut self.path {
                path.truncate(length);
            }
        }
        Ok(())
    }

    /// Reads the elements of an array; returns its texts if they are names.
    fn array(&mut self, field: &Field, count: usize, labels: &[&'a [u8]]) -> Result<Option<Vec<&'a [u8]>>, String> {
        if field.kind == Kind::Text {
            let named = names_entries(&field.name) && count <= MAX_ARRAY_COLUMNS;
            let mut names = Vec::new();
            for _ in 0..count {
                let name = self.text()?;
                if named {
                    names.push(name);
                    self.leaves.shape.extend_from_slice(&(name.len() as u32).to_le_bytes());
                    self.leaves.shape.extend_from_slice(name);
                }
            }
            return Ok(named.then_some(names));
        }
        let size = size(field.kind);
        if count > MAX_ARRAY_COLUMNS && size > 0 {
            self.align(size)?;
            self.bytes.take(count.checked_mul(size).ok_or_else(cut)?).ok_or_else(cut)?;
            return Ok(None);
        }
        if count > MAX_ARRAY_COLUMNS {
            return Err(format!("`{}` has more than {MAX_ARRAY_COLUMNS} entries", field.name));
        }
        let labelled = labels.len() == count;
        let length = self.path.as_ref().map_or(0, String::len);
        for index in 0..count {
            if let Some(path) = &mut self.path {
                path.push('[');
                match labels.get(index) {
                    Some(label) if labelled => *path += &String::from_utf8_lossy(label),
                    _ => *path += &index.to_string(),
                }
                path.push(']');
            }
            self.element(field.kind, &[])?;
            if let Some(path) = &mut self.path {
                path.truncate(length);
            }
        }
        Ok(None)
    }

    fn element(&mut self, kind: Kind, labels: &[&'a [u8]]) -> Result<(), String> {
        let bytes = size(kind);
        if bytes > 0 {
            self.align(bytes)?;
        }
        let value = match kind {
            Kind::Bool | Kind::U8 => self.bytes.u8().map(f64::from),
            Kind::Byte if self.widest > 1 => self.bytes.u8().map(f64::from),
            Kind::I8 | Kind::Byte => self.bytes.u8().map(|value| f64::from(value as i8)),
            Kind::U16 => self.bytes.u16().map(f64::from),
            Kind::I16 => self.bytes.u16().map(|value| f64::from(value as i16)),
            Kind::U32 => self.bytes.u32().map(f64::from),
            Kind::I32 => self.bytes.u32().map(|value| f64::from(value as i32)),
            Kind::U64 => self.bytes.u64().map(|value| value as f64),
            Kind::I64 => self.bytes.u64().map(|value| value as i64 as f64),
            Kind::F32 => self.bytes.u32().map(|value| f64::from(f32::from_bits(value))),
            Kind::F64 => self.bytes.u64().map(f64::from_bits),
            Kind::Text => return self.text().map(|_| ()),
            Kind::Skipped => return self.bytes.u8().map(|_| ()).ok_or_else(cut),
            Kind::WideText => {
                let length = self.length()?;
                return self.bytes.take(length.saturating_mul(2)).map(|_| ()).ok_or_else(cut);
            }
            Kind::Time | Kind::Duration => {
                self.align(4)?;
                let seconds = self.bytes.u32().map(|value| value as i32);
                let (Some(seconds), Some(nanoseconds)) = (seconds, self.bytes.u32()) else { return Err(cut()) };
                let stamp = i64::from(seconds) * 1_000_000_000 + i64::from(nanoseconds);
                if kind == Kind::Time {
                    self.leaves.stamps_ns.push((self.leaves.values.len(), stamp));
                }
                return self.leaf(stamp as f64 / 1e9);
            }
            Kind::Message(index) => return self.message(index, labels),
        };
        self.leaf(value.ok_or_else(cut)?)
    }
}

/// Bytes of a number; zero for other types.
fn size(kind: Kind) -> usize {
    match kind {
        Kind::Bool | Kind::Byte | Kind::U8 | Kind::I8 | Kind::Skipped => 1,
        Kind::U16 | Kind::I16 => 2,
        Kind::U32 | Kind::I32 | Kind::F32 => 4,
        Kind::U64 | Kind::I64 | Kind::F64 => 8,
        Kind::Text | Kind::WideText | Kind::Time | Kind::Duration | Kind::Message(_) => 0,
    }
}

fn cut() -> String {
    "it is shorter than defined".to_owned()
}
