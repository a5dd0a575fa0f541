//! Decodes the numbers of a message.

use super::schema::{FieldKind, Schema, SchemaField, SchemaMessage};
use super::wire::{WireFields, WireValue};
use crate::ros::{Leaves, MAX_ARRAY_COLUMNS, MAX_LEAVES, names_entries};
use std::collections::HashSet;

const MAX_NESTING: usize = 16;
/// Maximum number of fields that are visited in one message; a short message may contain many empty ones.
const MAX_VISITED_FIELDS: usize = 1 << 14;

/// Decoder of the messages of a schema.
#[derive(Clone, Debug)]
pub(crate) struct ProtobufDecoder {
    schema: Schema,
}

/// Contents of a field in one message.
#[derive(Clone, Debug)]
enum Content<'a> {
    Missing,
    Numbers(Vec<f64>),
    /// Texts, messages, or the bytes of skipped fields.
    Parts(Vec<&'a [u8]>),
}

struct Pass<'s, 'l> {
    messages: &'s [SchemaMessage],
    leaves: &'l mut Leaves,
    path: Option<String>,
    visited: usize,
}

impl ProtobufDecoder {
    /// The decoder of `name`, with the serialised `FileDescriptorSet` of its schema.
    ///
    /// # Errors
    /// The problem of the schema.
    pub(crate) fn new(name: &str, schema: &[u8]) -> Result<Self, String> {
        Ok(Self { schema: Schema::parse(name, schema)? })
    }

    /// Reads the numbers of `message` into `leaves`, with their paths if `named`. Numbers that proto3 leaves out
    /// because they are zero are zero.
    ///
    /// # Errors
    /// The problem of the message.
    pub(crate) fn read(&self, message: &[u8], named: bool, leaves: &mut Leaves) -> Result<(), String> {
        leaves.clear();
        let mut pass = Pass { messages: &self.schema.messages, leaves, path: named.then(String::new), visited: 0 };
        pass.message(self.schema.root, message, &[], 0)
    }
}

impl Pass<'_, '_> {
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

    fn shape(&mut self, part: usize) {
        self.leaves.shape.extend_from_slice(&(part as u32).to_le_bytes());
    }

    fn shape_text(&mut self, text: &[u8]) {
        self.shape(text.len());
        self.leaves.shape.extend_from_slice(text);
    }

    /// Runs `work` with `part` added to the path.
    fn within(&mut self, part: &str, work: impl FnOnce(&mut Self) -> Result<(), String>) -> Result<(), String> {
        let length = self.path.as_ref().map_or(0, String::len);
        if let Some(path) = &mut self.path {
            if length > 0 && !part.starts_with('[') {
                path.push('.');
            }
            *path += part;
        }
        work(self)?;
        if let Some(path) = &mut self.path {
            path.truncate(length);
        }
        Ok(())
    }

    /// Reads a message. Its repeated fields with as many entries as `labels` are named by them, unless the message has
    /// a field of names.
    fn message(&mut self, index: usize, bytes: &[u8], labels: &[&[u8]], depth: usize) -> Result<(), String> {
        let messages = self.messages;
        let own = &messages[index];
        let contents = self.contents(own, bytes, depth)?;
        let mut found: &[&[u8]] = &[];
        for (field, content) in own.fields.iter().zip(&contents) {
            if let (FieldKind::Text, true, Content::Parts(texts)) = (field.kind, field.is_repeated, content)
                && names_entries(&field.name)
                && texts.len() <= MAX_ARRAY_COLUMNS
            {
                for text in texts {
                    self.shape_text(text);
                }
                if found.is_empty() {
                    found = texts;
                }
            }
        }
        let labels = if found.is_empty() { labels } else { found };
        for (field, content) in own.fields.iter().zip(&contents) {
            self.within(&field.name, |pass| pass.field(field, content, labels, depth))?;
        }
        Ok(())
    }

    /// The contents of the fields of a message, in the order of the schema.
    fn contents<'a>(&mut self, own: &SchemaMessage, bytes: &'a [u8], depth: usize) -> Result<Vec<Content<'a>>, String> {
        if depth > MAX_NESTING {
            return Err(format!("its messages are nested more than {MAX_NESTING} times"));
        }
        self.visited += own.fields.len();
        if self.visited > MAX_VISITED_FIELDS {
            return Err(format!("it has more than {MAX_VISITED_FIELDS} fields"));
        }
        let mut contents = vec![Content::Missing; own.fields.len()];
        let mut fields = WireFields::new(bytes);
        while let Some((number, value)) = fields.next_field()? {
            let Some(place) = own.place(number) else { continue };
            let field = &own.fields[place];
            let content = &mut contents[place];
            if !field.is_repeated && !matches!(field.kind, FieldKind::Message(_)) {
                // If a field occurs several times, the last value is valid.
                *content = Content::Missing;
            }
            add(field, value, content)?;
        }
        Ok(contents)
    }

    fn field(
        &mut self,
        field: &SchemaField,
        content: &Content<'_>,
        labels: &[&[u8]],
        depth: usize,
    ) -> Result<(), String> {
        match (field.kind, content) {
            (FieldKind::Text | FieldKind::Skipped, _) => Ok(()),
            (FieldKind::Message(_) | FieldKind::Timestamp | FieldKind::Duration, Content::Parts(parts)) => {
                if field.is_repeated {
                    return self.messages_of(field.kind, parts, labels, depth);
                }
                self.shape(1);
                // A message in several parts is the concatenation of these parts.
                match parts[..] {
                    [part] => self.part(field.kind, part, labels, depth),
                    _ => self.part(field.kind, &parts.concat(), labels, depth),
                }
            }
            (_, Content::Numbers(numbers)) if field.is_repeated => {
                self.shape(numbers.len());
                if numbers.len() > MAX_ARRAY_COLUMNS {
                    return Ok(());
                }
                let labels = labels_of(labels, numbers.len());
                for (index, number) in numbers.iter().enumerate() {
                    self.within(&label(labels, index), |pass| pass.leaf(*number))?;
                }
                Ok(())
            }
            (_, Content::Numbers(numbers)) => {
                self.shape(1);
                numbers.last().map_or(Ok(()), |number| self.leaf(*number))
            }
            (FieldKind::Message(_) | FieldKind::Timestamp | FieldKind::Duration, _) => {
                self.shape(0);
                Ok(())
            }
            (_, Content::Missing | Content::Parts(_)) if !field.is_repeated && field.is_implicit => {
                self.shape(1);
                self.leaf(0.0)
            }
            (_, Content::Missing | Content::Parts(_)) => {
                self.shape(0);
                Ok(())
            }
        }
    }

    /// Reads a repeated field of messages. Its entries are named by the key of a map, by their field `name` if all
    /// names differ, by `labels`, or by their index.
    fn messages_of(&mut self, kind: FieldKind, parts: &[&[u8]], labels: &[&[u8]], depth: usize) -> Result<(), String> {
        self.shape(parts.len());
        if parts.len() > MAX_ARRAY_COLUMNS {
            return Ok(());
        }
        if let FieldKind::Message(index) = kind {
            let messages = self.messages;
            let own = &messages[index];
            if let (true, [key, value]) = (own.is_map_entry, &own.fields[..]) {
                return parts.iter().try_for_each(|part| self.entry(own, [key, value], part, depth));
            }
            if let Some(names) = names_of(own, parts)? {
                for name in &names {
                    self.shape_text(name);
                }
                return parts.iter().enumerate().try_for_each(|(at, part)| {
                    self.within(&label(&names, at), |pass| pass.part(kind, part, &[], depth))
                });
            }
        }
        let labels = labels_of(labels, parts.len());
        parts
            .iter()
            .enumerate()
            .try_for_each(|(at, part)| self.within(&label(labels, at), |pass| pass.part(kind, part, &[], depth)))
    }

    /// Reads an entry of a map: its value has the name of the key.
    fn entry(
        &mut self,
        own: &SchemaMessage,
        [key, value]: [&SchemaField; 2],
        bytes: &[u8],
        depth: usize,
    ) -> Result<(), String> {
        let contents = self.contents(own, bytes, depth + 1)?;
        let name = match (&contents[0], key.kind) {
            (Content::Parts(texts), _) => texts.last().map(|text| text.to_vec()).unwrap_or_default(),
            (Content::Numbers(numbers), _) => numbers.last().copied().unwrap_or(0.0).to_string().into_bytes(),
            (Content::Missing, FieldKind::Text) => Vec::new(),
            (Content::Missing, _) => b"0".to_vec(),
        };
        self.shape_text(&name);
        self.within(&label(&[&name], 0), |pass| pass.field(value, &contents[1], &[], depth + 1))
    }

    fn part(&mut self, kind: FieldKind, bytes: &[u8], labels: &[&[u8]], depth: usize) -> Result<(), String> {
        match kind {
            FieldKind::Message(index) => self.message(index, bytes, labels, depth + 1),
            FieldKind::Timestamp | FieldKind::Duration => {
                let (mut seconds, mut nanoseconds) = (0_i64, 0_i64);
                let mut fields = WireFields::new(bytes);
                while let Some(field) = fields.next_field()? {
                    match field {
                        (1, WireValue::Varint(value)) => seconds = value as i64,
                        (2, WireValue::Varint(value)) => nanoseconds = value as i64,
                        _ => {}
                    }
                }
                let stamp = seconds.checked_mul(1_000_000_000).and_then(|ns| ns.checked_add(nanoseconds));
                let stamp = stamp.ok_or("a time stamp in it is beyond the year 2262")?;
                if kind == FieldKind::Timestamp {
                    self.leaves.stamps_ns.push((self.leaves.values.len(), stamp));
                }
                self.leaf(stamp as f64 / 1e9)
            }
            _ => Ok(()),
        }
    }
}

/// Adds a value on the wire to the contents of its field.
fn add<'a>(field: &SchemaField, value: WireValue<'a>, content: &mut Content<'a>) -> Result<(), String> {
    let is_part = matches!(
        field.kind,
        FieldKind::Text | FieldKind::Timestamp | FieldKind::Duration | FieldKind::Message(_) | FieldKind::Skipped
    );
    let mut numbers = Vec::new();
    match (is_part, value) {
        (true, WireValue::Bytes(part)) => {
            match content {
                Content::Parts(parts) => parts.push(part),
                _ => *content = Content::Parts(vec![part]),
            }
            return Ok(());
        }
        // A value of another type than in the schema is an unknown field.
        (true, _) => return Ok(()),
        // Packed numbers.
        (false, WireValue::Bytes(packed)) => {
            let mut packed = WireFields::new(packed);
            while !packed.is_empty() {
                let value = match field.kind {
                    FieldKind::Double | FieldKind::Fixed64 | FieldKind::SignedFixed64 => {
                        WireValue::Fixed64(packed.fixed64()?)
                    }
                    FieldKind::Float | FieldKind::Fixed32 | FieldKind::SignedFixed32 => {
                        WireValue::Fixed32(packed.fixed32()?)
                    }
                    _ => WireValue::Varint(packed.varint()?),
                };
                numbers.extend(number(field.kind, value));
            }
        }
        (false, value) => numbers.extend(number(field.kind, value)),
    }
    match content {
        Content::Numbers(known) => known.append(&mut numbers),
        _ => *content = Content::Numbers(numbers),
    }
    Ok(())
}

/// The number of a value; `None` if its wire type is not that of the schema.
fn number(kind: FieldKind, value: WireValue<'_>) -> Option<f64> {
    Some(match (kind, value) {
        (FieldKind::Double, WireValue::Fixed64(bits)) => f64::from_bits(bits),
        (FieldKind::Float, WireValue::Fixed32(bits)) => f64::from(f32::from_bits(bits)),
        (FieldKind::Signed, WireValue::Varint(value)) | (FieldKind::SignedFixed64, WireValue::Fixed64(value)) => {
            value as i64 as f64
        }
        (FieldKind::Unsigned, WireValue::Varint(value)) | (FieldKind::Fixed64, WireValue::Fixed64(value)) => {
            value as f64
        }
        (FieldKind::Zigzag, WireValue::Varint(value)) => ((value >> 1) as i64 ^ -((value & 1) as i64)) as f64,
        (FieldKind::Bool, WireValue::Varint(value)) => f64::from(u8::from(value != 0)),
        (FieldKind::Fixed32, WireValue::Fixed32(value)) => f64::from(value),
        (FieldKind::SignedFixed32, WireValue::Fixed32(value)) => f64::from(value as i32),
        _ => return None,
    })
}

/// The names of messages from their field `name`, if they are different.
fn names_of<'a>(own: &SchemaMessage, parts: &[&'a [u8]]) -> Result<Option<Vec<&'a [u8]>>, String> {
    let named = |field: &&SchemaField| field.kind == FieldKind::Text && !field.is_repeated && field.name == "name";
    let Some(wanted) = own.fields.iter().find(named).map(|field| field.number) else { return Ok(None) };
    let mut names = Vec::with_capacity(parts.len());
    for part in parts {
        let (mut fields, mut name) = (WireFields::new(part), &b""[..]);
        while let Some((number, value)) = fields.next_field()? {
            if let (true, WireValue::Bytes(text)) = (number == wanted, value) {
                name = text;
            }
        }
        names.push(name);
    }
    let different: HashSet<&[u8]> = names.iter().copied().filter(|name| !name.is_empty()).collect();
    Ok((different.len() == names.len()).then_some(names))
}

/// The labels, if there is one for each of `count` entries.
fn labels_of<'l, 'a>(labels: &'l [&'a [u8]], count: usize) -> &'l [&'a [u8]] {
    if labels.len() == count { labels } else { &[] }
}

fn label(labels: &[&[u8]], index: usize) -> String {
    labels.get(index).map_or_else(|| format!("[{index}]"), |name| format!("[{}]", String::from_utf8_lossy(name)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn varint(mut value: u64) -> Vec<u8> {
        let mut bytes = Vec::new();
        while value >= 0x80 {
            bytes.push(value as u8 | 0x80);
            value >>= 7;
        }
        bytes.push(value as u8);
        bytes
    }

    fn bytes(number: u64, content: &[u8]) -> Vec<u8> {
        [varint(number << 3 | 2), varint(content.len() as u64), content.to_vec()].concat()
    }

    fn whole(number: u64, value: u64) -> Vec<u8> {
        [varint(number << 3), varint(value)].concat()
    }

    fn field(name: &str, number: u64, label: u64, kind: u64, of: &str) -> Vec<u8> {
        let of = if of.is_empty() { Vec::new() } else { bytes(6, of.as_bytes()) };
        bytes(2, &[bytes(1, name.as_bytes()), whole(3, number), whole(4, label), whole(5, kind), of].concat())
    }

    /// A schema with one message `Node` of proto3 that contains itself.
    fn schema(fields: &[Vec<u8>]) -> Vec<u8> {
        let message = bytes(4, &[bytes(1, b"Node"), fields.concat()].concat());
        bytes(1, &[bytes(2, b"own"), message, bytes(12, b"proto3")].concat())
    }

    fn tree() -> ProtobufDecoder {
        let fields = [field("x", 1, 1, 1, ""), field("next", 2, 3, 11, ".own.Node"), field("y", 3, 3, 2, "")];
        ProtobufDecoder::new("own.Node", &schema(&fields)).unwrap()
    }

    fn refused(decoder: &ProtobufDecoder, message: &[u8], words: &str) {
        let mut leaves = Leaves::default();
        let problem = decoder.read(message, true, &mut leaves).unwrap_err();
        assert!(problem.contains(words), "{problem}");
        assert!(leaves.values.len() <= MAX_LEAVES);
    }

    #[test]
    fn nested_messages_have_paths_and_zeros() {
        let mut leaves = Leaves::default();
        let inner = bytes(3, &[1.5_f32.to_le_bytes(), 2.5_f32.to_le_bytes()].concat());
        tree().read(&[bytes(2, &inner), bytes(2, b"")].concat(), true, &mut leaves).unwrap();
        assert_eq!(leaves.paths, ["x", "next[0].x", "next[0].y[0]", "next[0].y[1]", "next[1].x"]);
        assert_eq!(leaves.values, [0.0, 0.0, 1.5, 2.5, 0.0]);
        // A second value of a single field replaces the first; unknown fields are ignored.
        let twice = [1.0_f64, 2.0].map(|value| [varint(9), value.to_le_bytes().to_vec()].concat()).concat();
        tree().read(&[twice, whole(99, 7)].concat(), false, &mut leaves).unwrap();
        assert_eq!(leaves.values, [2.0]);
    }

    #[test]
    fn hostile_messages_are_refused_in_bounded_time() {
        let decoder = tree();
        let deep = (0..100).fold(Vec::new(), |inner, _| bytes(2, &inner));
        refused(&decoder, &deep, "nested more than 16 times");
        // Empty messages in empty messages: each takes two bytes and has three fields.
        let many = (0..2).fold(Vec::new(), |inner: Vec<u8>, _| bytes(2, &inner).repeat(1000));
        refused(&decoder, &many, "fields");
        let mut leaves = Leaves::default();
        // Longer lists are images or clouds, and have no columns.
        decoder.read(&bytes(3, &vec![0; 4 * 5000]), true, &mut leaves).unwrap();
        assert_eq!(leaves.paths, ["x"]);
        for message in [&b"\x12\xff\xff\xff\xff\x7f"[..], b"\x09\0\0", b"\x1a\x03\0\0\0", b"\x13", b"\xff"] {
            assert!(decoder.read(message, true, &mut leaves).is_err(), "{message:?}");
        }
    }

    #[test]
    fn hostile_schemas_are_refused() {
        let problem = |schema: &[u8]| ProtobufDecoder::new("own.Node", schema).unwrap_err();
        assert!(problem(b"").contains("does not contain the message own.Node"));
        assert!(problem(b"\x0a\xff").contains("not a FileDescriptorSet"));
        assert!(problem(&vec![0; 5 << 20]).contains("longer than 4 MiB"));
        let deep = (0..40).fold(bytes(1, b"A"), |inner, _| [bytes(1, b"A"), bytes(3, &inner)].concat());
        assert!(problem(&bytes(1, &bytes(4, &deep))).contains("nested more than"));
        // A message whose type is missing is not read, the others are.
        let fields = [field("x", 1, 1, 1, ""), field("gone", 2, 1, 11, ".other.Gone")];
        let decoder = ProtobufDecoder::new("own.Node", &schema(&fields)).unwrap();
        let mut leaves = Leaves::default();
        decoder.read(&bytes(2, b"\xff\xff"), true, &mut leaves).unwrap();
        assert_eq!(leaves.paths, ["x"]);
    }
}
