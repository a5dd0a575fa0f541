//! `reduce`: converts logs to triangular factors, and identifies a model from factors, for logs in several places.

use crate::clock::now;
use crate::error::{Error, FactorsError};
use crate::factors::{FactorLog, Factors, name_alone};
use crate::inputs::InputFiles;
use crate::jobs::identify::{FitMetadata, IdentificationOutcome, build_outcome};
use crate::jobs::options::RunOptions;
use crate::jobs::provenance::factors_provenance;
use crate::result::{ResultFile, Timings};
use crate::study::{Study, StudyFile, StudyRobot};
use dynident_identification::{
    IdentificationError, IdentificationTask, Recording, ReducedLog, identify_reduced, reduce as reduce_task,
    reduced_errors,
};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

/// Settings of the reduction of logs.
#[derive(Clone, Debug, PartialEq)]
pub struct ReduceSettings {
    /// Identifier of the individual robot, for several robots of the same type.
    pub arm: Option<String>,
    /// Time of recording, seconds since 1970-01-01 (UTC).
    pub recorded_at_s: Option<f64>,
    /// Number of time segments per log. If there are few logs, error bars need many segments; if there are many logs,
    /// one is sufficient. Default 16.
    pub segments: usize,
}

impl Default for ReduceSettings {
    fn default() -> Self {
        Self { arm: None, recorded_at_s: None, segments: 16 }
    }
}

/// Reduces the training logs of a study to triangular factors. If the study does not define cut-off frequency,
/// friction or lag, those of `like` are used, because all logs of a fleet must be processed identically.
///
/// # Errors
/// Every variant of [`Error`]; [`IdentificationError::Reduce`] if cut-off or friction are not stated.
pub fn reduce(
    study: &Study,
    study_path: &Path,
    like: Option<&ResultFile>,
    settings: &ReduceSettings,
    options: &RunOptions<'_>,
) -> Result<Factors, Error> {
    let study = StudyFile::new(study, study_path);
    study.require_training_log(study.path)?;
    let files = InputFiles::of(study, options.data.as_deref());
    let folders = study.folders(options.data.as_deref());
    let factors = |source| Error::Factors { path: study.path.to_owned(), source };
    if let Some(file) = study.torque.iter().find_map(|torque| torque.table_file.as_ref()) {
        return Err(factors(FactorsError::Table { file: file.display().to_string() }));
    }
    // The section `[design]` is not used here.
    let undesigned = Study { design: None, ..study.study.clone() };
    if let Some(part) = undesigned.functions().into_iter().next() {
        return Err(factors(FactorsError::Function { part }));
    }
    let mut fitted = like.map_or_else(|| study.study.clone(), |model| model.as_fitted(&study));
    if let Some(cutoff_hz) = like.and_then(ResultFile::cutoff_hz) {
        fitted.motion.differentiator = fitted.motion.differentiator.with_cutoff(cutoff_hz);
    }
    let study = study.with_study(&fitted);
    let robot = study.robot_in(&folders)?;
    let in_study = Error::identification::<IdentificationError>(study.path);
    let task = study.task_with(study.settings(study.path, &robot)?, &robot, &folders)?;
    let reduced =
        files.while_unchanged(|| reduce_task(&task, settings.segments, options.execution()).map_err(&in_study))?;
    let log = |log| FactorLog::new(settings.arm.clone(), settings.recorded_at_s, log);
    let kind = without_logs(&study, &robot);
    Ok(Factors::new(kind, name_alone(study.path), reduced.into_iter().map(log).collect()))
}

/// The parts of the study that are needed to identify a model from factors, without local paths.
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

/// Identifies the model from all logs of `factors`, like [`identify()`](crate::identify()) does from the logs with
/// given cut-off frequency, friction and lag. Results that need samples are missing: delays, torque over time, study
/// examination, held-out logs.
///
/// # Errors
/// Same as for [`identify()`](crate::identify()).
pub fn identify_factors(factors: &Factors, options: &RunOptions<'_>) -> Result<IdentificationOutcome, Error> {
    let start = Instant::now();
    let study = StudyFile::new(&factors.study, &factors.study_path);
    let robot = study.robot_in(&study.folders(None))?;
    let settings = study.settings(study.path, &robot)?;
    let logs = with_unique_names(factors);
    let named: Vec<&ReducedLog> = logs.iter().collect();
    let mut timings = Timings { robot: start.elapsed().as_secs_f64(), ..Timings::default() };
    let found = identify_reduced(&robot.parametric, &settings, &named, options.execution())
        .map_err(Error::identification::<IdentificationError>(study.path))?;
    timings.estimation = found.times.estimation_s;
    timings.total = start.elapsed().as_secs_f64();
    timings.made_at = now();
    let recordings = logs.iter().map(|log| Recording::without_samples(log.name.clone())).collect();
    let mut task = IdentificationTask::new(robot.parametric.clone(), recordings);
    task.settings = settings;
    let metadata = FitMetadata { timings, provenance: factors_provenance(factors), is_payload: false };
    build_outcome(study, &robot, &task, found, metadata)
}

/// Residual of each log of `factors` with a model's base parameters, in percent of the root mean square torque.
/// `None` for a log without torque.
///
/// # Errors
/// [`Error::Result`] for a model of another robot.
pub fn factors_errors(factors: &Factors, model: &ResultFile, path: &Path) -> Result<Vec<Option<f64>>, Error> {
    let study = StudyFile::new(&factors.study, &factors.study_path);
    let robot = study.robot_in(&study.folders(None))?;
    let theta = model.base_values(path, &robot.parametric)?;
    let logs: Vec<&ReducedLog> = factors.logs().iter().map(|log| &log.log).collect();
    let in_study = Error::identification::<IdentificationError>(study.path);
    reduced_errors(&robot.parametric, &theta, &logs).map_err(|error| in_study(error.into()))
}

/// The logs with unique names: duplicate names are extended by digits of the log's hash.
fn with_unique_names(factors: &Factors) -> Vec<ReducedLog> {
    const HASH_DIGITS: usize = 8;
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    for log in factors.logs() {
        *seen.entry(&log.log.name).or_default() += 1;
    }
    let named = |log: &FactorLog| {
        let mut own = log.log.clone();
        if seen.get(&log.log.name[..]).is_some_and(|times| *times > 1) {
            own.name = format!("{} ({})", own.name, &log.sha256[..HASH_DIGITS]);
        }
        own
    };
    factors.logs().iter().map(named).collect()
}
