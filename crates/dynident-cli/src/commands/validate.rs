use super::permission::ProgramOptions;
use super::{Context, json, judged, known_in, message_of, pretty_json, result_file, show_problems};
use crate::{Verdict, summary, terminal};
use dynident::{OutputSet, ResultFile, RunOptions, Study, study_inputs, test_samples, validate_result};
use std::path::{Path, PathBuf};

/// File that describes the tables of samples.
const SAMPLES: &str = "samples.json";

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The result.json of an identification, or its folder.
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
    /// Also write the samples of every log of the study as this test uses them, before the filter, and the filter
    /// (samples.json).
    #[arg(long, value_name = "DIR")]
    samples: Option<PathBuf>,
    #[command(flatten)]
    programs: ProgramOptions,
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    let study = options.programs.load_study(&options.study, options.data.as_deref())?;
    let progress = context.progress();
    let run = RunOptions { data: options.data.clone(), threads: context.threads, progress: &*progress };
    let read = if options.accept_edited { ResultFile::read_edited } else { ResultFile::read };
    let result = result_file(&options.result);
    let stored = read(&result).map_err(message_of)?;
    if let Some(folder) = &options.samples {
        write_samples(folder, options, &study, &result, &stored, &run)?;
    }
    let file = validate_result(&stored, &result, &study, &options.study, &run);
    let file = file.map_err(known_in(&options.study))?;
    if context.json {
        terminal::print_document(&json(&file)?)?;
    } else {
        terminal::print(&summary::validation(&file.validation, &file.logs, &stored.thresholds.errors))?;
    }
    show_problems(&file.problems, "");
    let within = judged(&file.validation, options.max_validation_error);
    Ok(if file.problems.is_empty() { within } else { Verdict::Negative })
}

fn write_samples(
    folder: &Path,
    options: &Options,
    study: &Study,
    result: &Path,
    stored: &ResultFile,
    run: &RunOptions<'_>,
) -> Result<(), String> {
    let (description, tables) =
        test_samples(stored, result, study, &options.study, run).map_err(known_in(&options.study))?;
    let mut outputs = vec![folder.join(SAMPLES)];
    outputs.extend(tables.iter().map(|(name, _)| folder.join(name)));
    let mut inputs = study_inputs(study, &options.study, options.data.as_deref(), &["robot", "torque", "log"]);
    inputs.push(result.to_owned());
    dynident::refuse_overwriting(&outputs, &inputs).map_err(message_of)?;
    let set = OutputSet::new(folder).file(SAMPLES, pretty_json(&description)?);
    let set = tables.into_iter().fold(set, |set, (name, table)| set.file(&name, table));
    set.write().map_err(message_of)
}
