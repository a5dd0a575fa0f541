//! One file per subcommand.

mod answer;
pub(crate) mod benchmark;
pub(crate) mod check;
pub(crate) mod compare;
pub(crate) mod completions;
pub(crate) mod design;
mod design_commands;
pub(crate) mod docs;
pub(crate) mod evaluate;
pub(crate) mod export;
mod factors;
pub(crate) mod identify;
pub(crate) mod init;
pub(crate) mod inspect;
pub(crate) mod interruption;
pub(crate) mod iterate;
pub(crate) mod log;
pub(crate) mod manual;
pub(crate) mod merge;
pub(crate) mod new;
mod permission;
pub(crate) mod plot;
pub(crate) mod reduce;
pub(crate) mod reproduce;
pub(crate) mod schema;
mod search;
pub(crate) mod simulate;
pub(crate) mod validate;
pub(crate) mod version;
pub(crate) mod view;

use crate::progress::{Bar, Lines};
use crate::{Verdict, terminal};
use dynident::identification::examination::LogValidation;
use dynident::{Progress, Silent, Study, study_inputs};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Largest number of problems on standard error.
const MAX_PROBLEMS_SHOWN: usize = 8;

pub(crate) struct Context {
    pub(crate) json: bool,
    pub(crate) quiet: bool,
    pub(crate) threads: usize,
}

impl Context {
    pub(crate) fn progress(&self) -> Box<dyn Progress> {
        match (self.quiet, terminal::watched()) {
            (true, _) => Box::new(Silent),
            (false, true) => Box::new(Bar::default()),
            (false, false) => Box::new(Lines::new(terminal::progress)),
        }
    }
}

pub(crate) fn with_threads<R: Send>(threads: usize, job: impl FnOnce() -> R + Send) -> R {
    match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
        Ok(pool) => pool.install(job),
        // Without additional threads the job runs on this thread.
        Err(_) => job(),
    }
}

pub(crate) fn json<T: Serialize>(value: &T) -> Result<String, String> {
    dynident_text::json::to_string(value).map_err(|error| format!("the result cannot be written as JSON: {error}"))
}

pub(crate) fn pretty_json<T: Serialize>(value: &T) -> Result<Vec<u8>, String> {
    let text = dynident_text::json::to_string_pretty(value);
    let text = text.map_err(|error| format!("the result cannot be written as JSON: {error}"))?;
    Ok((text + "\n").into_bytes())
}

#[allow(clippy::needless_pass_by_value, reason = "required by map_err")]
pub(crate) fn message_of(error: impl Into<dynident::Error>) -> String {
    let error = error.into();
    explained(error.to_string(), &error)
}

/// Message of an error, with a second line that names the command that explains the error's code.
fn explained(message: String, error: &dynident::Error) -> String {
    match error.code() {
        Some(code) => format!("{message}\nhelp: dynident docs {code}"),
        None => message,
    }
}

/// Path of a result.json; `path` is the file or its folder.
pub(crate) fn result_file(path: &Path) -> PathBuf {
    if path.is_dir() { path.join("result.json") } else { path.to_owned() }
}

/// Parses a limit of the relative error in percent.
pub(crate) fn percentage(text: &str) -> Result<f64, String> {
    let value =
        text.trim_end_matches('%').parse::<f64>().map_err(|error| format!("{error}: give a number of percent"))?;
    if value.is_finite() && value >= 0.0 { Ok(value) } else { Err("give 0 or more percent".to_owned()) }
}

/// Prints the first problems of a result on standard error, and the number of further ones; `listed` says where all
/// of them are.
pub(crate) fn show_problems(problems: &[String], listed: &str) {
    for problem in problems.iter().take(MAX_PROBLEMS_SHOWN) {
        terminal::remark(&format!("PROBLEM: {problem}"));
    }
    if problems.len() > MAX_PROBLEMS_SHOWN {
        terminal::remark(&format!("and {} more problems{listed}", problems.len() - MAX_PROBLEMS_SHOWN));
    }
}

/// Whether the error on every log is at most the limit, if there is one. It is the error of the written model, which
/// is the physically consistent one if available.
pub(crate) fn judged(logs: &[LogValidation], limit: Option<f64>) -> Verdict {
    let Some(limit) = limit else { return Verdict::Good };
    if logs.is_empty() {
        terminal::remark("no log was held out, so the error cannot be tested");
        return Verdict::Negative;
    }
    let mut verdict = Verdict::Good;
    for log in logs {
        let written = log.physical.as_ref();
        let whose = if written.is_some() { "written model" } else { "estimate" };
        match written.unwrap_or(&log.model).relative_error_percent {
            Some(error) if error <= limit => continue,
            Some(error) => terminal::remark(&format!(
                "{}: the {whose}'s error of {error:.2} % is above the limit of {limit} %",
                log.log
            )),
            None => {
                terminal::remark(&format!(
                    "{}: the torque is always zero, so the relative error is undefined",
                    log.log
                ));
            }
        }
        verdict = Verdict::Negative;
    }
    verdict
}

/// Checks that none of the files (or folders) `names` in the folder `out` is an input of the study in `sections`, or
/// one of `further`.
pub(crate) fn refuse_overwriting(
    out: &Path,
    names: &[&str],
    study: &Study,
    path: &Path,
    data: Option<&Path>,
    sections: &[&str],
    further: &[PathBuf],
) -> Result<(), String> {
    let outputs: Vec<PathBuf> = names.iter().map(|name| out.join(name)).collect();
    let inputs = [study_inputs(study, path, data, sections), further.to_vec()].concat();
    dynident::refuse_overwriting(&outputs, &inputs).map_err(message_of)
}

/// Returns the message of an error in a study. If the error is in another file, the message also contains the name of
/// the study.
pub(crate) fn known_in<E: Into<dynident::Error>>(study: &Path) -> impl Fn(E) -> String {
    use dynident::StudyFileError::{Missing, Recording, Robot, Xacro};
    move |error| {
        let error = error.into();
        let is_elsewhere =
            matches!(error, dynident::Error::Study(Recording { .. } | Missing { .. } | Robot(_) | Xacro { .. }));
        let message = if is_elsewhere { format!("{}: {error}", study.display()) } else { error.to_string() };
        explained(message, &error)
    }
}
