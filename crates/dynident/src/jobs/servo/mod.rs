//! `identify` for logs of commands and positions.

mod design;
mod files;
mod forms;
mod result;

pub use design::{ServoDesignOutcome, design_servos};
pub(in crate::jobs) use files::model_files;

use crate::error::Error;
use crate::inputs::InputFiles;
use crate::jobs::options::RunOptions;
use crate::jobs::provenance::{concurrently, provenance};
use crate::pages::robot::RobotAppearance;
use crate::result::{ServoFile, ServoMotion};
use crate::study::{
    Folders, ServoSection, Study, StudyError, StudyFile, StudyInput, StudyLogSource, StudyRobot, moving_link,
};
use dynident_identification::Role;
use dynident_model::Model;
use dynident_recording::CommandedMotion;
use dynident_servo::{Drive, Run, Search, ServoRobot, robot_at, search, simulate, start_drives, unknowns};
use files::ServoModelFiles;
use std::path::Path;
use std::time::Instant;

/// Identified drives and bodies of a study with commands.
#[derive(Debug)]
pub struct ServoOutcome {
    /// Content of `result.json`.
    pub result: ServoFile,
    /// The motions of all logs; held-out logs come first.
    pub motions: Vec<ServoMotion>,
    /// The user's MJCF with the new values and position actuators; if missing, the notes have the reason.
    pub mjcf: Option<String>,
    /// The user's URDF with the new values; if missing, the notes have the reason.
    pub urdf: Option<String>,
    /// The robot, for its picture.
    pub robot: RobotAppearance,
    /// The bodies.
    pub model: Model,
}

impl ServoOutcome {
    /// The report as one self-contained HTML page.
    ///
    /// # Errors
    /// [`Error::Report`], which indicates a bug.
    pub fn report(&self) -> Result<String, Error> {
        crate::pages::servo::servo_page(&self.result, &self.motions, &self.robot, &self.model)
    }
}

/// A log of the study with its role.
pub(super) struct RoleRun {
    pub(super) role: Role,
    pub(super) run: Run,
}

/// Input of a fit.
struct Fit {
    robot: StudyRobot,
    section: ServoSection,
    runs: Vec<RoleRun>,
}

/// Fits the drives and bodies of a study to its training logs, and simulates the held-out logs.
///
/// # Errors
/// Files, study and logs that cannot be read; logs without commands.
pub fn identify_servos(study: &Study, study_path: &Path, options: &RunOptions<'_>) -> Result<ServoOutcome, Error> {
    let study = StudyFile::new(study, study_path);
    let files = InputFiles::of(study, options.data.as_deref());
    files.while_unchanged(|| from_files(study, options))
}

fn from_files(study: StudyFile<'_>, options: &RunOptions<'_>) -> Result<ServoOutcome, Error> {
    let start = Instant::now();
    study.require_training_log(study.path)?;
    let folders = study.folders(options.data.as_deref());
    let robot = study.robot_in(&folders)?;
    let sources = study.log_sources(&folders)?;
    let mut read = vec![("robot", study.robot_input(&robot))];
    read.extend(sources.iter().cloned().map(|source| ("log", StudyInput::from(source))));
    let section = study.drive.servo.clone().unwrap_or_default();
    let payloads = payloads(study, &robot)?;
    let mut runs = Vec::new();
    for (index, source) in sources.iter().enumerate() {
        let log = source.log(study.format_of(index), &robot.log_joints);
        let motion = log.commanded_motion().map_err(|source| Error::recording(&study.log_name(index), source))?;
        let payload = study.log[index].payload.as_deref();
        let run = run_of(study, index, &motion, robot.model(), &section);
        let payloads = payloads.iter().filter(|(name, ..)| Some(&**name) == payload);
        let payloads = payloads.map(|(_, body, inertial)| (*body, *inertial)).collect();
        runs.push(RoleRun { role: study.log[index].role, run: Run { payloads, ..run } });
    }
    let fit = Fit { robot, section, runs };
    let hashes = || provenance(study, &read);
    let (provenance, found) = concurrently(options.threads, hashes, || fitted(study, &fit, options));
    let (found, provenance) = (found?, provenance?);
    let mut outcome = outcome(study, &fit, &found, provenance, options)?;
    outcome.result.seconds = start.elapsed().as_secs_f64();
    Ok(outcome)
}

/// The training logs, without payloads.
fn training_runs(
    study: StudyFile<'_>,
    folders: &Folders,
    robot: &StudyRobot,
    section: &ServoSection,
) -> Result<Vec<Run>, Error> {
    let sources = study.log_sources(folders)?;
    let training = sources.iter().enumerate().filter(|(index, _)| study.log[*index].role != Role::Validate);
    let read = |(index, source): (usize, &StudyLogSource)| {
        let log = source.log(study.format_of(index), &robot.log_joints);
        let motion = log.commanded_motion().map_err(|source| Error::recording(&study.log_name(index), source))?;
        Ok(run_of(study, index, &motion, robot.model(), section))
    };
    training.map(read).collect()
}

/// The log with the joints in the robot's order, and commands limited to what the servos accept.
fn run_of(study: StudyFile<'_>, index: usize, motion: &CommandedMotion, model: &Model, section: &ServoSection) -> Run {
    let place = |name: &str| motion.joints.iter().position(|joint| joint == name);
    let places: Vec<usize> = model.joints().iter().filter_map(|joint| place(&joint.name)).collect();
    let column = |values: &[f64], joint: usize| motion.joint(values, joint).collect::<Vec<f64>>();
    let mut commands: Vec<Vec<f64>> = places.iter().map(|&at| column(&motion.commands, at)).collect();
    for (joint, commands) in commands.iter_mut().enumerate() {
        section.limit(joint, commands);
    }
    Run {
        name: study.log_name(index),
        times_s: motion.times_s.clone(),
        positions: places.iter().map(|&at| column(&motion.positions, at)).collect(),
        commands,
        payloads: Vec::new(),
        gains: study.log[index].servo_gains(model.dof()),
    }
}

/// The payloads of the study with known inertia: name, body, inertial parameters in the body's frame.
fn payloads(
    study: StudyFile<'_>,
    robot: &StudyRobot,
) -> Result<Vec<(String, usize, dynident_model::InertialParameters)>, Error> {
    let mut all = Vec::new();
    for section in &study.payload {
        let place = format!("payload `{}`", section.name);
        let Some((body, placement)) = moving_link(robot.model(), &section.link) else {
            let links = robot.model().bodies().iter().flat_map(|body| &body.links);
            let known = links.map(|link| link.name.clone()).collect();
            let name = section.link.clone();
            let error = StudyError::Unknown { key: "payload", what: "moving link", name, known };
            return Err(Error::section(study.path, &place)(error));
        };
        let Some(known) = section.known() else {
            let error = StudyError::conflict(
                "an unknown payload",
                "state mass_kg and com_m: from commands and positions only known payloads are used",
            );
            return Err(Error::section(study.path, &place)(error));
        };
        all.push((section.name.clone(), body, known.expressed_in(&placement)));
    }
    Ok(all)
}

/// A finished search, with the robot that it identified.
pub(super) struct Found {
    pub(super) nominal: ServoRobot,
    pub(super) parameters: Vec<dynident_servo::FreeParameter>,
    pub(super) search: Search,
    pub(super) robot: ServoRobot,
    /// Simulated positions of each log.
    pub(super) simulated: Vec<Option<Vec<Vec<f64>>>>,
}

fn fitted(study: StudyFile<'_>, fit: &Fit, options: &RunOptions<'_>) -> Result<Found, Error> {
    let in_study = |error: StudyError| Error::section(study.path, "drive.servo")(error);
    let in_fit = |error: dynident_servo::ServoError| Error::section(study.path, "drive.servo")(error);
    let settings = &fit.section.fit;
    let model = fit.robot.model();
    let training: Vec<Run> =
        fit.runs.iter().filter(|run| run.role != Role::Validate).map(|run| run.run.clone()).collect();
    for run in &fit.runs {
        run.run.validate(model.dof()).map_err(in_fit)?;
    }
    let work = || {
        options.progress.begin("search for drives and bodies", None);
        let nominal = ServoRobot {
            model: model.clone(),
            drives: first_drives(model, &training, &fit.section).map_err(in_study)?,
            floor: fit.section.floor(model).map_err(in_study)?,
        };
        let parameters = unknowns(&nominal, settings);
        let start = vec![0.0; parameters.len()];
        let search = search(&nominal, &parameters, &start, &training, settings).map_err(in_fit)?;
        let robot = robot_at(&nominal, &parameters, &search.coordinates).map_err(|error| in_fit(error.into()))?;
        let simulated = fit
            .runs
            .iter()
            .map(|run| simulate(&robot, &run.run, settings.step_s))
            .collect::<Result<_, _>>()
            .map_err(in_fit)?;
        options.progress.end();
        Ok(Found { nominal, parameters, search, robot, simulated })
    };
    on_threads(options.threads, work)
}

/// The drives with which a search begins: values in the study, torque limits of the robot description, and other
/// values from the responses of the joints.
fn first_drives(model: &Model, runs: &[Run], section: &ServoSection) -> Result<Vec<Drive>, StudyError> {
    let stated = section.drives(vec![Drive::typical(1.0, 1.0, 1.0, 1.0); model.dof()])?;
    let mut start = start_drives(model, runs, &stated, section.fit.alike);
    for (drive, joint) in start.iter_mut().zip(model.joints()) {
        if !section.fit.load_friction {
            (drive.load_friction, drive.stribeck) = (0.0, 0.0);
        }
        drive.torque_limit = joint.limits.effort.filter(|effort| *effort > 0.0).unwrap_or(f64::INFINITY);
    }
    section.drives(start)
}

/// Runs `work` with a pool of threads; if no pool can be created, on the current thread.
fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
        Ok(pool) => pool.install(work),
        Err(_) => work(),
    }
}

fn outcome(
    study: StudyFile<'_>,
    fit: &Fit,
    found: &Found,
    provenance: crate::result::Provenance,
    options: &RunOptions<'_>,
) -> Result<ServoOutcome, Error> {
    let mut result = result::servo_file(study, fit.robot.model(), &fit.runs, found, &fit.section)?;
    result.provenance = Some(provenance);
    let steps_s = [fit.section.fit.step_s, fit.section.fit.physics_step_s];
    result.forms = on_threads(options.threads, || forms::forms(&result, &fit.runs, found, steps_s))
        .map_err(|error| Error::section(study.path, "drive.servo")(error))?;
    let motions = result::motions(&fit.runs, found);
    if !result.validation.is_empty() {
        result.motion = motions.first().cloned();
    }
    let ServoModelFiles { mjcf, urdf, missing } = model_files(&fit.robot, &found.robot.model, &result);
    result.notes.extend(missing);
    let robot = RobotAppearance::new(fit.robot.model(), &fit.robot.robot.path);
    Ok(ServoOutcome { result, motions, mjcf, urdf, robot, model: found.robot.model.clone() })
}
