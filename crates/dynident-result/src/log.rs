//! Output of `log` as JSON.

use dynident_recording::FileFormat;
use serde::{Deserialize, Serialize};

/// Name and version of the schema of [`LogContents`].
pub const LOG_SCHEMA: &str = "dynident/log/1";

/// Contents of a recording.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LogContents {
    /// [`LOG_SCHEMA`].
    pub schema: String,
    /// The file, or the folder of a rosbag2 recording.
    pub file: String,
    /// Format, recognised by content: `text`, `MCAP`, `Parquet` ..
    pub format: String,
    /// Total size of all parts, bytes.
    pub bytes: u64,
    /// Groups with a common clock: the topics of a bag, or one for the whole file.
    pub groups: Vec<LogGroupContents>,
    /// All numeric columns, in the order of the file.
    pub channels: Vec<LogChannel>,
    /// Position of a truncation, if any.
    pub truncated: Option<String>,
    /// Contents that are not exposed as channels, with reasons.
    pub notes: Vec<String>,
    /// Draft of a study's `[format]` as TOML, to be checked by a person.
    pub study_format: String,
}

impl LogContents {
    /// Whether the groups are episodes (separate recordings, of which `part` in a study selects one) instead of topics
    /// with one clock.
    pub fn has_episodes(&self) -> bool {
        self.format == FileFormat::Hdf5.name() && self.groups.iter().any(|group| group.name.is_some())
    }

    /// Splits the contents into episodes, each with its name and as if from a separate file; a single recording is
    /// returned unchanged.
    pub fn episodes(self) -> Vec<(Option<String>, Self)> {
        if !self.has_episodes() {
            return vec![(None, self)];
        }
        let episode = |(index, group): (usize, &LogGroupContents)| {
            let part = group.name.clone().unwrap_or_default();
            let own = |name: &str| name.strip_prefix(&part).and_then(|name| name.strip_prefix('.')).map(str::to_owned);
            let channel = |channel: &LogChannel| {
                let name = own(&channel.name).unwrap_or_else(|| channel.name.clone());
                LogChannel { name, group: 0, ..channel.clone() }
            };
            let channels = self.channels.iter().filter(|channel| channel.group == index).map(channel).collect();
            let time = group.time.as_deref().and_then(own);
            let groups = vec![LogGroupContents { name: None, time, ..group.clone() }];
            (Some(part), Self { groups, channels, ..self.clone() })
        };
        self.groups.iter().enumerate().map(episode).collect()
    }

    /// Unit of the channel with this name in a group.
    pub fn unit(&self, group: usize, name: &str) -> Option<&str> {
        let found = self.channels.iter().find(|channel| channel.group == group && channel.name == name);
        found.and_then(|channel| channel.unit.as_deref())
    }
}

/// Columns that were recorded together.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LogGroupContents {
    /// The topic; null for a single table.
    pub name: Option<String>,
    /// Number of rows, or messages of a topic.
    pub rows: u64,
    /// The time column; null if unknown.
    pub time: Option<String>,
    /// Difference between the last and first time stamp, s.
    pub span_s: Option<f64>,
    /// Mean sample rate, Hz; gaps of more than five mean steps are excluded.
    pub rate_hz: Option<f64>,
}

/// One column.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LogChannel {
    /// Name to write under `columns` in a study: the name of the column, or its index from 0.
    pub name: String,
    /// Index of its group in `groups`.
    pub group: usize,
    /// Unit from its name or the format; null if unknown.
    pub unit: Option<String>,
    /// Sample rate of its group, Hz.
    pub rate_hz: Option<f64>,
    /// Number of finite values.
    pub samples: u64,
    /// Number of empty, NaN or infinite values.
    pub missing: u64,
    /// Smallest and largest value; null without values.
    pub range: Option<[f64; 2]>,
    /// Course of the values for a small plot: means of up to 48 equal parts of the recording, in order; null for a part
    /// without values.
    pub course: Vec<Option<f64>>,
}
