//! Run, identify, load the better model, run again: a study's whole iteration.

mod bound;
mod fingerprint;
mod legs;
mod model;
mod report;
mod trajectory;

pub(super) use trajectory::Trajectory;

use crate::error::{Error, StudyError};
use crate::inputs::{InputFiles, read_result};
use crate::jobs::design::{MotionFamily, limits_of, motion_family};
use crate::jobs::options::RunOptions;
use crate::jobs::provenance::motion_provenance;
use crate::output::write_whole;
use crate::output_set::OutputSet;
use crate::pages::iteration::{RunName, RunTrace, TimeSpent, iteration_report};
use crate::result::IterationsFile;
use crate::study::{Folders, IterationSection, PriorChoice, RobotChoice, SimulationSection, Study, StudyRobot};
use core::ops::ControlFlow;
use dynident_excitation::DesignProgress;
use dynident_excitation::limits::Limits;
use dynident_iteration::{
    Iteration, IterationError, IterationStatus, IterationStore, IterationTask, Leg, MotionPlanner, NextMotion,
    Redesign, RunRecord, StopSignal, Supervisor, iterate_supervised, other_settings,
};
use dynident_iteration::{Robot, RobotRun};
use dynident_system::ProgramPermission;
use fingerprint::fingerprint;
use model::{EndedStage, RobotFiles, robot_found};
use report::{IterationReport, Stage, joined};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// What hears of an iteration's progress.
pub struct IterationWatch<'a> {
    /// The search for the trajectory, if there is one.
    pub design: &'a (dyn Fn(&DesignProgress) -> ControlFlow<()> + Sync),
    /// Every new run.
    pub run: &'a mut dyn FnMut(&RunRecord, &[RobotRun]),
    /// Who asks for a stop: the robot is stopped, what was recorded is kept, and no further run is commanded.
    pub stop: StopSignal,
    /// Whether a motion of a robot outside may be commanded, asked before each; without it all may.
    pub allow: Option<&'a mut dyn FnMut(&NextMotion) -> bool>,
    /// Whether the program that a study names as its robot may be started. By default it may not.
    pub programs: ProgramPermission<'a>,
}

impl<'a> IterationWatch<'a> {
    /// Hears only; nobody stops it, every motion may be commanded, and no program is started.
    pub fn new(
        design: &'a (dyn Fn(&DesignProgress) -> ControlFlow<()> + Sync),
        run: &'a mut dyn FnMut(&RunRecord, &[RobotRun]),
    ) -> Self {
        Self { design, run, stop: StopSignal::default(), allow: None, programs: ProgramPermission::Refuse }
    }
}

/// Hears of a stage's runs, and asks for permission.
struct Watched<'a, 'b> {
    stop: &'a StopSignal,
    allow: &'a mut Option<&'b mut dyn FnMut(&NextMotion) -> bool>,
    made: &'a mut dyn FnMut(&RunRecord, &[RobotRun]),
}

impl Supervisor for Watched<'_, '_> {
    fn stop(&self) -> Option<&StopSignal> {
        Some(self.stop)
    }

    fn asks(&self) -> bool {
        self.allow.is_some()
    }

    fn allows(&mut self, motion: &NextMotion) -> bool {
        self.allow.as_mut().is_none_or(|allow| allow(motion))
    }

    fn made(&mut self, record: &RunRecord, runs: &[RobotRun]) {
        (self.made)(record, runs);
    }
}

/// Iterates a study's robot. What is found stands in `out`: `trajectory.json` (the trajectories at the controller's
/// rate), `runs/run_k/` (each run whole or not at all; of legs one after another `leg_n/runs/run_k/`),
/// `iterations.json` after every run and `report.html` in the end. With `resume`, runs that are there already are not
/// made again: who is killed at any moment goes on to the same result.
///
/// # Errors
/// Files, study, settings, and files of another study's iteration in `out`. How the robot and the iteration did is in
/// the file.
pub fn iterate_study(
    study: &Study,
    study_path: &Path,
    out: &Path,
    resume: bool,
    options: &RunOptions<'_>,
    watch: &mut IterationWatch<'_>,
) -> Result<IterationsFile, Error> {
    iterated(study, study_path, out, resume, options, watch, None)
}

/// Makes a robot of the joints with these names.
pub type RobotMaker<'a> = &'a mut dyn FnMut(&[String]) -> Box<dyn Robot>;

/// As [`iterate_study`] with a robot of the caller's own in place of the study's: `robot` is given the joints' names,
/// and what it makes is run as it is.
///
/// # Errors
/// As [`iterate_study`], and legs that hold joints locked, which only the simulator does.
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
    iterated(&study, study_path, out, resume, options, watch, Some(robot))
}

fn iterated(
    study: &Study,
    study_path: &Path,
    out: &Path,
    resume: bool,
    options: &RunOptions<'_>,
    watch: &mut IterationWatch<'_>,
    mut own_robot: Option<RobotMaker<'_>>,
) -> Result<IterationsFile, Error> {
    let in_section = |why: StudyError| Error::section(study_path, "iteration")(why);
    let in_iteration = |error: IterationError| match error {
        IterationError::File { path, source } => Error::Output { path, source },
        IterationError::State { path, problem } => Error::Result { path, message: problem },
        other => in_section(other.into()),
    };
    // Before anything is read or searched.
    let section = study.iteration.clone().unwrap_or_default();
    let program = match &section.robot {
        RobotChoice::Process(settings) => Some(
            settings
                .permitted(watch.programs)
                .map_err(|source| Error::NotPermitted { path: study_path.to_owned(), source })?,
        ),
        _ => None,
    };
    // The study's files and settings.
    let begin = Instant::now();
    let simulation = study.simulation.clone().unwrap_or_default();
    let files = InputFiles::of(study, study_path, options.data.as_deref());
    let folders = Folders::new(study, study_path, options.data.as_deref());
    let robot = StudyRobot::new(study, study_path, &folders)?;
    let identification = study.settings(study_path, &robot)?;
    let settings = section.settings(study, identification).map_err(Error::study(study_path))?;
    let truth = match section.robot {
        RobotChoice::Simulation => {
            Some(simulation.truth(&study.coupling, &robot).map_err(Error::section(study_path, "simulation"))?)
        }
        _ => None,
    };
    if section.robot == RobotChoice::Function && own_robot.is_none() {
        return Err(in_section(StudyError::missing("robot", "a function has to be given: call iterate_with_robot")));
    }
    section.check_legs(&robot).map_err(in_section)?;
    section.check_gains(study, &robot).map_err(in_section)?;
    // Before anything is looked for.
    section.home_settings(&robot, Limits::default()).map_err(in_section)?;
    section.check_warm_up().map_err(in_section)?;
    section.check_held_out(study).map_err(in_section)?;
    section.redesign(study).map_err(in_section)?;

    // What an earlier call has left in the folder.
    let fingerprint = fingerprint(study, &robot, options);
    let stages = section.stages();
    let one = stages.len() == 1;
    let folder = |stage: usize| if one { out.to_owned() } else { out.join(format!("leg_{}", stage + 1)) };
    // Of another command until an iteration has written a robot: it stays until this one has its own.
    let robot_is_own =
        IterationsFile::read(&out.join(ITERATIONS)).is_ok_and(|earlier| !earlier.base_parameters.is_empty());
    // What an earlier call found goes before its runs do, and nothing goes unless all may.
    if !resume {
        let mut stages = (0..stages.len()).map(&folder);
        stages.try_for_each(|folder| IterationStore::may_begin_afresh(&folder)).map_err(in_iteration)?;
        let set = OutputSet::new(out).absent(ITERATIONS).absent(TRAJECTORY);
        RobotFiles::none().added_to(without_page(set, robot_is_own), robot_is_own).write()?;
    }
    // All of them first: with --fresh no run of an earlier call may be left in any.
    let stores = (0..stages.len())
        .map(|stage| IterationStore::open(&folder(stage), &fingerprint, resume))
        .collect::<Result<Vec<_>, _>>()
        .map_err(in_iteration)?;
    let rate_hz = section.rate_hz.unwrap_or(simulation.rate_hz);
    let stop = watch.stop.clone();
    let make = || {
        let found = legs::trajectories(study, study_path, &robot, rate_hz, options, watch.design)?;
        // A search that was cut short would be this folder's trajectory for ever.
        if stop.is_requested() {
            return Err(Error::Interrupted { what: "the search for the trajectory" });
        }
        let held_out = match section.held_out_study(study) {
            Some(other) => Some(Trajectory::of_study(&other, study_path, &robot, rate_hz, options, watch.design)?),
            None => None,
        };
        if stop.is_requested() {
            return Err(Error::Interrupted { what: "the search for the held-out motion" });
        }
        Ok(Trajectories { trajectories: found, held_out })
    };
    let Trajectories { trajectories, held_out } = kept(&out.join(TRAJECTORY), &fingerprint, resume, make)?;

    // What is believed of the robot, what it runs, and what the file says of it.
    let believed = match section.prior {
        PriorChoice::Description => robot.parametric.clone(),
        PriorChoice::None => {
            let zeros = vec![0.0; robot.nominal().len()];
            robot.parametric.clone().with_nominal(zeros).map_err(|why| in_section(why.into()))?
        }
    };
    let legs = section.legs(&trajectories, &robot).map_err(in_section)?;
    let references: Vec<_> = legs.iter().map(Leg::reference).collect();
    let limits = match section.home {
        Some(_) => limits_of(study, study_path, &folders, &robot)?,
        None => Limits::default(),
    };
    let (settings, lowered) = section.guarded(settings, study, limits, &robot, &references).map_err(in_section)?;
    let torque_limits = torque_limits(&simulation, &robot, truth.is_some());
    let simulated = truth.is_some();
    let report = IterationReport {
        study,
        study_path,
        // Runs take hours: the files may change once they have been read and hashed.
        provenance: files.while_unchanged(|| motion_provenance(study, study_path, options.data.as_deref(), &[]))?,
        robot: &robot,
        duration_s: legs.iter().map(|leg| leg.reference().duration_s()).sum(),
        truth: truth.map(|truth| truth.base_values),
        bound: if one && simulated { bound::cramer_rao(&robot, &legs, &simulation.sensors) } else { None },
        sensors: &simulation.sensors,
        lowered,
    };
    let planner = planner(study, study_path, &section, &legs, options)?;
    let held_out = held_out.map(|trajectory| section.held_out_motion(&trajectory)).transpose().map_err(in_section)?;
    let before_runs_s = begin.elapsed().as_secs_f64();

    // The stages, each with what those before it have found held.
    let mut known_std: Vec<Option<f64>> = vec![None; robot.layout().columns().len()];
    let mut known: Vec<(usize, f64)> = Vec::new();
    let (mut files, mut traces, mut made, mut ended) = (Vec::new(), Vec::new(), 0, Vec::new());
    for (number, members) in stages.iter().enumerate() {
        let own: Vec<_> = members.iter().map(|&leg| legs[leg].clone()).collect();
        let task = IterationTask {
            robot: believed.clone(),
            legs: own,
            known: known.clone(),
            torque_limits: torque_limits.clone(),
        };
        let iteration = Iteration::new(task, settings.clone()).map_err(|why| in_section(why.into()))?;
        let iteration = match &planner {
            Some(planner) => iteration.with_planner(Arc::clone(planner)),
            None => iteration,
        };
        let iteration = match &held_out {
            Some(motion) => iteration.with_held_out(motion.clone()).map_err(|why| in_section(why.into()))?,
            None => iteration,
        };
        let mut robots = section
            .robots(&simulation, &study.coupling, &robot, number, members, program.as_ref())
            .map_err(in_section)?;
        robots.extend(own_robot.iter_mut().map(|make| make(&robot.parametric.joint_names())));
        let mut robots: Vec<&mut dyn Robot> = robots.iter_mut().map(|robot| &mut **robot as &mut dyn Robot).collect();
        let leg = (!one).then_some(number + 1);
        let mut so_far = stores[number].records().map_err(in_iteration)?;
        let runs_before = so_far.len();
        let mut unwritten = None;
        let run = &mut *watch.run;
        // The runs; the file is written after each.
        let mut made_one = |record: &RunRecord, runs: &[RobotRun]| {
            so_far.push(record.clone());
            let status = IterationStatus::Waiting { reason: "for the next run".to_owned() };
            unwritten = match iteration.robot(&so_far) {
                Ok(robot) => {
                    let (robot, records) = (&*robot, &so_far[..]);
                    let (status, shortfalls, declined) = (&status, &[][..], None);
                    let stage = Stage { leg, robot, records, status, shortfalls, declined, known_std: &known_std };
                    let now = report.file(&stage);
                    let all: Vec<IterationsFile> = files.iter().cloned().chain([now]).collect();
                    joined(all).and_then(|file| write_set(out, robot_is_own, &file, None, RobotFiles::none()).err())
                }
                Err(error) => Some(in_iteration(error)),
            };
            run(record, runs);
        };
        let mut watched = Watched { stop: &watch.stop, allow: &mut watch.allow, made: &mut made_one };
        let outcome = iterate_supervised(&iteration, &mut robots, Some(&stores[number]), &mut watched);
        let outcome = outcome.map_err(in_iteration)?;
        if let Some(error) = unwritten {
            return Err(error);
        }
        // What the stage has found.
        made += outcome.runs.len() - runs_before;
        let (records, status, shortfalls) = (&outcome.runs[..], &outcome.status, &outcome.shortfalls[..]);
        let in_force = &iteration.robot(records).map_err(in_iteration)?;
        let declined = outcome.declined.as_ref();
        let stage = Stage { leg, robot: in_force, records, status, shortfalls, declined, known_std: &known_std };
        files.push(report.file(&stage));
        for record in records {
            for (place, own) in iteration.legs_of(record).map_err(in_iteration)?.iter().enumerate() {
                let name = RunName { run: record.run, leg: leg.or((members.len() > 1).then_some(place + 1)), place };
                traces.push(RunTrace::new(name, &stores[number], own.reference(), &robot.parametric.joint_names()));
            }
        }
        let is_over = match status {
            IterationStatus::Refused { .. } | IterationStatus::Waiting { .. } | IterationStatus::Interrupted { .. } => {
                true
            }
            IterationStatus::Converged | IterationStatus::Settled | IterationStatus::RunsUsedUp => false,
        };
        ended.push(EndedStage { records: outcome.runs.clone(), iteration, store: &stores[number] });
        // What the next one holds.
        let last = records.iter().rev().find(|record| record.accepted).and_then(RunRecord::knowledge);
        if is_over {
            break;
        }
        let Some(last) = last else { break };
        let determined = known_std.len().min(last.values.len());
        for column in (0..determined).filter(|column| !last.fixed.contains(column)) {
            if known_std[column].is_none() {
                known_std[column] = Some(last.std[column]);
                known.push((column, last.values[column]));
            }
        }
    }

    // All stages as one.
    let mut file = joined(files).ok_or_else(|| in_section(StudyError::missing("leg", "there is none")))?;
    file.converged &= file.runs.last().is_some_and(|run| run.leg.is_none_or(|leg| leg == stages.len()));
    let time = TimeSpent { before_runs_s, all_s: begin.elapsed().as_secs_f64(), runs: made };
    // Runs are not lost because their robot cannot be written.
    let found = robot_found(study, study_path, &robot, &report.provenance, &ended, options, in_iteration)
        .unwrap_or_else(|why| {
            file.no_result = Some(why.to_string());
            RobotFiles::none()
        });
    file.base_parameters.clone_from(&found.base_parameters);
    write_set(out, robot_is_own, &file, Some(iteration_report(&file, &traces, &time)?), found)?;
    Ok(file)
}

/// Who says what the next motion is, where `[iteration]` asks for that.
fn planner(
    study: &Study,
    study_path: &Path,
    section: &IterationSection,
    legs: &[Leg],
    options: &RunOptions<'_>,
) -> Result<Option<Arc<dyn MotionPlanner>>, Error> {
    let in_section = |why: StudyError| Error::section(study_path, "iteration")(why);
    let Some(settings) = section.redesign(study).map_err(in_section)? else { return Ok(None) };
    let MotionFamily { family, limits, search } = motion_family(study, study_path, options)?;
    let planner = Redesign::new(family, limits, search, settings.clone(), &legs[0]);
    Ok(Some(Arc::new(planner.map_err(|why| in_section(why.into()))?)))
}

/// The file, its page and the robot that was found; while runs are still being made there is no page and no robot, and
/// none of an earlier call. A robot that is another command's stays until there is one.
fn write_set(
    out: &Path,
    robot_is_own: bool,
    file: &IterationsFile,
    page: Option<String>,
    found: RobotFiles,
) -> Result<(), Error> {
    let bytes = dynident_text::json::to_string_pretty(file)
        .map_err(|error| Error::Result { path: out.join(ITERATIONS), message: error.to_string() })?;
    let set = found.added_to(OutputSet::new(out).file(ITERATIONS, bytes), robot_is_own);
    match page {
        Some(page) => set.file(PAGE, page),
        None => without_page(set, robot_is_own),
    }
    .write()
}

/// The set without a page of an earlier call; `identify` writes one by the same name.
fn without_page(set: OutputSet, robot_is_own: bool) -> OutputSet {
    if robot_is_own { set.absent(PAGE) } else { set }
}

/// What each drive gives at most: of a simulated robot the stated limits, or else the description's.
fn torque_limits(simulation: &SimulationSection, robot: &StudyRobot, simulated: bool) -> Option<Vec<f64>> {
    let dof = robot.model().dof();
    if let Some(stated) = simulation.limits.torque.as_ref().filter(|_| simulated) {
        return Some((0..dof).map(|joint| stated.of(joint)).collect());
    }
    let efforts = robot.model().joints().iter().map(|joint| joint.limits.effort.unwrap_or(f64::INFINITY));
    simulation.effort_limits.then(|| efforts.collect())
}

/// The files of an iteration as a whole.
const ITERATIONS: &str = "iterations.json";
const TRAJECTORY: &str = "trajectory.json";
const PAGE: &str = "report.html";

/// What is run.
#[derive(serde::Serialize, serde::Deserialize)]
struct Trajectories {
    /// Of every leg.
    trajectories: Vec<Trajectory>,
    /// What is never fitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    held_out: Option<Trajectory>,
}

/// The trajectories of an earlier call, or new ones, which are kept before anything is run.
fn kept(
    path: &Path,
    fingerprint: &str,
    resume: bool,
    make: impl FnOnce() -> Result<Trajectories, Error>,
) -> Result<Trajectories, Error> {
    #[derive(serde::Serialize, serde::Deserialize)]
    struct TrajectoryFile {
        fingerprint: String,
        #[serde(flatten)]
        all: Trajectories,
    }
    let wrong = |message: String| Error::Result { path: path.to_owned(), message };
    if resume && path.is_file() {
        let text = read_result(path)?;
        let kept: TrajectoryFile = serde_json::from_slice(&text)
            .map_err(|error| wrong(format!("is no trajectory of an iteration ({error}): remove it")))?;
        if kept.fingerprint == fingerprint {
            return Ok(kept.all);
        }
        return Err(wrong(other_settings(&kept.fingerprint, fingerprint)));
    }
    let kept = TrajectoryFile { fingerprint: fingerprint.to_owned(), all: make()? };
    let bytes = dynident_text::json::to_string(&kept).map_err(|error| wrong(error.to_string()))?;
    write_whole(path, bytes.as_bytes())?;
    Ok(kept.all)
}
