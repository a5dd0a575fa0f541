//! Reading of joint values in SI units from logs.
//!
//! [`LogSource`] provides rows of numbers: [`FileLog`] (a file in any supported format), [`MemoryLog`] and
//! [`JointSamples`] (arrays), or a type of the caller. [`LogFormat`] maps columns to quantities, and a [`Log`] combines
//! both. [`LogReader`] makes one pass over a log: it combines the files, applies units, signs, gear ratios and ranges
//! ([`ChannelGroup`]), treats missing values, and returns [`RawBlock`]s.
//!
//! The crate dynident-formats reads binary file formats; add new formats there. Text tables are parsed here.

mod blocks;
mod channels;
mod column_pattern;
mod columns;
mod field;
mod file;
mod format;
mod found_rules;
mod ignored_torque;
mod lines;
mod mapping;
mod memo;
mod memory;
mod part;
mod plain_row;
mod reader;
mod row_count;
mod row_labels;
mod row_rules;
mod sage;
mod shared_samples;
mod source;
mod split_stamps;
mod stamps;
mod table_start;
mod text;
mod text_columns;
mod units;

pub(crate) use blocks::RawBlocks;
pub use channels::{ChannelGroup, ColumnRef, Columns, OneOrMany};
pub use file::FileLog;
pub use format::{ClockRule, Header, LogFormat, Missing, TimeColumn, TimeUnit};
pub use ignored_torque::IgnoredTorque;
pub use memory::{JointSamples, MemoryLog, SampleClock};
pub use reader::{LinesDropped, LogReader, RawBlock};
pub use row_rules::RowRule;
pub use shared_samples::{LogSamples, SharedSamples};
pub use source::{LogGroup, LogSource, LogTable};
pub use units::{Quantity, si_factor, unit_names};

use memo::Memo;
use row_count::RowCount;
use std::path::Path;
use std::sync::Arc;

/// The files of a recording: `path` itself, or the parts in the folder of a rosbag2 recording.
///
/// # Errors
/// If a folder's list of parts cannot be read.
pub fn files(path: &Path) -> Result<Vec<std::path::PathBuf>, crate::RecordingError> {
    Ok(dynident_formats::files(path)?)
}

/// A recording: source of rows, mapping of columns, and names of joints.
///
/// The samples are read when a pass starts. Any number of passes is possible, also by several threads at once.
#[derive(Clone, Debug)]
pub struct Log {
    source: Arc<dyn LogSource>,
    /// Number of rows, which is needed for a format that selects a fraction of the rows.
    row_count: Arc<RowCount>,
    memo: Arc<Memo>,
    /// Mapping of the columns, and selection of rows.
    pub format: LogFormat,
    /// Names of the joints, in the order of the format's columns.
    pub joints: Vec<String>,
    /// Time intervals whose torque is ignored; motion and clock use all rows.
    pub ignored_torque: Vec<IgnoredTorque>,
}

impl Log {
    /// Creates a log from the rows of `source`, interpreted by `format`.
    pub fn new(source: impl LogSource + 'static, format: LogFormat, joints: &[String]) -> Self {
        Self::shared(Arc::new(source), format, joints)
    }

    /// As [`new`](Self::new), for a shared source.
    pub fn shared(source: Arc<dyn LogSource>, format: LogFormat, joints: &[String]) -> Self {
        Self {
            source,
            row_count: Arc::default(),
            memo: Arc::default(),
            format,
            joints: joints.to_vec(),
            ignored_torque: Vec::new(),
        }
    }

    /// Creates a log from the file at `path`. The `file` keys of channel groups are relative to the folder of this
    /// file.
    pub fn file(path: &Path, format: LogFormat, joints: &[String]) -> Self {
        let source = Arc::new(FileLog::new(path, &format));
        Self::shared(source, format, joints)
    }

    /// Source of the rows.
    pub fn source(&self) -> &dyn LogSource {
        &*self.source
    }
}
