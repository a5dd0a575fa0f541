//! SQLite files of rosbag2.

use super::part::{Channel, Encoding, Part};
use super::sqlite::{Rows, Sqlite, Value};
use crate::error::FileError;
use crate::ros::definitions_of;
use std::collections::HashMap;
use std::io::Read;
use std::path::Path;

const MAX_MESSAGE_BYTES: u64 = 1 << 28;

#[derive(Debug)]
pub(super) struct Database {
    file: Sqlite,
    rows: Rows,
    channels: HashMap<usize, Channel>,
    /// Indices of topic, time and data in a row of messages.
    fields: [usize; 3],
}

/// Indices of columns in the SQL statement that created a table, by their names.
fn places<const N: usize>(text: &str, names: [&str; N]) -> Option<[usize; N]> {
    let list = text.split_once('(')?.1;
    let columns: Vec<&str> = list
        .split(',')
        .filter_map(|column| column.split_whitespace().next().map(|name| name.trim_matches(['"', '`', '[', ']', ')'])))
        .collect();
    let mut found = [0; N];
    for (place, name) in found.iter_mut().zip(names) {
        *place = columns.iter().position(|column| column == &name)?;
    }
    Some(found)
}

impl Database {
    pub(super) fn open(path: &Path) -> Result<Self, FileError> {
        let mut file = Sqlite::open(path)?;
        let tables = file.tables()?;
        let table = |name: &str| tables.iter().find(|table| table.0 == name);
        let (Some(topics), Some(messages)) = (table("topics"), table("messages")) else {
            return Err(FileError::OtherFormat {
                file: path.to_owned(),
                format: "an SQLite database without a rosbag2 recording",
                fix: "export its table as CSV",
            });
        };
        let mut texts = HashMap::new();
        if let Some((_, page, text)) = table("message_definitions")
            && let Some([kind, encoding, definition]) =
                places(text, ["topic_type", "encoding", "encoded_message_definition"])
        {
            let mut rows = file.rows(*page)?;
            while let Some((_, row)) = file.next(&mut rows)? {
                if let (Some(Value::Text(kind)), Some(Value::Text(encoding)), Some(Value::Text(text))) =
                    (row.get(kind), row.get(encoding), row.get(definition))
                    && encoding == "ros2msg"
                {
                    texts.insert(kind.clone(), text.clone());
                }
            }
        }
        let (page, made) = (topics.1, &topics.2);
        let no_columns = || ["name", "type", "serialization_format"];
        let [name, kind, format] = places(made, no_columns())
            .ok_or_else(|| file.broken("table topics", "columns name, type and serialization_format are missing"))?;
        let mut channels = HashMap::new();
        let mut rows = file.rows(page)?;
        while let Some((id, row)) = file.next(&mut rows)? {
            let (Some(Value::Text(topic)), Some(Value::Text(kind)), Some(Value::Text(format))) =
                (row.get(name), row.get(kind), row.get(format))
            else {
                continue;
            };
            let known = texts.get(kind).map_or_else(|| definitions_of(kind), |text| vec![text.clone()]);
            let encoding = match format.as_str() {
                "cdr" if known.is_empty() => Encoding::Other("cdr without a definition".to_owned()),
                "cdr" => Encoding::Cdr(known),
                other => Encoding::Other(other.to_owned()),
            };
            let Ok(id) = usize::try_from(id) else { continue };
            channels.insert(id, Channel { topic: topic.clone(), kind: kind.clone(), encoding });
        }
        let fields = places(&messages.2, ["topic_id", "timestamp", "data"])
            .ok_or_else(|| file.broken("table messages", "columns topic_id, timestamp and data are missing"))?;
        let rows = file.rows(messages.1)?;
        Ok(Self { file, rows, channels, fields })
    }
}

impl Part for Database {
    fn next(&mut self, message: &mut Vec<u8>) -> Result<Option<(usize, i64)>, FileError> {
        let Some((id, mut row)) = self.file.next(&mut self.rows)? else { return Ok(None) };
        let [topic, time, data] = self.fields;
        let place = || format!("message {id}");
        let (Some(&Value::Integer(topic)), Some(&Value::Integer(time))) = (row.get(topic), row.get(time)) else {
            return Err(self.file.broken(place(), "its topic or its time is not a number"));
        };
        let Some(Value::Blob(bytes)) = row.get_mut(data).map(|value| core::mem::replace(value, Value::Null)) else {
            return Err(self.file.broken(place(), "it has no data"));
        };
        let topic = usize::try_from(topic).ok().filter(|topic| self.channels.contains_key(topic));
        let topic = topic.ok_or_else(|| self.file.broken(place(), "its topic is not in the table of topics"))?;
        *message = bytes;
        // `--compression-mode message` compresses every message separately. Plain CDR starts with 0.
        if message.starts_with(b"\x28\xB5\x2F\xFD") {
            let mut unpacked = Vec::new();
            let read = zstd::stream::read::Decoder::new(&message[..])
                .and_then(|decoder| decoder.take(MAX_MESSAGE_BYTES + 1).read_to_end(&mut unpacked));
            read.map_err(|error| self.file.broken(place(), format!("it cannot be unpacked ({error})")))?;
            if unpacked.len() as u64 > MAX_MESSAGE_BYTES {
                return Err(self.file.broken(place(), "it is larger than 256 MiB"));
            }
            *message = unpacked;
        }
        Ok(Some((topic, time)))
    }

    fn channel(&self, index: usize) -> Option<&Channel> {
        self.channels.get(&index)
    }

    fn truncated(&self) -> bool {
        false
    }
}
