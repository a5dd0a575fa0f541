use super::{Context, json, message_of};
use crate::{Verdict, summary, terminal};
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct Options {
    /// A recording in any supported format, or the folder of a rosbag2 recording.
    file: PathBuf,
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    let found = dynident::log_contents(&options.file).map_err(message_of)?;
    if context.json {
        terminal::print_document(&json(&found)?)?;
    } else {
        terminal::print(&summary::log(&found))?;
    }
    Ok(Verdict::Good)
}
