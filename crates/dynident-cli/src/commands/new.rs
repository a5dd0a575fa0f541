//! `dynident new --robot ROBOT --log FILE..`.

use super::permission::{XacroOptions, agreed, text_asked};
use super::{Context, json, message_of};
use crate::{Verdict, terminal};
use dynident::result::{StudyChange, Unsure};
use dynident::{NewStudy, RunOptions, new_study};
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The robot: URDF, MJCF, SDF, or D-H table in TOML.
    #[arg(long, value_name = "FILE")]
    robot: PathBuf,
    /// The recordings, in any supported format; the last of several is held out.
    #[arg(long = "log", required = true, num_args = 1.., value_name = "FILE")]
    logs: Vec<PathBuf>,
    /// The study to write.
    #[arg(long, value_name = "STUDY.toml", default_value = "study.toml")]
    out: PathBuf,
    /// Sample rate for recordings without time stamps, Hz.
    #[arg(long, value_name = "HZ")]
    rate_hz: Option<f64>,
    /// Overwrite an existing study.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    xacro: XacroOptions,
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    if options.out.exists() && !options.force {
        return Err(format!(
            "{} already exists and may contain your changes: use another --out, or --force",
            options.out.display()
        ));
    }
    let mut inputs = options.logs.clone();
    inputs.push(options.robot.clone());
    dynident::refuse_overwriting(core::slice::from_ref(&options.out), &inputs).map_err(message_of)?;
    if options.rate_hz.is_some_and(|rate_hz| !(rate_hz > 0.0 && rate_hz.is_finite())) {
        return Err("--rate-hz: give a positive sample rate, Hz".to_owned());
    }

    let description = options.xacro.load_robot(&options.robot)?;
    let progress = context.progress();
    let run = RunOptions { data: None, threads: context.threads, progress: &*progress };
    let mut request = NewStudy {
        robot: options.robot.clone(),
        description: Some(Box::new(description)),
        xacro: options.xacro.settings(),
        logs: options.logs.clone(),
        out: options.out.clone(),
        rate_hz: options.rate_hz,
        stated: Vec::new(),
    };
    let mut found = new_study(&request, &run).map_err(message_of)?;
    request.stated = found.unsure.iter().flat_map(stated).collect();
    if !request.stated.is_empty() {
        found = new_study(&request, &run).map_err(message_of)?;
    }
    dynident::write_atomically(&options.out, found.text.as_bytes()).map_err(message_of)?;

    if context.json {
        terminal::print_document(&json(&found)?)?;
    } else if !context.quiet {
        terminal::print_document(found.text.trim_end())?;
    }
    for unsure in &found.unsure {
        terminal::remark(&format!("check {}", unsure.sentence()));
    }
    if !context.json && !context.quiet {
        let path = options.out.display();
        terminal::remark(&format!(
            "written: {path}; next: dynident check {path}, dynident identify {path} --out result"
        ));
    }
    Ok(if found.unsure.is_empty() { Verdict::Good } else { Verdict::Negative })
}

/// Asks the user on the terminal about an uncertain line of the study. The changes are a line typed by the user, or
/// the proposal of the examination; empty without an answer.
fn stated(unsure: &Unsure) -> Vec<StudyChange> {
    if !unsure.proposed.is_empty() {
        let is_agreed = agreed(&format!("{}\nWrite it?", unsure.reason)).unwrap_or(false);
        return if is_agreed { unsure.proposed.clone() } else { Vec::new() };
    }
    let shown = |change: &StudyChange| line_stated(change, &unsure.reason);
    unsure.line.as_ref().and_then(shown).into_iter().collect()
}

/// Asks for a replacement of the line `change` until it is valid TOML.
fn line_stated(change: &StudyChange, reason: &str) -> Option<StudyChange> {
    let (key, value) = change.line.split_once(" = ")?;
    let mut question = format!("{}: {reason}\n  {key} [{value}]:", change.place());
    loop {
        let answer = StudyChange { line: format!("{key} = {}", text_asked(&question)?), ..change.clone() };
        if answer.is_well_formed() {
            return Some(answer);
        }
        question = format!("  invalid TOML value (valid is for example {value}); {key}:");
    }
}
