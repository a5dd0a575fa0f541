//! One topic: finds its columns in the first messages and reads the numbers of each message.

use super::part::{Channel, Encoding};
use crate::arrays::MAX_COLUMNS;
use crate::cbor;
use crate::json_numbers::flattened_message;
use crate::protobuf::ProtobufDecoder;
use crate::ros::{Decoder, Definition, Layout, Leaves};
use serde_json::Value;
use std::collections::HashMap;

/// Paths of the time stamp of a message, the preferred one first.
const ROS_STAMPS: &[&str] = &["header.stamp"];
const PROTOBUF_STAMPS: &[&str] = &["header.stamp", "header.timestamp", "timestamp", "stamp", "time"];

#[derive(Debug)]
enum Reader {
    /// Possible definitions of the messages; the first one that fits is kept.
    Binary(Vec<Binary>),
    /// Messages that contain the names of their numbers.
    Named(fn(&[u8]) -> Result<Value, String>),
}

#[derive(Debug)]
enum Binary {
    Ros(Decoder),
    Protobuf(ProtobufDecoder),
}

impl Binary {
    fn read(&self, message: &[u8], named: bool, leaves: &mut Leaves) -> Result<(), String> {
        match self {
            Self::Ros(decoder) => decoder.read(message, named, leaves),
            Self::Protobuf(decoder) => decoder.read(message, named, leaves),
        }
    }

    fn stamps(&self) -> &'static [&'static str] {
        match self {
            Self::Ros(_) => ROS_STAMPS,
            Self::Protobuf(_) => PROTOBUF_STAMPS,
        }
    }
}

fn json(message: &[u8]) -> Result<Value, String> {
    serde_json::from_slice(message).map_err(|error| format!("it is not JSON ({error})"))
}

#[derive(Debug)]
pub(super) struct Topic {
    pub(super) name: String,
    pub(super) kind: String,
    reader: Reader,
    /// Names of the columns without the topic; the first is `log_time`.
    pub(super) columns: Vec<String>,
    column_of: HashMap<String, usize>,
    leaves: Leaves,
    /// Shape of the previous message, and the column of each of its numbers.
    shape: Vec<u8>,
    column_of_leaf: Vec<Option<usize>>,
    /// First value of each column of time stamps, ns.
    origins_ns: HashMap<usize, i64>,
    /// Order of preference and column of the time stamp, if its messages have nonzero time stamps.
    stamp: Option<(usize, usize)>,
    pub(super) messages: u64,
}

#[derive(Debug, Default)]
pub(super) struct Sample {
    pub(super) log_ns: i64,
    pub(super) stamp_ns: Option<i64>,
    /// One value for each column, NaN if the message does not contain it.
    pub(super) values: Vec<f64>,
}

impl Topic {
    /// The topic of a channel.
    ///
    /// # Errors
    /// The reason why its messages cannot be read.
    pub(super) fn new(channel: &Channel) -> Result<Self, String> {
        let reader = match &channel.encoding {
            Encoding::Json => Reader::Named(json),
            Encoding::Cbor => Reader::Named(cbor::value),
            Encoding::Ros1(text) => {
                let definition = Definition::parse(&channel.kind, text)?;
                Reader::Binary(vec![Binary::Ros(Decoder::new(definition, Layout::Ros1))])
            }
            Encoding::Protobuf(schema) => {
                Reader::Binary(vec![Binary::Protobuf(ProtobufDecoder::new(&channel.kind, schema)?)])
            }
            Encoding::Other(what) => return Err(format!("its messages are {what}")),
            Encoding::Cdr(texts) => {
                let decoder = |text: &String| {
                    let definition = Definition::parse(&channel.kind, text)?;
                    Ok(Binary::Ros(Decoder::new(definition, Layout::Cdr)))
                };
                Reader::Binary(texts.iter().map(decoder).collect::<Result<_, String>>()?)
            }
        };
        let log_time = "log_time".to_owned();
        Ok(Self {
            name: channel.topic.clone(),
            kind: channel.kind.clone(),
            reader,
            column_of: HashMap::from([(log_time.clone(), 0)]),
            columns: vec![log_time],
            leaves: Leaves::default(),
            shape: Vec::new(),
            column_of_leaf: Vec::new(),
            origins_ns: HashMap::new(),
            stamp: None,
            messages: 0,
        })
    }

    pub(super) fn is_of(&self, channel: &Channel) -> bool {
        self.name == channel.topic && self.kind == channel.kind
    }

    /// Adds the columns of a message.
    ///
    /// # Errors
    /// The problem of the message.
    pub(super) fn explore(&mut self, log_ns: i64, message: &[u8]) -> Result<(), String> {
        self.origins_ns.entry(0).or_insert(log_ns);
        let mut names = Vec::new();
        match &mut self.reader {
            Reader::Named(value) => {
                flattened_message(&value(message)?, &mut String::new(), &mut |name, _| names.push(name.to_owned()));
            }
            Reader::Binary(decoders) => {
                let mut outcome = Err("its definition is missing".to_owned());
                let fits = decoders.iter().position(|decoder| {
                    outcome = decoder.read(message, true, &mut self.leaves);
                    outcome.is_ok()
                });
                outcome?;
                decoders.swap(0, fits.unwrap_or(0));
                decoders.truncate(1);
                names.clone_from(&self.leaves.paths);
            }
        }
        for name in names {
            if !self.column_of.contains_key(&name) && self.columns.len() < MAX_COLUMNS {
                self.column_of.insert(name.clone(), self.columns.len());
                self.columns.push(name);
            }
        }
        if let Reader::Binary(decoders) = &self.reader {
            let known = decoders.first().map_or(ROS_STAMPS, Binary::stamps);
            for (leaf, stamp) in &self.leaves.stamps_ns {
                let path = &self.leaves.paths[*leaf];
                let Some(&column) = self.column_of.get(path) else { continue };
                self.origins_ns.entry(column).or_insert(*stamp);
                if let Some(preference) = known.iter().position(|known| known == path).filter(|_| *stamp != 0) {
                    let own = (preference, column);
                    self.stamp = Some(self.stamp.map_or(own, |stamp| stamp.min(own)));
                }
            }
        }
        Ok(())
    }

    /// Column of the time stamp, if its messages have nonzero ones.
    pub(super) fn stamp_column(&self) -> Option<usize> {
        self.stamp.map(|(_, column)| column)
    }

    /// Reads a message into `sample`.
    ///
    /// # Errors
    /// The problem of the message.
    pub(super) fn read(&mut self, log_ns: i64, message: &[u8], sample: &mut Sample) -> Result<(), String> {
        self.messages += 1;
        sample.log_ns = log_ns;
        sample.stamp_ns = None;
        sample.values.clear();
        sample.values.resize(self.columns.len(), f64::NAN);
        sample.values[0] = seconds(log_ns, self.origins_ns.get(&0));
        match &mut self.reader {
            Reader::Named(value) => {
                flattened_message(&value(message)?, &mut String::new(), &mut |name, number| {
                    if let Some(column) = self.column_of.get(name) {
                        sample.values[*column] = number;
                    }
                });
            }
            Reader::Binary(decoders) => {
                let decoder = decoders.first().ok_or("its definition is missing")?;
                decoder.read(message, false, &mut self.leaves)?;
                if self.leaves.shape != self.shape || self.column_of_leaf.len() != self.leaves.values.len() {
                    decoder.read(message, true, &mut self.leaves)?;
                    self.shape.clone_from(&self.leaves.shape);
                    let column = |path: &String| self.column_of.get(path).copied();
                    self.column_of_leaf = self.leaves.paths.iter().map(column).collect();
                }
                for (column, value) in self.column_of_leaf.iter().zip(&self.leaves.values) {
                    if let Some(column) = column {
                        sample.values[*column] = *value;
                    }
                }
                let stamp_column = self.stamp.map(|(_, column)| column);
                for (leaf, stamp) in &self.leaves.stamps_ns {
                    if let Some(column) = self.column_of_leaf[*leaf] {
                        sample.values[column] = seconds(*stamp, self.origins_ns.get(&column));
                        if stamp_column == Some(column) {
                            sample.stamp_ns = Some(*stamp);
                        }
                    }
                }
            }
        }
        Ok(())
    }
}

/// Seconds after the first value. They are computed from integer nanoseconds, so that the only error is rounding to a
/// double.
fn seconds(ns: i64, origin: Option<&i64>) -> f64 {
    (i128::from(ns) - i128::from(origin.copied().unwrap_or(0))) as f64 / 1e9
}
