//! Reading and writing of factor files for `reduce`, `merge` and `identify --factors`.

use super::{Context, json};
use crate::{summary, terminal};
use dynident::{Factors, write_atomically};
use std::path::{Path, PathBuf};

/// Reads factors; error messages contain the file name.
pub(super) fn read(path: &Path) -> Result<Factors, String> {
    let bytes = dynident::read_result(path).map_err(super::message_of)?;
    Factors::from_bytes(&bytes).map_err(|error| format!("{}: {error}", path.display()))
}

pub(super) fn read_all(paths: &[PathBuf]) -> Result<Factors, String> {
    let parts: Vec<Factors> = paths.iter().map(|path| read(path)).collect::<Result<_, _>>()?;
    Factors::merged(parts).map_err(|error| error.to_string())
}

pub(super) fn write(factors: &Factors, out: &Path, context: &Context) -> Result<(), String> {
    let bytes = factors.to_bytes().map_err(|error| format!("{}: {error}", out.display()))?;
    write_atomically(out, &bytes).map_err(super::message_of)?;
    let file = factors.file(out, bytes.len() as u64);
    if context.json {
        terminal::print_document(&json(&file)?)
    } else if context.quiet {
        Ok(())
    } else {
        terminal::print(summary::factors(&file).trim_end())
    }
}
