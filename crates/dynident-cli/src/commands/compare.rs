use super::permission::XacroOptions;
use super::view::{RESULT, in_folder};
use super::{Context, json, message_of};
use crate::{Verdict, summary, terminal};
use dynident::{ResultFile, RobotAppearance, compare, comparison_page, write_atomically};
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct Options {
    /// Results of `identify` (result.json or its folder) of one type of robot; a single one is compared with its robot
    /// description.
    #[arg(required = true, value_name = "RESULT")]
    results: Vec<PathBuf>,
    /// Also write a page with the robot, coloured by what changed.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Robot description for the page, with its meshes.
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    #[command(flatten)]
    xacro: XacroOptions,
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    if let Some(out) = &options.out {
        let inputs: Vec<PathBuf> =
            options.results.iter().map(|path| in_folder(path, RESULT)).chain(options.robot.clone()).collect();
        dynident::refuse_overwriting(core::slice::from_ref(out), &inputs).map_err(message_of)?;
    }
    let read = |path: &PathBuf| -> Result<(ResultFile, PathBuf), String> {
        let file = in_folder(path, RESULT);
        Ok((ResultFile::read(&file).map_err(message_of)?, file))
    };
    let results = options.results.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    let comparison = compare(&results).map_err(message_of)?;
    if let Some(out) = &options.out {
        let robot = match &options.robot {
            Some(path) => {
                let robot = options.xacro.load_robot(path)?;
                Some(RobotAppearance::new(&robot.model, &robot.path))
            }
            None => RobotAppearance::of_result(&results[0].0, &results[0].1).map_err(message_of)?,
        };
        let page = comparison_page(&comparison, robot.as_ref()).map_err(message_of)?;
        write_atomically(out, page.as_bytes()).map_err(message_of)?;
    }
    if context.json {
        terminal::print_document(&json(&comparison)?)?;
    } else if !context.quiet {
        terminal::print(&summary::comparison(&comparison))?;
    }
    Ok(Verdict::Good)
}
