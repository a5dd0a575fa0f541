//! Logs to factors, and factors to a model: identification of many logs that need not lie in one place.

use crate::clock::now;
use crate::error::{Error, FactorsError};
use crate::factors::{FactorLog, Factors, name_alone};
use crate::inputs::InputFiles;
use crate::jobs::identify::{IdentificationOutcome, Made, written};
use crate::jobs::options::RunOptions;
use crate::jobs::provenance::factors_provenance;
use crate::result::{ResultFile, Timings};
use crate::study::{Folders, Study, StudyRobot};
use dynident_identification::{
    IdentificationError, IdentificationTask, Recording, ReducedLog, identify_reduced, reduce as reduce_task,
    reduced_errors,
};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

/// How logs are reduced.
#[derive(Clone, Debug, PartialEq)]
pub struct ReduceSettings {
    /// The robot that they were recorded on, where there are several of one kind.
    pub arm: Option<String>,
    /// When they were recorded, seconds since 1970 began (UTC).
    pub recorded_at_s: Option<f64>,
    /// Segments kept of each log: error bars of few logs need many, of many logs one. Default 16.
    pub segments: usize,
}

impl Default for ReduceSettings {
    fn default() -> Self {
        Self { arm: None, recorded_at_s: None, segments: 16 }
    }
}

/// Reduces the training logs of a study to factors, with the cut-off, the friction and the lag of `like` where a model
/// says what the study leaves open: all logs of a fleet must be read alike.
///
/// # Errors
/// Everything that [`Error`] names; [`IdentificationError::Reduce`] in it where cut-off or friction are left to the
/// logs.
pub fn reduce(
    study: &Study,
    study_path: &Path,
    like: Option<&ResultFile>,
    settings: &ReduceSettings,
    options: &RunOptions<'_>,
) -> Result<Factors, Error> {
    study.require_training_log(study_path)?;
    let files = InputFiles::of(study, study_path, options.data.as_deref());
    let folders = Folders::new(study, study_path, options.data.as_deref());
    let factors = |source| Error::Factors { path: study_path.to_owned(), source };
    if let Some(file) = study.torque.iter().find_map(|torque| torque.table_file.as_ref()) {
        return Err(factors(FactorsError::Table { file: file.display().to_string() }));
    }
    // A design makes no factors.
    let undesigned = Study { design: None, ..study.clone() };
    if let Some(part) = undesigned.functions().into_iter().next() {
        return Err(factors(FactorsError::Function { part }));
    }
    let mut study = like.map_or_else(|| study.clone(), |model| model.as_fitted(study));
    if let Some(cutoff_hz) = like.and_then(ResultFile::cutoff_hz) {
        study.motion.differentiator = study.motion.differentiator.with_cutoff(cutoff_hz);
    }
    let robot = StudyRobot::new(&study, study_path, &folders)?;
    let in_study = Error::identification::<IdentificationError>(study_path);
    let task = study.task_with(study.settings(study_path, &robot)?, &robot, &folders)?;
    let reduced =
        files.while_unchanged(|| reduce_task(&task, settings.segments, options.execution()).map_err(&in_study))?;
    let log = |log| FactorLog::new(settings.arm.clone(), settings.recorded_at_s, log);
    let kind = without_logs(&study, &robot);
    Ok(Factors::new(kind, name_alone(study_path), reduced.into_iter().map(log).collect()))
}

/// What makes a model of factors, and nothing of where they were made.
fn without_logs(study: &Study, robot: &StudyRobot) -> Study {
    let mut kind = study.clone();
    (kind.log, kind.format, kind.data, kind.source) = (Vec::new(), None, None, None);
    (kind.arm, kind.payload) = (None, Vec::new());
    (kind.design, kind.controller, kind.simulation, kind.iteration) = (None, None, None, None);
    let mut description = robot.robot.clone();
    description.path = name_alone(&description.path);
    kind.robot.file.clone_from(&description.path);
    kind.robot.description = Some(Box::new(description));
    kind
}

/// The model that explains all logs of `factors`, as [`identify()`](crate::identify()) makes it of the logs themselves
/// when cut-off, friction and lag are stated; without what only samples show (delays, torque over time, other readings
/// of a doubtful log, held-out logs).
///
/// # Errors
/// As [`identify()`](crate::identify()).
pub fn identify_factors(factors: &Factors, options: &RunOptions<'_>) -> Result<IdentificationOutcome, Error> {
    let start = Instant::now();
    let (study, path) = (&factors.study, &factors.study_path);
    let robot = StudyRobot::new(study, path, &Folders::new(study, path, None))?;
    let settings = study.settings(path, &robot)?;
    let logs = with_own_names(factors);
    let named: Vec<&ReducedLog> = logs.iter().collect();
    let mut timings = Timings { robot: start.elapsed().as_secs_f64(), ..Timings::default() };
    let found = identify_reduced(&robot.parametric, &settings, &named, options.execution())
        .map_err(Error::identification::<IdentificationError>(path))?;
    timings.estimation = found.times.estimation_s;
    timings.total = start.elapsed().as_secs_f64();
    timings.made_at = now();
    let recordings = logs.iter().map(|log| Recording::without_samples(log.name.clone())).collect();
    let mut task = IdentificationTask::new(robot.parametric.clone(), recordings);
    task.settings = settings;
    let made = Made { timings, provenance: factors_provenance(factors), is_payload: false };
    written(study, path, &robot, &task, found, made)
}

/// The part of the torque of every log of `factors` that a model leaves unexplained, percent of its root mean square:
/// base parameters as they were written. None for a log without torque.
///
/// # Errors
/// [`Error::Result`] for a model of another robot.
pub fn factors_errors(factors: &Factors, model: &ResultFile, path: &Path) -> Result<Vec<Option<f64>>, Error> {
    let (study, own) = (&factors.study, &factors.study_path);
    let robot = StudyRobot::new(study, own, &Folders::new(study, own, None))?;
    let theta = model.base_values(path, &robot.parametric)?;
    let logs: Vec<&ReducedLog> = factors.logs().iter().map(|log| &log.log).collect();
    let in_study = Error::identification::<IdentificationError>(own);
    reduced_errors(&robot.parametric, &theta, &logs).map_err(|error| in_study(error.into()))
}

/// The logs, each with a name that no other has: of those that share one, with digits of their hash behind it.
fn with_own_names(factors: &Factors) -> Vec<ReducedLog> {
    const DIGITS: usize = 8;
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    for log in factors.logs() {
        *seen.entry(&log.log.name).or_default() += 1;
    }
    let named = |log: &FactorLog| {
        let mut own = log.log.clone();
        if seen.get(&log.log.name[..]).is_some_and(|times| *times > 1) {
            own.name = format!("{} ({})", own.name, &log.sha256[..DIGITS]);
        }
        own
    };
    factors.logs().iter().map(named).collect()
}
