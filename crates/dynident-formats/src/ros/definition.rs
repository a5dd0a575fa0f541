//! Parses message definitions in bags: `.msg` texts, followed by the types that they use, separated by lines of `=`.
//! Format: <https://docs.ros.org/en/rolling/Concepts/Basic/About-Interfaces.html>.

use std::collections::HashMap;

const MAX_DEFINITION_BYTES: usize = 1 << 20;
const MAX_NESTING: usize = 16;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Bool,
    /// `byte`: an unsigned number in ROS 2, a signed one in ROS 1.
    Byte,
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F32,
    F64,
    Text,
    WideText,
    /// A byte that is not a number: a character, padding.
    Skipped,
    /// `builtin_interfaces/Time`: one number, s.
    Time,
    /// `builtin_interfaces/Duration`: one number, s.
    Duration,
    Message(usize),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Count {
    One,
    Exactly(usize),
    /// The number of elements is stored before the elements.
    Any,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Field {
    pub(crate) name: String,
    pub(crate) kind: Kind,
    pub(crate) count: Count,
}

/// A message type and the types that it uses; the first one is the message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Definition {
    pub(crate) messages: Vec<Vec<Field>>,
}

impl Definition {
    /// Parses the definition of `name` (`sensor_msgs/msg/JointState`).
    ///
    /// # Errors
    /// The problem of the text.
    pub(crate) fn parse(name: &str, text: &str) -> Result<Self, String> {
        if text.len() > MAX_DEFINITION_BYTES {
            return Err("its definition is longer than a megabyte".to_owned());
        }
        // The texts of all types, by package/Type.
        let mut texts: HashMap<String, &str> = HashMap::new();
        let mut own = None;
        for part in sections(text) {
            let (of, body) = match part.trim_start().strip_prefix("MSG:") {
                Some(rest) => {
                    let (of, body) = rest.split_once('\n').unwrap_or((rest, ""));
                    (short(of), body)
                }
                None => (short(name), part),
            };
            own.get_or_insert(body);
            texts.entry(of).or_insert(body);
        }
        let mut found = Self { messages: Vec::new() };
        let root = short(name);
        if let Some(body) = own {
            texts.insert(root.clone(), body);
        }
        found.add(&root, &texts, &mut HashMap::new(), 0)?;
        Ok(found)
    }

    fn add(
        &mut self,
        name: &str,
        texts: &HashMap<String, &str>,
        known: &mut HashMap<String, usize>,
        depth: usize,
    ) -> Result<usize, String> {
        if let Some(index) = known.get(name) {
            return if *index == usize::MAX { Err(format!("type `{name}` contains itself")) } else { Ok(*index) };
        }
        if depth > MAX_NESTING {
            return Err(format!("its types are nested more than {MAX_NESTING} deep"));
        }
        let text = texts.get(name).ok_or_else(|| format!("it uses type `{name}`, which is not defined"))?;
        known.insert(name.to_owned(), usize::MAX);
        let index = self.messages.len();
        self.messages.push(Vec::new());
        let package = name.split('/').next().unwrap_or_default();
        let mut fields = Vec::new();
        for line in text.lines() {
            let Some((kind, count, field)) = declaration(line)? else { continue };
            let kind = if let Some(kind) = primitive(kind) {
                kind
            } else {
                // ROS 1 defines the header without its package.
                let own = format!("{package}/{kind}");
                let full = match kind {
                    "Header" if !texts.contains_key(&own) => "std_msgs/Header".to_owned(),
                    _ if kind.contains('/') => short(kind),
                    _ => own,
                };
                match full.as_str() {
                    "builtin_interfaces/Time" => Kind::Time,
                    "builtin_interfaces/Duration" => Kind::Duration,
                    _ => Kind::Message(self.add(&full, texts, known, depth + 1)?),
                }
            };
            fields.push(Field { name: field.to_owned(), kind, count });
        }
        self.messages[index] = fields;
        known.insert(name.to_owned(), index);
        Ok(index)
    }
}

fn sections(text: &str) -> Vec<&str> {
    let (mut parts, mut begin, mut at) = (Vec::new(), 0, 0);
    for line in text.split_inclusive('\n') {
        let bare = line.trim();
        if bare.len() >= 40 && bare.bytes().all(|byte| byte == b'=') {
            parts.push(&text[begin..at]);
            begin = at + line.len();
        }
        at += line.len();
    }
    parts.push(&text[begin..]);
    parts
}

/// `sensor_msgs/JointState` from `sensor_msgs/msg/JointState`.
fn short(name: &str) -> String {
    let name = name.trim();
    match (name.split('/').next(), name.rsplit('/').next()) {
        (Some(package), Some(kind)) if name.contains('/') => format!("{package}/{kind}"),
        _ => name.to_owned(),
    }
}

/// Type, count and name in a field declaration; `None` for constants, comments and blank lines.
fn declaration(line: &str) -> Result<Option<(&str, Count, &str)>, String> {
    let mut words = line.split('#').next().unwrap_or_default().split_whitespace();
    let (Some(kind), Some(name)) = (words.next(), words.next()) else { return Ok(None) };
    let wrong = || format!("`{}` is not a field declaration", line.trim());
    // Constants are `TYPE NAME=value`, possibly with blanks around the equals sign; the default of a field has no
    // equals sign.
    if name.contains('=') || words.next().is_some_and(|word| word.starts_with('=')) {
        return Ok(None);
    }
    if !name.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_') {
        return Err(wrong());
    }
    let (kind, count) = match kind.strip_suffix(']') {
        None => (kind, Count::One),
        Some(rest) => {
            let (kind, size) = rest.rsplit_once('[').ok_or_else(wrong)?;
            let count = match size {
                size if size.is_empty() || size.starts_with("<=") => Count::Any,
                size => Count::Exactly(size.parse().ok().filter(|size| *size > 0).ok_or_else(wrong)?),
            };
            (kind, count)
        }
    };
    // `string<=20` is a text of limited length.
    Ok(Some((kind.split("<=").next().unwrap_or(kind), count, name)))
}

fn primitive(name: &str) -> Option<Kind> {
    Some(match name {
        "bool" => Kind::Bool,
        "byte" => Kind::Byte,
        "uint8" | "char" => Kind::U8,
        "time" => Kind::Time,
        "duration" => Kind::Duration,
        "skipped" => Kind::Skipped,
        "int8" => Kind::I8,
        "uint16" => Kind::U16,
        "int16" => Kind::I16,
        "uint32" => Kind::U32,
        "int32" => Kind::I32,
        "uint64" => Kind::U64,
        "int64" => Kind::I64,
        "float32" => Kind::F32,
        "float64" => Kind::F64,
        "string" => Kind::Text,
        "wstring" => Kind::WideText,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn definitions_are_parsed_with_their_types() {
        let text = format!(
            "# comment\nuint8 A=1\nstring B = \"x # y\"\nHeader header # stamp\nPart[<=3] parts\nfloat64[2] pair\nint32 n 5\n{0}\n\
             MSG: pkg/Header\nbuiltin_interfaces/Time stamp\nstring<=8 frame_id\n{0}\nMSG: pkg/Part\nbool[] flags\n",
            "=".repeat(80)
        );
        let found = Definition::parse("pkg/msg/Root", &text).unwrap();
        let names: Vec<Vec<&str>> =
            found.messages.iter().map(|fields| fields.iter().map(|field| field.name.as_str()).collect()).collect();
        assert_eq!(names, [vec!["header", "parts", "pair", "n"], vec!["stamp", "frame_id"], vec!["flags"]]);
        assert_eq!(found.messages[0][1].count, Count::Any);
        assert_eq!(found.messages[0][2], Field { name: "pair".into(), kind: Kind::F64, count: Count::Exactly(2) });
        assert_eq!((found.messages[1][0].kind, found.messages[1][1].kind), (Kind::Time, Kind::Text));
    }

    #[test]
    fn invalid_definitions_are_rejected() {
        let itself = format!("B b\n{0}\nMSG: p/B\nA a\n", "=".repeat(80));
        for text in ["Unknown x", "int32[0] x", "int32] x", "int32[x] y", "float64 ,", &itself] {
            assert!(Definition::parse("p/A", text).is_err(), "{text}");
        }
    }
}
