//! From where a log lies to joint values in SI.
//!
//! [`LogSource`] is where rows of numbers come from: [`TextLog`] (CSV and its kin), [`MemoryLog`] and [`JointSamples`]
//! (arrays), or a type of the caller. [`LogFormat`] says what the columns mean, and a [`Log`] is both together.
//! [`LogReader`] is one pass over it: it pairs files, applies units, signs, gears and ranges ([`ChannelGroup`]), deals
//! with missing values, and fills [`RawBlock`]s.
//!
//! A further file format is a file here with a [`LogSource`] and its [`LogTable`], and its line in `FILE_FORMATS`.

mod column_pattern;
mod columns;
mod foreign;
mod format;
mod lines;
mod mapping;
mod memory;
mod reader;
mod row_rules;
mod source;
mod text;
mod units;

pub use format::{
    ChannelGroup, ClockRule, ColumnRef, Columns, Header, LogFormat, Missing, OneOrMany, TimeColumn, TimeUnit,
};
pub use memory::{JointSamples, MemoryLog, SampleClock};
pub use reader::{LinesDropped, LogReader, RawBlock};
pub use row_rules::RowRule;
pub use source::{LogSource, LogTable};
pub use text::TextLog;
pub use units::{Quantity, si_factor, unit_names};

use std::path::Path;
use std::sync::Arc;

/// Makes the source of a file.
type Opener = fn(&Path, &LogFormat) -> Arc<dyn LogSource>;

/// File formats by the extension that names them; a file of any other extension is a text table.
const FILE_FORMATS: &[(&str, Opener)] = &[];

/// The source of the file at `path`. Nothing is read yet.
fn file_source(path: &Path, format: &LogFormat) -> Arc<dyn LogSource> {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    match FILE_FORMATS.iter().find(|(name, _)| name.eq_ignore_ascii_case(extension)) {
        Some((_, opener)) => opener(path, format),
        None => Arc::new(TextLog::new(path, format)),
    }
}

/// A recording: where its rows come from, what its columns mean, and which joints they are of.
///
/// Nothing is read before a pass begins, and it can be read as often as wanted, by several threads at once.
#[derive(Clone, Debug)]
pub struct Log {
    source: Arc<dyn LogSource>,
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
        Self { source, format, joints: joints.to_vec() }
    }

    /// The log whose main file is at `path`; the `file` keys of channel groups are relative to its folder.
    pub fn file(path: &Path, format: LogFormat, joints: &[String]) -> Self {
        Self::shared(file_source(path, &format), format, joints)
    }

    /// Where its rows come from: its label for messages, its estimated number of rows.
    pub fn source(&self) -> &dyn LogSource {
        &*self.source
    }
}
