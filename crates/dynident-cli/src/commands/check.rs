use super::permission::ProgramOptions;
use super::{Context, json, known_in};
use crate::{Verdict, summary, terminal};
use dynident::recording::Level;
use dynident::{RunOptions, check};
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The study file.
    study: PathBuf,
    /// Folder of the recordings, if it differs from the study's.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    #[command(flatten)]
    programs: ProgramOptions,
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    let study = options.programs.load_study(&options.study, options.data.as_deref())?;
    let progress = context.progress();
    let run = RunOptions { data: options.data.clone(), threads: context.threads, progress: &*progress };
    let file = check(&study, &options.study, &run).map_err(known_in(&options.study))?;
    let is_problem = file.check.findings.iter().any(|finding| finding.level == Level::Problem);
    if context.json {
        terminal::print_document(&json(&file)?)?;
    } else if is_problem || !context.quiet {
        terminal::print(&summary::check(&file))?;
    }
    Ok(if is_problem { Verdict::Negative } else { Verdict::Good })
}
