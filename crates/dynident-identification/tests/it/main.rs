//! Integration tests of the crate.

mod pauses;
