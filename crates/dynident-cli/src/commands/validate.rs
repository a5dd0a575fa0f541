use super::permission::ProgramOptions;
use super::{Context, json, judged, known_in, message_of, show_problems};
use crate::{Verdict, summary, terminal};
use dynident::{ResultFile, RunOptions, validate_result};
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The result.json of an identification.
    result: PathBuf,
    /// Use the result although it was edited after it was written. Its numbers are still checked.
    #[arg(long)]
    accept_edited: bool,
    /// A study with the same robot; its logs with the role "validate" are used, or all logs if none has this role.
    #[arg(long, value_name = "STUDY.toml")]
    study: PathBuf,
    /// Folder of the recordings, if it differs from the study's.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Exit with status 1 if the relative error on any log is larger.
    #[arg(long, value_name = "PERCENT", value_parser = super::percentage)]
    max_validation_error: Option<f64>,
    #[command(flatten)]
    programs: ProgramOptions,
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    let study = options.programs.load_study(&options.study, options.data.as_deref())?;
    let progress = context.progress();
    let run = RunOptions { data: options.data.clone(), threads: context.threads, progress: &*progress };
    let read = if options.accept_edited { ResultFile::read_edited } else { ResultFile::read };
    let stored = read(&options.result).map_err(message_of)?;
    let file = validate_result(&stored, &options.result, &study, &options.study, &run);
    let file = file.map_err(known_in(&options.study))?;
    if context.json {
        terminal::print_document(&json(&file)?)?;
    } else {
        terminal::print(&summary::validation(&file.validation, &file.logs))?;
    }
    show_problems(&file.problems, "");
    let within = judged(&file.validation, options.max_validation_error);
    Ok(if file.problems.is_empty() { within } else { Verdict::Negative })
}
