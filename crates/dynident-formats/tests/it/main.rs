//! Integration tests of file formats in one binary.
#![allow(clippy::unwrap_used, reason = "tests")]

mod broken;
mod damaged;
mod golden;
