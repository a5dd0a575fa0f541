//! One file per subcommand.

pub(crate) mod evaluate;
pub(crate) mod identify;
pub(crate) mod inspect;
pub(crate) mod validate;

use crate::progress::Bar;
use crate::terminal;
use dynident::{Progress, Silent};
use serde::Serialize;

/// What every command knows of how it was called.
pub(crate) struct Context {
    pub(crate) json: bool,
    pub(crate) quiet: bool,
    pub(crate) threads: usize,
}

impl Context {
    /// A bar for people who watch; silence for pipes and `--quiet`.
    pub(crate) fn progress(&self) -> Box<dyn Progress> {
        if self.quiet || !terminal::watched() { Box::new(Silent) } else { Box::new(Bar::default()) }
    }
}

/// Runs `job` in a pool of `threads` threads.
pub(crate) fn with_threads<R: Send>(threads: usize, job: impl FnOnce() -> R + Send) -> R {
    match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
        Ok(pool) => pool.install(job),
        // A system that refuses threads still gets its result.
        Err(_) => job(),
    }
}

/// A value as one line of JSON.
pub(crate) fn json<T: Serialize>(value: &T) -> Result<String, String> {
    serde_json::to_string(value).map_err(|error| format!("the result cannot be written as JSON: {error}"))
}

/// A value as JSON for a file: a person may want to read it.
pub(crate) fn pretty_json<T: Serialize>(value: &T) -> Result<Vec<u8>, String> {
    let mut bytes =
        serde_json::to_vec_pretty(value).map_err(|error| format!("the result cannot be written as JSON: {error}"))?;
    bytes.push(b'\n');
    Ok(bytes)
}

/// An error's message.
pub(crate) fn told(error: dynident::Error) -> String {
    error.to_string()
}
