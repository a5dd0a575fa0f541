//! `dynident identify STUDY.toml --out DIR`.

use super::{Context, json, judged, pretty_json, told, told_in};
use crate::{Verdict, summary, terminal};
use dynident::{RunOptions, Study, check_writable, identify, write_whole};
use std::path::PathBuf;

/// The user's description with the new values.
const URDF: &str = "identified.urdf";

/// Options of `identify`.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The study file.
    study: PathBuf,
    /// Folder for result.json, report.html and identified.urdf.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Folder of the recordings, in place of the study's own.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Exit with status 1 if the relative error on any held-out log is larger, or if none is held out.
    #[arg(long, value_name = "PERCENT", value_parser = super::percentage)]
    max_validation_error: Option<f64>,
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    let study = Study::load(&options.study).map_err(told)?;
    check_writable(&options.out).map_err(told)?;
    let progress = context.progress();
    let run = RunOptions { data: options.data.clone(), threads: context.threads, progress: &*progress };
    let identification = identify(&study, &options.study, &run).map_err(told_in(&options.study))?;
    let result = &identification.result;
    if let Some(urdf) = &identification.urdf {
        write_whole(&options.out.join(URDF), urdf.as_bytes()).map_err(told)?;
    } else if options.out.join(URDF).exists() {
        let old = options.out.join(URDF);
        terminal::remark(&format!("{} is of an earlier run and does not belong to this result", old.display()));
    }
    let report = identification.report().map_err(told)?;
    write_whole(&options.out.join("report.html"), report.as_bytes()).map_err(told)?;
    // The result last: where it stands, everything stands.
    write_whole(&options.out.join("result.json"), &pretty_json(result)?).map_err(told)?;
    if context.json {
        terminal::print(&json(result)?);
    } else if !context.quiet {
        terminal::print(&summary::identification(result, &options.out, identification.urdf.is_some()));
    }
    Ok(judged(&result.validation, options.max_validation_error))
}
