//! From where a log lies to joint values in SI.
//!
//! [`LogSource`] is where rows of numbers come from: [`FileLog`] (a file of any format that is read), [`MemoryLog`] and
//! [`JointSamples`] (arrays), or a type of the caller. [`LogFormat`] says what the columns mean, and a [`Log`] is both
//! together. [`LogReader`] is one pass over it: it pairs files, applies units, signs, gears and ranges
//! ([`ChannelGroup`]), deals with missing values, and fills [`RawBlock`]s.
//!
//! What a file holds is the business of dynident-formats, where a further format goes; text becomes a table here.

mod blocks;
mod channels;
mod column_pattern;
mod columns;
mod file;
mod format;
mod found_rules;
mod lines;
mod mapping;
mod memo;
mod memory;
mod plain_row;
mod reader;
mod row_count;
mod row_rules;
mod shared_samples;
mod source;
mod text;
mod units;

pub(crate) use blocks::RawBlocks;
pub use channels::{ChannelGroup, ColumnRef, Columns, OneOrMany};
pub use file::FileLog;
pub use format::{ClockRule, Header, LogFormat, Missing, TimeColumn, TimeUnit};
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

/// The files that hold what `path` names: itself, or the parts of a rosbag2 recording's folder.
///
/// # Errors
/// If a folder's list of parts cannot be read.
pub fn files(path: &Path) -> Result<Vec<std::path::PathBuf>, crate::RecordingError> {
    Ok(dynident_formats::files(path)?)
}

/// A recording: where its rows come from, what its columns mean, and which joints they are of.
///
/// Nothing is read before a pass begins, and it can be read as often as wanted, by several threads at once.
#[derive(Clone, Debug)]
pub struct Log {
    source: Arc<dyn LogSource>,
    /// For a format that asks for a fraction of them.
    row_count: Arc<RowCount>,
    memo: Arc<Memo>,
    /// What the columns mean, and which part of the log is asked for.
    pub format: LogFormat,
    /// Names of the joints, in the order of the format's columns.
    pub joints: Vec<String>,
}

impl Log {
    /// Rows of `source`, understood as `format` says.
    pub fn new(source: impl LogSource + 'static, format: LogFormat, joints: &[String]) -> Self {
        Self::shared(Arc::new(source), format, joints)
    }

    /// As [`new`](Self::new), for a source that others hold as well.
    pub fn shared(source: Arc<dyn LogSource>, format: LogFormat, joints: &[String]) -> Self {
        Self { source, row_count: Arc::default(), memo: Arc::default(), format, joints: joints.to_vec() }
    }

    /// The log whose main file is at `path`; the `file` keys of channel groups are relative to its folder.
    pub fn file(path: &Path, format: LogFormat, joints: &[String]) -> Self {
        let source = Arc::new(FileLog::new(path, &format));
        Self::shared(source, format, joints)
    }

    /// Where its rows come from: its label for messages, its estimated number of rows.
    pub fn source(&self) -> &dyn LogSource {
        &*self.source
    }
}
