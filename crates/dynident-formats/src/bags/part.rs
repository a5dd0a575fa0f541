//! One part of a recording: its messages and channels.

use crate::error::FileError;
use core::fmt;

/// Encoding of a channel's messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    /// CDR, with the texts of possible message definitions.
    Cdr(Vec<String>),
    /// JSON.
    Json,
    /// Another encoding, described.
    Other(String),
}

/// A channel of messages in a part of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Channel {
    pub(super) topic: String,
    pub(super) kind: String,
    pub(super) encoding: Encoding,
}

/// One part of a recording, read sequentially.
pub(super) trait Part: fmt::Debug + Send {
    /// The next message: its channel, its recording time (ns), its bytes; `None` at the end.
    fn next(&mut self, message: &mut Vec<u8>) -> Result<Option<(usize, i64)>, FileError>;

    /// A channel by its index.
    fn channel(&self, index: usize) -> Option<&Channel>;

    /// Whether the part is truncated.
    fn truncated(&self) -> bool;
}
