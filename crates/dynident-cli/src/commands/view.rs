use super::permission::XacroOptions;
use super::{Context, json, known_in, message_of};
use crate::{Verdict, terminal};
use dynident::model::Robot;
use dynident::{ResultFile, RunOptions, Study, view_result, view_robot, view_study, write_atomically};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Name of the result in its folder.
pub(crate) const RESULT: &str = "result.json";

#[derive(clap::Args)]
pub(crate) struct Options {
    /// A robot description, a study (its robot with its logs), or a result; then trajectories as CSV (t_s, q1.. or the
    /// joint names). With a result, a robot description adds its meshes.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// The page.
    #[arg(long, value_name = "FILE", default_value = "view.html")]
    out: PathBuf,
    /// Folder of the logs and of the robot description; replaces that of the study.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    #[command(flatten)]
    xacro: XacroOptions,
}

/// Output of `view --json`.
#[derive(Serialize)]
struct ViewFile {
    schema: &'static str,
    /// The page.
    page: PathBuf,
    bytes: usize,
}

/// The given files, sorted by their type.
#[derive(Default)]
struct Given {
    robot: Option<Robot>,
    study: Option<(Study, PathBuf)>,
    result: Option<(ResultFile, PathBuf)>,
    trajectories: Vec<PathBuf>,
}

impl Given {
    fn of(options: &Options) -> Result<Self, String> {
        let mut given = Self::default();
        for path in &options.files {
            let result = in_folder(path, RESULT);
            let twice =
                || format!("{}: give one robot, study or result; other files are trajectories (.csv)", path.display());
            match result.extension().and_then(|extension| extension.to_str()) {
                Some("csv") => given.trajectories.push(path.clone()),
                Some("json") if given.result.is_none() => {
                    given.result = Some((ResultFile::read(&result).map_err(message_of)?, result));
                }
                Some("toml") if given.study.is_none() => {
                    match options.xacro.programs.load_study(path, options.data.as_deref()) {
                        Ok(study) => given.study = Some((study, path.clone())),
                        // A TOML file may also be a D-H table.
                        Err(message) if given.robot.is_none() => {
                            given.robot = Some(options.xacro.load_robot(path).map_err(|_| message)?);
                        }
                        Err(_) => return Err(twice()),
                    }
                }
                _ if given.robot.is_none() => given.robot = Some(options.xacro.load_robot(path)?),
                _ => return Err(twice()),
            }
        }
        Ok(given)
    }

    fn page(&self, options: &Options, context: &Context) -> Result<String, String> {
        let none = |what: &str| {
            if self.trajectories.is_empty() { Ok(()) } else { Err(format!("trajectories cannot be shown {what}")) }
        };
        match (&self.study, &self.result, &self.robot) {
            (Some(_), Some(_), _) | (Some(_), _, Some(_)) => {
                Err("give a study, or a result with its robot description, or a robot description".to_owned())
            }
            (Some((study, path)), None, None) => {
                let progress = context.progress();
                let run = RunOptions { data: options.data.clone(), threads: context.threads, progress: &*progress };
                view_study(study, path, &self.trajectories, &run).map_err(known_in(path))
            }
            (None, Some((result, path)), robot) => {
                none("with a result: give the robot description instead of the result")?;
                view_result(result, path, robot.as_ref()).map_err(message_of)
            }
            (None, None, Some(robot)) => view_robot(robot, &self.trajectories).map_err(message_of),
            (None, None, None) => {
                none("without a robot: give its description or a study first").map(|()| String::new())
            }
        }
    }
}

/// Path of the file `name` if `path` is a folder; otherwise `path` itself.
pub(crate) fn in_folder(path: &Path, name: &str) -> PathBuf {
    if path.is_dir() { path.join(name) } else { path.to_owned() }
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    dynident::refuse_overwriting(core::slice::from_ref(&options.out), &options.files).map_err(message_of)?;
    let page = Given::of(options)?.page(options, context)?;
    write_atomically(&options.out, page.as_bytes()).map_err(message_of)?;
    if context.json {
        let file = ViewFile { schema: "dynident/view/1", page: options.out.clone(), bytes: page.len() };
        terminal::print_document(&json(&file)?)?;
    } else if !context.quiet {
        terminal::print(&format!("wrote {}\n", options.out.display()))?;
    }
    Ok(Verdict::Good)
}
