//! `dynident identify STUDY.toml --out DIR`.

use super::{Context, json, judged, known_in, message_of, pretty_json, refuse_overwriting};
use crate::{Verdict, summary, terminal};
use dynident::{OutputSet, RunOptions, Study, check_writable, identify};
use std::path::PathBuf;

/// The user's description with the new values.
const URDF: &str = "identified.urdf";
/// The same as a D-H table, where the user's is one.
const TABLE: &str = "identified.toml";
/// The same as an MJCF, where the user's is one.
const MJCF: &str = "identified.xml";
/// The same as an SDF, where the user's is one.
const SDF: &str = "identified.sdf";
/// Problems on standard error; the others stand in the file.
const PROBLEMS_SHOWN: usize = 8;

/// Options of `identify`.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The study file.
    study: PathBuf,
    /// Folder for result.json, report.html and identified.urdf (of a D-H table identified.toml as well, of an MJCF
    /// identified.xml, of an SDF identified.sdf).
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
    let study = Study::load(&options.study).map_err(message_of)?;
    let out = (&*options.out, &[URDF, TABLE, MJCF, SDF, "report.html", "result.json"][..]);
    let of_study = (&study, &*options.study, options.data.as_deref());
    refuse_overwriting(out, of_study, &["robot", "torque", "log", "arm", "format", "motion", "estimator"], &[])?;
    check_writable(&options.out).map_err(message_of)?;
    let progress = context.progress();
    let run = RunOptions { data: options.data.clone(), threads: context.threads, progress: &*progress };
    let mut identification = identify(&study, &options.study, &run).map_err(known_in(&options.study))?;
    if let Some(provenance) = &mut identification.result.provenance {
        provenance.command = Some(command(options));
    }
    let result = &identification.result;
    let mut set = OutputSet::new(&options.out)
        .file("result.json", pretty_json(result)?)
        .file("report.html", identification.report().map_err(message_of)?);
    let mut models = Vec::new();
    let texts = [
        (URDF, &identification.urdf),
        (TABLE, &identification.table),
        (MJCF, &identification.mjcf),
        (SDF, &identification.sdf),
    ];
    for (name, text) in texts {
        models.extend(text.as_ref().map(|_| name));
        set = match text {
            Some(text) => set.file(name, text.as_str()),
            None => set.absent(name),
        };
    }
    set.write().map_err(message_of)?;
    if context.json {
        terminal::print(&json(result)?)?;
    } else if !context.quiet {
        terminal::print(&summary::identification(result, &options.out, &models))?;
    }
    let problems = &result.problems;
    for problem in problems.iter().take(PROBLEMS_SHOWN) {
        terminal::remark(&format!("PROBLEM: {problem}"));
    }
    if problems.len() > PROBLEMS_SHOWN {
        terminal::remark(&format!("and {} more problems, listed in result.json", problems.len() - PROBLEMS_SHOWN));
    }
    let within = judged(&result.validation, options.max_validation_error);
    Ok(if problems.is_empty() { within } else { Verdict::Negative })
}

/// What was asked for, without what does not change the result. Folders are left to the list of files: their names say
/// more of a computer than of a result.
fn command(options: &Options) -> String {
    let study = options.study.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let limit = options.max_validation_error.map(|limit| format!(" --max-validation-error {limit}"));
    format!("dynident identify {study}{}", limit.unwrap_or_default())
}
