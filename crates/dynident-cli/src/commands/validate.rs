//! `dynident validate DIR/result.json --study STUDY.toml`.

use super::permission::ProgramOptions;
use super::{Context, json, judged, known_in, show_problems};
use crate::{Verdict, summary, terminal};
use dynident::{RunOptions, validate};
use std::path::PathBuf;

/// Options of `validate`.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The result.json of an identification.
    result: PathBuf,
    /// A study with the same robot; its logs with the role "validate" are used, or all of them if none has it.
    #[arg(long, value_name = "STUDY.toml")]
    study: PathBuf,
    /// Folder of the recordings, in place of the study's own.
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
    let file = validate(&options.result, &study, &options.study, &run).map_err(known_in(&options.study))?;
    terminal::print(&if context.json { json(&file)? } else { summary::validation(&file.validation, &file.logs) })?;
    show_problems(&file.problems, "");
    let within = judged(&file.validation, options.max_validation_error);
    Ok(if file.problems.is_empty() { within } else { Verdict::Negative })
}
