//! The jobs of the command: each reads files, calls the crates below, and returns what is written.

pub(crate) mod evaluate;
pub(crate) mod identify;
pub(crate) mod inspect;
pub(crate) mod options;
pub(crate) mod validate;
