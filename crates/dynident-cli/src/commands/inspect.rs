//! `dynident inspect ROBOT`.

use super::{Context, json, message_of};
use crate::{Verdict, summary, terminal};
use std::path::PathBuf;

/// Options of `inspect`.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// URDF, or D-H table in TOML.
    robot: PathBuf,
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    let inspection = dynident::inspect(&options.robot).map_err(message_of)?;
    terminal::print(&if context.json { json(&inspection)? } else { summary::inspection(&inspection) })?;
    // A description with problems is read all the same; the status says that a person should look.
    Ok(if inspection.audit.iter().any(|entry| entry.level == "problem") { Verdict::Negative } else { Verdict::Good })
}
