use super::permission::ProgramOptions;
use super::{Context, factors, known_in, message_of, refuse_overwriting};
use crate::Verdict;
use dynident::{ReduceSettings, ResultFile, Role, RunOptions, Study, reduce, seconds_of};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The study file; it must give cut-off and friction, or use --like.
    study: PathBuf,
    /// The factor file to write.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Reduce only this log of the study, in any role; may be given several times. Default: all logs with the
    /// role "identify".
    #[arg(long = "log", value_name = "NAME")]
    logs: Vec<String>,
    /// Process the logs as for this model: with the cut-off, friction and lag of its result.json.
    #[arg(long, value_name = "RESULT.json")]
    like: Option<PathBuf>,
    /// Name of the robot that recorded the logs, if there are several robots of one type.
    #[arg(long, value_name = "NAME")]
    arm: Option<String>,
    /// Time of the recording: 2026-01-05T08:00:00Z, 2026-01-05 (UTC), or seconds since 1970.
    #[arg(long, value_name = "TIME", value_parser = seconds)]
    recorded_at: Option<f64>,
    /// Number of time segments per log, for the error bars: a few logs need many segments, for hundreds of logs one
    /// is enough.
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u16).range(1..=4096))]
    segments: u16,
    /// Folder of the recordings; replaces that of the study.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    #[command(flatten)]
    programs: ProgramOptions,
}

fn seconds(text: &str) -> Result<f64, String> {
    seconds_of(text).ok_or_else(|| "give 2026-01-05T08:00:00Z, 2026-01-05, or seconds since 1970".to_owned())
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    let mut study = options.programs.load_study(&options.study, options.data.as_deref())?;
    let (folder, name) = place(&options.out)?;
    let further: Vec<PathBuf> = options.like.iter().cloned().collect();
    let (path, data) = (&options.study, options.data.as_deref());
    let sections = ["robot", "torque", "log", "format", "motion"];
    refuse_overwriting(folder, &[name], &study, path, data, &sections, &further)?;
    if !options.logs.is_empty() {
        choose(&mut study, &options.logs).map_err(|why| format!("{}: {why}", options.study.display()))?;
    }
    let like = options.like.as_deref().map(ResultFile::read).transpose().map_err(message_of)?;
    let settings = ReduceSettings {
        arm: options.arm.clone(),
        recorded_at_s: options.recorded_at,
        segments: usize::from(options.segments),
    };
    let progress = context.progress();
    let run = RunOptions { data: options.data.clone(), threads: context.threads, progress: &*progress };
    let found = reduce(&study, &options.study, like.as_ref(), &settings, &run).map_err(known_in(&options.study))?;
    factors::write(&found, &options.out, context)?;
    Ok(Verdict::Good)
}

fn place(out: &Path) -> Result<(&Path, &str), String> {
    let name = out.file_name().and_then(|name| name.to_str());
    let name = name.ok_or_else(|| format!("{}: give the name of a file", out.display()))?;
    Ok((out.parent().unwrap_or_else(|| Path::new("")), name))
}

/// Keeps only the named logs, with the role "identify".
fn choose(study: &mut Study, wanted: &[String]) -> Result<(), String> {
    let names: Vec<String> = (0..study.log.len()).map(|index| study.log_name(index)).collect();
    if let Some(unknown) = wanted.iter().find(|name| !names.contains(name)) {
        return Err(format!("no log `{unknown}`; its logs are {}", names.join(", ")));
    }
    let mut own = names.iter();
    study.log.retain(|_| own.next().is_some_and(|name| wanted.contains(name)));
    study.log.iter_mut().for_each(|log| log.role = Role::Identify);
    Ok(())
}
