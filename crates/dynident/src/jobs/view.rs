//! `view`: a robot with its motions as one page.

use crate::error::Error;
use crate::jobs::design::{log_pieces, trajectory_table};
use crate::jobs::options::RunOptions;
use crate::pages::robot::RobotAppearance;
use crate::pages::view::{ViewedMotion, view_page};
use crate::result::ResultFile;
use crate::study::{Study, StudyFile};
use dynident_excitation::families::SampledMotion;
use dynident_model::{Model, Robot};
use dynident_recording::MotionSettings;
use std::path::{Path, PathBuf};

/// A page with the robot and the motions of `trajectories` (tables with `t_s` and `q1..` or the joint names).
///
/// # Errors
/// A table that is missing, or has other joints.
pub fn view_robot(robot: &Robot, trajectories: &[PathBuf]) -> Result<String, Error> {
    let motions = tables(trajectories, &robot.model, &MotionSettings::default())?;
    view_page(robot.model.name(), &robot.model, &RobotAppearance::new(&robot.model, &robot.path), &motions)
}

/// A page with the robot of a study, the motions of its logs and those of `trajectories`. The positions of a log are
/// those that a fit uses, after the import and the differentiator.
///
/// # Errors
/// A study, a log or a table that cannot be read.
pub fn view_study(
    study: &Study,
    study_path: &Path,
    trajectories: &[PathBuf],
    options: &RunOptions<'_>,
) -> Result<String, Error> {
    let study = StudyFile::new(study, study_path);
    let folders = study.folders(options.data.as_deref());
    let robot = study.robot_in(&folders)?;
    let mut motions = tables(trajectories, robot.model(), &study.motion)?;
    for index in 0..study.log.len() {
        let source = study.log_source(&folders, index)?;
        let (pieces, _) = log_pieces(study, &robot, &folders, index, &source)?;
        motions.push(ViewedMotion { name: study.log_name(index), pieces });
    }
    let appearance = RobotAppearance::new(robot.model(), &robot.robot.path);
    view_page(&study.title(), robot.model(), &appearance, &motions)
}

/// The HTML report of a stored result, without the samples of its logs. `path` is that of the result, for messages.
/// Without a robot description, the bodies are capsules between the joints.
///
/// # Errors
/// A model that cannot be read, if there is no robot description; [`Error::Report`], which indicates a bug.
pub fn view_result(result: &ResultFile, path: &Path, robot: Option<&Robot>) -> Result<String, Error> {
    let appearance = match robot {
        Some(robot) => Some(RobotAppearance::new(&robot.model, &robot.path)),
        None => RobotAppearance::of_result(result, path)?,
    };
    crate::pages::identification::identification_report(result, &[], appearance.as_ref())
}

fn tables(paths: &[PathBuf], model: &Model, settings: &MotionSettings) -> Result<Vec<ViewedMotion>, Error> {
    let joints: Vec<String> = model.joints().iter().map(|joint| joint.name.clone()).collect();
    let read = |path: &PathBuf| -> Result<ViewedMotion, Error> {
        let given: SampledMotion = trajectory_table(path, &joints, settings)?.given;
        Ok(ViewedMotion { name: path.display().to_string(), pieces: vec![given] })
    };
    paths.iter().map(read).collect()
}
