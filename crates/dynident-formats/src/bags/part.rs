//! One part of a recording: its messages and the channels that they belong to.

use crate::error::FileError;
use core::fmt;

/// How messages of a channel are written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    /// CDR; the texts of a definition that may explain it.
    Cdr(Vec<String>),
    /// JSON.
    Json,
    /// Any other, and what it is.
    Other(String),
}

/// One stream of messages in a part of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Channel {
    pub(super) topic: String,
    pub(super) kind: String,
    pub(super) encoding: Encoding,
}

/// One part of a recording, read from its beginning.
pub(super) trait Part: fmt::Debug + Send {
    /// The next message: its channel, the time at which it was recorded (ns), its bytes; `None` at the end.
    fn next(&mut self, message: &mut Vec<u8>) -> Result<Option<(usize, i64)>, FileError>;

    /// A channel that was already read, by its number.
    fn channel(&self, index: usize) -> Option<&Channel>;

    /// Whether the part ended too early.
    fn truncated(&self) -> bool;
}
