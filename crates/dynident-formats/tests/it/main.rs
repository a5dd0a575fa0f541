//! Tests of what files hold, in one program.
#![allow(clippy::unwrap_used, reason = "tests")]

mod broken;
mod damaged;
mod golden;
