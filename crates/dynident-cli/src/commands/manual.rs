//! `dynident man DIR`: for packagers, so it is not listed in the help.

use super::{Context, message_of};
use crate::Verdict;
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The folder, which is created if necessary.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

pub(crate) fn run(options: &Options, command: clap::Command, _: &Context) -> Result<Verdict, String> {
    let folder = &options.folder;
    let cannot = |error: std::io::Error| format!("{}: cannot be written: {error}", folder.display());
    std::fs::create_dir_all(folder).map_err(cannot)?;
    // A manual page of the command `help` would only repeat the list of commands.
    let mut command = command.disable_help_subcommand(true);
    command.build();
    let one_page = |command: clap::Command| -> Result<(), String> {
        let page = clap_mangen::Man::new(command);
        let mut text = Vec::new();
        page.render(&mut text).map_err(cannot)?;
        dynident::write_atomically(&folder.join(page.get_filename()), &text).map_err(message_of)
    };
    for one in command.get_subcommands().filter(|one| !one.is_hide_set()) {
        one_page(one.clone())?;
    }
    one_page(command)?;
    Ok(Verdict::Good)
}
