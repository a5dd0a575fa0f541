//! One part of a recording: its messages and channels.

use crate::error::FileError;
use core::fmt;

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    /// CDR, with the texts of possible message definitions.
    Cdr(Vec<String>),
    /// The serialisation of ROS 1: little-endian, without alignment; with the text of the message definition.
    Ros1(String),
    Json,
    Cbor,
    /// Protocol Buffers, with a serialised `FileDescriptorSet`.
    Protobuf(Vec<u8>),
    Other(String),
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Channel {
    pub(super) topic: String,
    pub(super) kind: String,
    pub(super) encoding: Encoding,
}

pub(super) trait Part: fmt::Debug + Send {
    /// The next message: its channel, its recording time (ns), its bytes; `None` at the end.
    fn next(&mut self, message: &mut Vec<u8>) -> Result<Option<(usize, i64)>, FileError>;

    fn channel(&self, index: usize) -> Option<&Channel>;

    fn truncated(&self) -> bool;
}
