//! What `log` prints: the schema of its JSON.

use serde::{Deserialize, Serialize};

/// Name and version of the schema of [`LogContents`].
pub const LOG_SCHEMA: &str = "dynident/log/1";

/// What a recording holds.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LogContents {
    /// [`LOG_SCHEMA`].
    pub schema: String,
    /// The file, or the folder of a rosbag2 recording.
    pub file: String,
    /// What it is, by its content: `text`, `MCAP`, `Parquet` ..
    pub format: String,
    /// Its size, all parts together.
    pub bytes: u64,
    /// What was recorded together, each on its own clock: the topics of a bag, or one for the whole file.
    pub groups: Vec<LogGroupContents>,
    /// Every column of numbers, in the order of the file.
    pub channels: Vec<LogChannel>,
    /// Where the file is cut off, if it is.
    pub truncated: Option<String>,
    /// What it holds beside its channels, and why that is none, a sentence each.
    pub notes: Vec<String>,
    /// What a study could say of it, as TOML: a beginning, for a person to look at.
    pub study_format: String,
}

/// Columns that were recorded together.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LogGroupContents {
    /// The topic; null where the file is one table.
    pub name: Option<String>,
    /// Rows: messages of a topic.
    pub rows: u64,
    /// The column of its time stamps; null where none is known.
    pub time: Option<String>,
    /// From the first stamp to the last.
    pub span_s: Option<f64>,
    /// Steps by the span; holes of more than five mean steps are left out.
    pub rate_hz: Option<f64>,
}

/// One column.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LogChannel {
    /// What `columns` of a study calls it: its name, or its 0-based index.
    pub name: String,
    /// Number of its group in `groups`.
    pub group: usize,
    /// The unit that its name says, or the format; null where neither does.
    pub unit: Option<String>,
    /// Rate of its group.
    pub rate_hz: Option<f64>,
    /// Rows in which it has a value.
    pub samples: u64,
    /// Rows in which it is empty, NaN or infinite.
    pub missing: u64,
    /// Lowest and highest value; null where it has none.
    pub range: Option<[f64; 2]>,
    /// Means of up to 48 equal parts of the recording, in order; null for a part without a value.
    pub course: Vec<Option<f64>>,
}
