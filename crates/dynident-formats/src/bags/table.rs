//! A recording as a table: a group of columns for each topic; columns of several topics are joined.

use super::joined::Joined;
use super::messages::{Header, Messages};
use super::parts;
use super::topic::{Sample, Topic};
use super::unpacked::inner_format;
use crate::Contents;
use crate::error::FileError;
use crate::kind::FileFormat;
use crate::table::{ColumnGroup, Table};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Maximum number of messages that are searched for topics and columns, and maximum number of their bytes.
const MAX_SEARCHED_MESSAGES: u64 = 20_000;
const MAX_SEARCHED_BYTES: usize = 1 << 26;
/// Number of messages per topic that are searched for columns; several, because publishers may alternate on a topic.
const MAX_SEARCHED_PER_TOPIC: u64 = 64;

/// Opens one file, possibly compressed as a whole.
pub(crate) fn open_file(path: &Path, format: FileFormat) -> Result<Contents, FileError> {
    BagTable::open(path, &[(path.to_owned(), format)])
}

pub(crate) fn open_folder(path: &Path) -> Result<Contents, FileError> {
    let mut found = Vec::new();
    for part in parts(path)? {
        match inner_format(&part)? {
            format @ (FileFormat::Mcap | FileFormat::Rosbag2) => found.push((part, format)),
            other => {
                let problem = format!("it is {}, not a part of a recording", other.name());
                return Err(FileError::broken(&part, FileFormat::Rosbag2, "its beginning", problem, "copy it again"));
            }
        }
    }
    BagTable::open(path, &found)
}

#[derive(Debug)]
struct BagTable {
    path: PathBuf,
    format: FileFormat,
    messages: Messages,
    topics: Vec<Topic>,
    /// Topic of each known channel; `None` if it is not read.
    topic_of: HashMap<(usize, usize), Option<usize>>,
    names: Vec<String>,
    groups: Vec<ColumnGroup>,
    notes: Vec<String>,
    plan: Plan,
    buffer: Vec<u8>,
    sample: Sample,
}

#[derive(Debug)]
struct Plan {
    /// Index of each topic, starting with the topic that provides the times, and its columns.
    topics: Vec<(usize, Vec<usize>)>,
    /// Index of each selected column in a joined row.
    places: Vec<usize>,
    /// Whether topics are joined by the time stamps in their messages instead of their recording times.
    by_stamp: bool,
    joined: Joined,
    ended: bool,
}

impl BagTable {
    fn open(path: &Path, parts: &[(PathBuf, FileFormat)]) -> Result<Contents, FileError> {
        let format = if parts.len() == 1 { parts[0].1 } else { FileFormat::Rosbag2 };
        let mut table = Self {
            path: path.to_owned(),
            format,
            messages: Messages::new(parts),
            topics: Vec::new(),
            topic_of: HashMap::new(),
            names: Vec::new(),
            groups: Vec::new(),
            notes: Vec::new(),
            plan: Plan {
                topics: Vec::new(),
                places: Vec::new(),
                by_stamp: false,
                joined: Joined::new(0),
                ended: false,
            },
            buffer: Vec::new(),
            sample: Sample::default(),
        };
        table.search()?;
        table.messages = Messages::new(parts);
        if table.names.is_empty() {
            let found = if table.notes.is_empty() { "it has no messages".to_owned() } else { table.notes.join("; ") };
            let fix = "record a topic with joint states";
            return Err(FileError::no_columns(path, format, found, fix));
        }
        table.select(&(0..table.groups[0].columns.len()).collect::<Vec<_>>());
        Ok(Contents::Table(Box::new(table)))
    }

    fn search(&mut self) -> Result<(), FileError> {
        let (mut searched, mut bytes) = (0, 0);
        while searched < MAX_SEARCHED_MESSAGES && bytes < MAX_SEARCHED_BYTES {
            let header = match self.messages.next(&mut self.buffer) {
                Ok(Some(header)) => header,
                Ok(None) => break,
                // An error after the first message is reported when the message is read.
                Err(_) if searched > 0 => break,
                Err(error) => return Err(error),
            };
            searched += 1;
            bytes += self.buffer.len();
            let Some(index) = self.topic(header) else { continue };
            let topic = &mut self.topics[index];
            if topic.messages < MAX_SEARCHED_PER_TOPIC {
                topic.messages += 1;
                if let Err(problem) = topic.explore(header.log_ns, &self.buffer) {
                    let note = format!("{} ({}): {problem}", topic.name, topic.kind);
                    if topic.messages == 1 {
                        self.notes.push(note);
                    }
                }
            }
        }
        self.topics.sort_by(|a, b| a.name.cmp(&b.name));
        self.topic_of.clear();
        let mut kept = Vec::new();
        for mut topic in core::mem::take(&mut self.topics) {
            // A topic that has only a time column has no data.
            if topic.columns.len() == 1 {
                let note = format!("{} ({}): not numeric", topic.name, topic.kind);
                if !self.notes.iter().any(|known| known.starts_with(&format!("{} (", topic.name))) {
                    self.notes.push(note);
                }
                continue;
            }
            topic.messages = 0;
            let begin = self.names.len();
            self.names.extend(topic.columns.iter().map(|column| format!("{}.{column}", topic.name)));
            self.groups.push(ColumnGroup {
                name: Some(topic.name.clone()),
                columns: begin..self.names.len(),
                time: Some(begin + topic.stamp_column().unwrap_or(0)),
            });
            kept.push(topic);
        }
        self.topics = kept;
        Ok(())
    }

    /// The topic of the current message. While columns are searched, a new topic is added.
    fn topic(&mut self, header: Header) -> Option<usize> {
        if let Some(known) = self.topic_of.get(&header.channel) {
            return *known;
        }
        let channel = self.messages.channel(header)?;
        let mut found = self.topics.iter().position(|topic| topic.is_of(channel));
        // Names are fixed after the search; topics found later have no columns.
        if found.is_none() && self.groups.is_empty() {
            match Topic::new(channel) {
                Ok(topic) => {
                    self.topics.push(topic);
                    found = Some(self.topics.len() - 1);
                }
                Err(problem) => {
                    let note = format!("{} ({}): {problem}", channel.topic, channel.kind);
                    if !self.notes.contains(&note) {
                        self.notes.push(note);
                    }
                }
            }
        }
        self.topic_of.insert(header.channel, found);
        found
    }

    fn read(&mut self, index: usize, header: Header) -> Result<(), FileError> {
        let topic = &mut self.topics[index];
        topic.read(header.log_ns, &self.buffer, &mut self.sample).map_err(|problem| {
            let place = format!("message {} of {}", topic.messages, topic.name);
            FileError::broken(&self.path, self.format, place, problem, "leave the topic out, or record it again")
        })
    }

    /// Whether a message is a row of the selected columns. Several publishers may alternate on one topic; a message
    /// without any selected value is ignored.
    fn is_row(&self, topic: usize, columns: &[usize], values: &[f64]) -> bool {
        let clocks = [Some(0), self.topics[topic].stamp_column()];
        let has_value = |(column, value): (&usize, &f64)| !clocks.contains(&Some(*column)) && !value.is_nan();
        let only_clocks = columns.iter().all(|column| clocks.contains(&Some(*column)));
        only_clocks || columns.iter().zip(values).any(has_value)
    }

    fn advance(&mut self) -> Result<Option<Vec<f64>>, FileError> {
        loop {
            if let Some(row) = self.plan.joined.next() {
                return Ok(Some(row));
            }
            if self.plan.ended {
                return Ok(None);
            }
            let Some(header) = self.messages.next(&mut self.buffer)? else {
                self.plan.ended = true;
                self.plan.joined.end();
                continue;
            };
            let Some(index) = self.topic(header) else { continue };
            let Some(at) = self.plan.topics.iter().position(|(topic, _)| *topic == index) else { continue };
            self.read(index, header)?;
            let columns = &self.plan.topics[at].1;
            let values: Vec<f64> = columns.iter().map(|column| self.sample.values[*column]).collect();
            if !self.is_row(index, columns, &values) {
                continue;
            }
            let stamp = if self.plan.by_stamp { self.sample.stamp_ns } else { None };
            let at_ns = stamp.unwrap_or(self.sample.log_ns);
            if at > 0 {
                self.plan.joined.push_side(at - 1, at_ns, values);
            } else if let Err(silent) = self.plan.joined.push_row(at_ns, values) {
                let name = self.plan.topics.get(silent + 1).map_or("", |(topic, _)| self.topics[*topic].name.as_str());
                let problem = format!("it has no messages during a million messages of {}", self.topics[index].name);
                let place = format!("topic {name}");
                return Err(FileError::broken(
                    &self.path,
                    self.format,
                    place,
                    problem,
                    "do not use its columns in a log",
                ));
            }
        }
    }
}

impl Table for BagTable {
    fn width(&self) -> usize {
        self.names.len()
    }

    fn names(&self) -> Option<&[String]> {
        Some(&self.names)
    }

    fn groups(&self) -> Vec<ColumnGroup> {
        self.groups.clone()
    }

    fn select(&mut self, columns: &[usize]) {
        let mut topics: Vec<(usize, Vec<usize>)> = Vec::new();
        // Topic and column of each selected column, and its index among the values of the topic.
        let mut slots = Vec::new();
        for column in columns {
            let Some(topic) = self.groups.iter().position(|group| group.columns.contains(column)) else { continue };
            let own = column - self.groups[topic].columns.start;
            let at = topics.iter().position(|(known, _)| *known == topic).unwrap_or_else(|| {
                topics.push((topic, Vec::new()));
                topics.len() - 1
            });
            slots.push((at, topics[at].1.len()));
            topics[at].1.push(own);
        }
        let begins: Vec<usize> = topics
            .iter()
            .scan(0, |sum, (_, columns)| {
                let begin = *sum;
                *sum += columns.len();
                Some(begin)
            })
            .collect();
        let by_log_time = topics.first().is_some_and(|(_, columns)| columns.contains(&0));
        self.plan = Plan {
            places: slots.into_iter().map(|(at, slot)| begins[at] + slot).collect(),
            by_stamp: !by_log_time && topics.iter().all(|(topic, _)| self.topics[*topic].stamp_column().is_some()),
            joined: Joined::new(topics.len().saturating_sub(1)),
            ended: false,
            topics,
        };
    }

    fn next_row(&mut self, values: &mut [f64]) -> Result<bool, FileError> {
        let Some(row) = self.advance()? else { return Ok(false) };
        for (value, place) in values.iter_mut().zip(&self.plan.places) {
            *value = row[*place];
        }
        Ok(true)
    }

    fn skip_row(&mut self) -> Result<bool, FileError> {
        Ok(self.advance()?.is_some())
    }

    fn all_rows(&mut self, each: &mut dyn FnMut(usize, &[f64])) -> Result<(), FileError> {
        let columns: Vec<Vec<usize>> = self.topics.iter().map(|topic| (0..topic.columns.len()).collect()).collect();
        while let Some(header) = self.messages.next(&mut self.buffer)? {
            let Some(index) = self.topic(header) else { continue };
            self.read(index, header)?;
            if self.is_row(index, &columns[index], &self.sample.values) {
                each(index, &self.sample.values);
            }
        }
        Ok(())
    }

    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    fn truncated(&self) -> bool {
        self.messages.truncated()
    }
}
