//! ROS 2 messages: their definitions and the decoding of their numbers.

mod built_in;
mod cdr;
mod definition;

pub(crate) use built_in::definitions_of;
pub(crate) use cdr::{Decoder, Leaves};
pub(crate) use definition::Definition;
