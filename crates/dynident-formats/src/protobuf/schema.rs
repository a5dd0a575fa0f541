//! Schemas: the messages of a `FileDescriptorSet` (google/protobuf/descriptor.proto).

use super::wire::{WireFields, WireValue};
use std::collections::HashMap;

const MAX_SCHEMA_BYTES: usize = 1 << 22;
const MAX_NESTING: usize = 16;

/// The type of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FieldKind {
    Double,
    Float,
    /// A variable-length integer, negative numbers in two's complement.
    Signed,
    Unsigned,
    /// A variable-length integer in the zigzag code (small numbers of either sign are short).
    Zigzag,
    Fixed64,
    Fixed32,
    SignedFixed64,
    SignedFixed32,
    Bool,
    Text,
    /// `google.protobuf.Timestamp`.
    Timestamp,
    /// `google.protobuf.Duration`.
    Duration,
    Message(usize),
    /// Bytes, a group, or a message whose type is missing.
    Skipped,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct SchemaField {
    pub(super) name: String,
    pub(super) number: u32,
    pub(super) kind: FieldKind,
    pub(super) is_repeated: bool,
    /// Whether a number that is absent from the message is zero; otherwise it is missing.
    pub(super) is_implicit: bool,
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct SchemaMessage {
    pub(super) fields: Vec<SchemaField>,
    /// Whether it is an entry of a map: key and value.
    pub(super) is_map_entry: bool,
    /// Numbers of the fields with their indices, in ascending order.
    places: Vec<(u32, usize)>,
}

impl SchemaMessage {
    /// Index of the field with this number.
    pub(super) fn place(&self, number: u32) -> Option<usize> {
        let at = self.places.binary_search_by_key(&number, |(known, _)| *known).ok()?;
        Some(self.places[at].1)
    }
}

/// The messages of a schema.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Schema {
    pub(super) messages: Vec<SchemaMessage>,
    pub(super) root: usize,
}

/// A field before its type is resolved.
struct DescribedField {
    field: SchemaField,
    type_number: u64,
    type_name: String,
}

#[derive(Default)]
struct Described {
    places: HashMap<String, usize>,
    messages: Vec<(Vec<DescribedField>, bool)>,
}

/// Whether fields of a file or of a message record if they were set.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Presence {
    Explicit,
    Implicit,
}

impl Schema {
    /// Parses a serialised `FileDescriptorSet`; `name` is the message, such as `foxglove.JointStates`.
    ///
    /// # Errors
    /// The problem of the schema.
    pub(super) fn parse(name: &str, bytes: &[u8]) -> Result<Self, String> {
        if bytes.len() > MAX_SCHEMA_BYTES {
            return Err(format!("its schema is longer than {} MiB", MAX_SCHEMA_BYTES >> 20));
        }
        let wrong = |problem: String| format!("its schema is not a FileDescriptorSet of Protobuf: {problem}");
        let mut described = Described::default();
        each(bytes, |number, value| match (number, value) {
            (1, WireValue::Bytes(file)) => described.file(file),
            _ => Ok(()),
        })
        .map_err(wrong)?;
        let Described { places, messages } = described;
        let root = places.get(name.trim_start_matches('.')).copied();
        let root = root.ok_or_else(|| format!("its schema does not contain the message {name}"))?;
        let resolved = |(fields, is_map_entry): (Vec<DescribedField>, bool)| {
            let fields: Vec<SchemaField> = fields
                .into_iter()
                .map(|one| SchemaField { kind: kind(one.type_number, &one.type_name, &places), ..one.field })
                .collect();
            let mut numbers: Vec<(u32, usize)> =
                fields.iter().enumerate().map(|(place, field)| (field.number, place)).collect();
            numbers.sort_unstable();
            SchemaMessage { fields, is_map_entry, places: numbers }
        };
        Ok(Self { messages: messages.into_iter().map(resolved).collect(), root })
    }
}

/// The type of a field, from its number in the descriptor.
fn kind(number: u64, name: &str, places: &HashMap<String, usize>) -> FieldKind {
    match number {
        1 => FieldKind::Double,
        2 => FieldKind::Float,
        3 | 5 | 14 => FieldKind::Signed,
        4 | 13 => FieldKind::Unsigned,
        6 => FieldKind::Fixed64,
        7 => FieldKind::Fixed32,
        8 => FieldKind::Bool,
        9 => FieldKind::Text,
        11 => match name.trim_start_matches('.') {
            "google.protobuf.Timestamp" => FieldKind::Timestamp,
            "google.protobuf.Duration" => FieldKind::Duration,
            other => places.get(other).map_or(FieldKind::Skipped, |place| FieldKind::Message(*place)),
        },
        15 => FieldKind::SignedFixed32,
        16 => FieldKind::SignedFixed64,
        17 | 18 => FieldKind::Zigzag,
        _ => FieldKind::Skipped,
    }
}

/// Calls `found` for each field of a message.
fn each<'a>(bytes: &'a [u8], mut found: impl FnMut(u32, WireValue<'a>) -> Result<(), String>) -> Result<(), String> {
    let mut fields = WireFields::new(bytes);
    while let Some((number, value)) = fields.next_field()? {
        found(number, value)?;
    }
    Ok(())
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Value of `field_presence` in the options of a file or a field; `features` is the number of the field `features` in
/// these options.
fn presence(options: &[u8], features: u32) -> Result<Option<Presence>, String> {
    let mut found = None;
    each(options, |number, value| match value {
        WireValue::Bytes(set) if number == features => each(set, |number, value| {
            if let (1, WireValue::Varint(stated)) = (number, value) {
                found = Some(if stated == 2 { Presence::Implicit } else { Presence::Explicit });
            }
            Ok(())
        }),
        _ => Ok(()),
    })?;
    Ok(found)
}

impl Described {
    /// Reads a `FileDescriptorProto`.
    fn file(&mut self, bytes: &[u8]) -> Result<(), String> {
        let (mut package, mut default, mut messages) = (String::new(), Presence::Explicit, Vec::new());
        each(bytes, |number, value| {
            match (number, value) {
                (2, WireValue::Bytes(name)) => package = text(name),
                (4, WireValue::Bytes(message)) => messages.push(message),
                (8, WireValue::Bytes(options)) => default = presence(options, 50)?.unwrap_or(default),
                (12, WireValue::Bytes(b"proto3")) => default = Presence::Implicit,
                _ => {}
            }
            Ok(())
        })?;
        messages.into_iter().try_for_each(|message| self.message(message, &package, default, 0))
    }

    /// Reads a `DescriptorProto`.
    fn message(&mut self, bytes: &[u8], scope: &str, default: Presence, depth: usize) -> Result<(), String> {
        if depth > MAX_NESTING {
            return Err(format!("messages are nested more than {MAX_NESTING} times"));
        }
        let (mut name, mut fields, mut nested, mut is_map_entry) = (String::new(), Vec::new(), Vec::new(), false);
        each(bytes, |number, value| {
            match (number, value) {
                (1, WireValue::Bytes(own)) => name = text(own),
                (2, WireValue::Bytes(field)) => fields.push(described_field(field, default)?),
                (3, WireValue::Bytes(message)) => nested.push(message),
                (7, WireValue::Bytes(options)) => each(options, |number, value| {
                    is_map_entry |= number == 7 && value == WireValue::Varint(1);
                    Ok(())
                })?,
                _ => {}
            }
            Ok(())
        })?;
        let full = if scope.is_empty() { name } else { format!("{scope}.{name}") };
        self.places.entry(full.clone()).or_insert(self.messages.len());
        self.messages.push((fields, is_map_entry));
        nested.into_iter().try_for_each(|message| self.message(message, &full, default, depth + 1))
    }
}

/// Reads a `FieldDescriptorProto`.
fn described_field(bytes: &[u8], default: Presence) -> Result<DescribedField, String> {
    let (mut name, mut type_name) = (String::new(), String::new());
    let (mut field_number, mut label, mut type_number) = (0, 0, 0);
    let (mut presence_of_field, mut has_own_presence) = (default, false);
    each(bytes, |number, value| {
        match (number, value) {
            (1, WireValue::Bytes(own)) => name = text(own),
            (3, WireValue::Varint(own)) => field_number = u32::try_from(own).unwrap_or(0),
            (4, WireValue::Varint(own)) => label = own,
            (5, WireValue::Varint(own)) => type_number = own,
            (6, WireValue::Bytes(own)) => type_name = text(own),
            (8, WireValue::Bytes(options)) => {
                presence_of_field = presence(options, 21)?.unwrap_or(presence_of_field);
            }
            // The field is in a `oneof`, also if it is `optional` in proto3.
            (9, _) => has_own_presence = true,
            _ => {}
        }
        Ok(())
    })?;
    let field = SchemaField {
        name,
        number: field_number,
        kind: FieldKind::Skipped,
        is_repeated: label == 3,
        is_implicit: presence_of_field == Presence::Implicit && !has_own_presence,
    };
    Ok(DescribedField { field, type_number, type_name })
}
