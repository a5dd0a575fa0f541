//! ROS messages: their definitions and the decoding of their numbers.

mod built_in;
mod cdr;
mod definition;

pub(crate) use built_in::definitions_of;
pub(crate) use cdr::{Decoder, Layout, Leaves, MAX_ARRAY_COLUMNS, MAX_LEAVES};
pub(crate) use definition::Definition;

/// Whether a text field contains the names of the entries of other arrays.
pub(crate) fn names_entries(field: &str) -> bool {
    field == "name" || field == "names" || field.ends_with("_names")
}
