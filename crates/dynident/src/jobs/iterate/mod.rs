//! `iterate`: repeated runs and identification with improving models.

mod bound;
mod files;
mod fingerprint;
mod inputs;
mod job;
mod legs;
mod model;
mod plan;
mod report;
mod stages;
mod trajectories;
mod trajectory;
mod watch;

pub use stages::RobotMaker;
pub(super) use trajectory::Trajectory;
pub use watch::{IterationWatch, MotionObserver};

use crate::error::{Error, StudyError};
use crate::jobs::options::RunOptions;
use crate::pages::iteration::{TimeSpent, iteration_report};
use crate::pages::robot::RobotAppearance;
use crate::result::IterationsFile;
use crate::study::{RobotChoice, Study, StudyFile};
use dynident_iteration::{IterationError, IterationStore};
use files::ResultFiles;
use fingerprint::fingerprint;
use inputs::{Inputs, permitted_program};
use job::Job;
use model::{RobotFiles, robot_found};
use plan::Plan;
use report::merged;
use stages::Stages;
use std::path::Path;
use std::time::Instant;
use trajectories::{Trajectories, load_or_make};

/// Iterates a study's robot and writes the results to `out`: `trajectory.json` (trajectories at the controller's
/// rate), `runs/run_k/` (each run is written completely or not at all; if trajectories are iterated one after the
/// other, `leg_n/runs/run_k/`), `iterations.json` after every run, and `report.html` at the end. With `resume`, runs
/// in the folder are not repeated. A call that continues after an interruption reaches the same result.
///
/// # Errors
/// Invalid files, study or settings, or files of another study's iteration in `out`. Failures of runs are reported in
/// the returned file.
pub fn iterate_study(
    study: &Study,
    study_path: &Path,
    out: &Path,
    resume: bool,
    options: &RunOptions<'_>,
    watch: &mut IterationWatch<'_>,
) -> Result<IterationsFile, Error> {
    iterated(Job { study: StudyFile::new(study, study_path), out, resume, options }, watch, None)
}

/// Like [`iterate_study`], with a robot of the caller: `robot` receives the joint names and returns the robot.
///
/// # Errors
/// Same as for [`iterate_study`], and legs with locked joints, which only the simulator supports.
pub fn iterate_with_robot(
    study: &Study,
    study_path: &Path,
    out: &Path,
    resume: bool,
    options: &RunOptions<'_>,
    watch: &mut IterationWatch<'_>,
    robot: RobotMaker<'_>,
) -> Result<IterationsFile, Error> {
    let mut study = study.clone();
    study.iteration.get_or_insert_default().robot = RobotChoice::Function;
    iterated(Job { study: StudyFile::new(&study, study_path), out, resume, options }, watch, Some(robot))
}

fn iterated(
    job: Job<'_>,
    watch: &mut IterationWatch<'_>,
    own_robot: Option<RobotMaker<'_>>,
) -> Result<IterationsFile, Error> {
    let Job { study, out, resume, options } = job;
    // The permission is checked before any file is read and any search starts.
    let section = study.iteration.clone().unwrap_or_default();
    let program = permitted_program(&section, study.path, watch.programs)?;
    let begin = Instant::now();
    let inputs = Inputs::read(&job, section)?;
    if inputs.section.robot == RobotChoice::Function && own_robot.is_none() {
        let fix = "robot = \"function\" needs code of the caller: call iterate_with_robot";
        return Err(job.section_error(StudyError::missing("robot", fix)));
    }
    inputs.check_section(&study).map_err(|why| job.section_error(why))?;

    let fingerprint = fingerprint(&study, &inputs.robot, options);
    let members = inputs.section.stages();
    let files = ResultFiles::of(out);
    let stores = opened_stores(&job, &files, members.len(), &fingerprint)?;
    let make = || Trajectories::of_study(&job, &inputs, watch);
    let trajectories = load_or_make(&files.trajectory(), &fingerprint, resume, make)?;
    let plan = Plan::of(&job, &inputs, &trajectories)?;
    let before_runs_s = begin.elapsed().as_secs_f64();

    let (inputs, plan, files, program) = (&inputs, &plan, &files, program.as_ref());
    let stages = Stages { job, inputs, plan, files, members: &members, stores: &stores, program };
    let results = stages.run(watch, own_robot)?;

    let missing = || job.section_error(StudyError::missing("leg", "no leg was run"));
    let mut file = merged(results.files).ok_or_else(missing)?;
    file.converged &= file.runs.last().is_some_and(|run| run.leg.is_none_or(|leg| leg == members.len()));
    let time = TimeSpent { before_runs_s, all_s: begin.elapsed().as_secs_f64(), runs: results.runs_made };
    // The runs remain valid if the robot files cannot be written.
    let (provenance, failed) = (&plan.report.provenance, |error| job.iteration_error(error));
    let found = robot_found(study, &inputs.robot, provenance, &results.ended, options, failed).unwrap_or_else(|why| {
        file.no_result = Some(why.to_string());
        RobotFiles::none()
    });
    file.base_parameters.clone_from(&found.base_parameters);
    let appearance = RobotAppearance::new(inputs.robot.model(), &inputs.robot.robot.path);
    files.write(&file, Some(iteration_report(&file, &results.traces, &appearance, &time)?), found)?;
    Ok(file)
}

/// Opens the folders of all stages; without `resume` the results of an earlier call are removed.
fn opened_stores(
    job: &Job<'_>,
    files: &ResultFiles<'_>,
    stages: usize,
    fingerprint: &str,
) -> Result<Vec<IterationStore>, Error> {
    let in_iteration = |error: IterationError| job.iteration_error(error);
    let folder =
        |stage: usize| if stages == 1 { job.out.to_owned() } else { job.out.join(format!("leg_{}", stage + 1)) };
    // Results are removed before runs, and only if all folders can be reset.
    if !job.resume {
        (0..stages).try_for_each(|stage| IterationStore::may_begin_afresh(&folder(stage))).map_err(in_iteration)?;
        files.remove()?;
    }
    // All folders are opened first, so that with --fresh no earlier run remains in any of them.
    (0..stages)
        .map(|stage| IterationStore::open(&folder(stage), fingerprint, job.resume))
        .collect::<Result<Vec<_>, _>>()
        .map_err(in_iteration)
}
