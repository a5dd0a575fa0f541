use super::Context;
use crate::{Verdict, terminal};
use clap_complete::Shell;

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The shell.
    shell: Shell,
}

pub(crate) fn run(options: &Options, mut command: clap::Command, context: &Context) -> Result<Verdict, String> {
    if context.json {
        return Err("completions prints a shell script, which is not JSON: omit --json".to_owned());
    }
    let mut script = Vec::new();
    clap_complete::generate(options.shell, &mut command, "dynident", &mut script);
    terminal::print_own(&script)?;
    Ok(Verdict::Good)
}
