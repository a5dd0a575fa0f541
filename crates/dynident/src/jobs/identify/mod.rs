//! `identify`: a model from logs.

mod forms;
mod joint_values;
mod model_files;
mod sections;

use crate::clock::now;
use crate::error::Error;
use crate::inputs::InputFiles;
use crate::jobs::check::{CheckSettings, diagnosis_check, floating_base};
use crate::jobs::differences::description_comparison;
use crate::jobs::log_summary::{held_out_summary, training_summary};
use crate::jobs::options::RunOptions;
use crate::jobs::provenance::{concurrently, provenance};
use crate::pages::robot::RobotAppearance;
use crate::result::{LogSummary, PhysicalVerdict, Provenance, RESULT_SCHEMA, ResultFile, Timings, TrainingResult};
use crate::study::{ArmSection, EstimatorMethod, Folders, FrictionChoice, Study, StudyFile, StudyInput, StudyRobot};
use dynident_estimation::{Estimate, strongest_correlations};
use dynident_identification::diagnosis::Diagnosis;
use dynident_identification::estimators::{Findings, InstrumentSource};
use dynident_identification::examination::{LogTrace, friction_sign_findings, position_torque_findings, sign_findings};
use dynident_identification::friction::FrictionSearch;
use dynident_identification::{
    DiagnosisChoice, Identification, IdentificationError, IdentificationTask, RecordingEvents, conditionals,
    event_findings, event_traces, identify as identify_task, identify_payload,
    identify_with_instruments as identify_task_with_instruments,
};
use dynident_model::InertialParameters;
use dynident_recording::Level;
use forms::{form_results, stored_model};
use model_files::{ModelFiles, model_files};
use nalgebra::DMatrix;
use sections::{
    base_parameters, bodies, friction_results, joint_results, method_summary, offset_results, physical_fit_result,
    robot_summary, sources, term_results, training_result, verdict,
};
use std::path::Path;
use std::time::Instant;

const MAX_CORRELATIONS: usize = 10;

/// A finished identification of a study.
#[derive(Debug)]
pub struct IdentificationOutcome {
    /// Content of `result.json`.
    pub result: ResultFile,
    /// The estimate with its covariance.
    pub estimate: Estimate,
    /// Inertial parameters of the bodies, as in `result.bodies`.
    pub inertials: Vec<InertialParameters>,
    /// The user's URDF with the new values, or a URDF converted from a D-H table, MJCF or SDF; if missing,
    /// [`ResultFile::no_urdf`] has the reason.
    pub urdf: Option<String>,
    /// The user's D-H table with the new values.
    pub table: Option<String>,
    /// The user's MJCF with the new values; if missing, [`ResultFile::no_mjcf`] has the reason.
    pub mjcf: Option<String>,
    /// The user's SDF with the new values; if missing, [`ResultFile::no_sdf`] has the reason.
    pub sdf: Option<String>,
    /// Measured and predicted torque over time, training logs first: at most the first 20 000 samples of a training log
    /// and the first 100 000 filtered rows of a held-out log.
    pub traces: Vec<LogTrace>,
    /// The robot, for its picture.
    pub robot: RobotAppearance,
}

impl IdentificationOutcome {
    /// The report as one self-contained HTML page: measured and predicted torque, residuals, parameters with error
    /// bars, friction, bodies, findings about the logs, computing times.
    ///
    /// # Errors
    /// [`Error::Report`], which indicates a bug.
    pub fn report(&self) -> Result<String, Error> {
        crate::pages::identification::identification_report(&self.result, &self.traces, Some(&self.robot))
    }
}

/// Fits a study's model to its training logs and validates it on the held-out logs.
///
/// # Errors
/// Every variant of [`Error`] for files, study and logs. A poor fit is not an error.
pub fn identify(study: &Study, study_path: &Path, options: &RunOptions<'_>) -> Result<IdentificationOutcome, Error> {
    identify_unchanged(StudyFile::new(study, study_path), options, None)
}

/// Like [`identify()`] with the method `"instrumental"`, regardless of the method in the study. The instruments come
/// from `source`: a simulation of the closed loop with the current model (IDIM-IV: repeat with a new simulation until
/// the parameters converge), or a repeated run.
///
/// # Errors
/// Same as for [`identify()`], and errors of `source`.
pub fn identify_with_instruments(
    study: &Study,
    study_path: &Path,
    options: &RunOptions<'_>,
    source: &mut dyn InstrumentSource,
) -> Result<IdentificationOutcome, Error> {
    let mut study = study.clone();
    study.estimator.method = EstimatorMethod::Instrumental;
    identify_unchanged(StudyFile::new(&study, study_path), options, Some(source))
}

fn identify_unchanged(
    study: StudyFile<'_>,
    options: &RunOptions<'_>,
    source: Option<&mut dyn InstrumentSource>,
) -> Result<IdentificationOutcome, Error> {
    let files = InputFiles::of(study, options.data.as_deref());
    files.while_unchanged(|| identify_from_files(study, options, source))
}

fn identify_from_files(
    study: StudyFile<'_>,
    options: &RunOptions<'_>,
    source: Option<&mut dyn InstrumentSource>,
) -> Result<IdentificationOutcome, Error> {
    let start = Instant::now();
    study.require_training_log(study.path)?;
    let folders = study.folders(options.data.as_deref());
    let arm = study.arm.as_ref().map(|section| known_arm(section, &folders)).transpose()?;
    // The friction that was selected when the arm was identified is used again.
    let with_arm = arm.as_ref().map(|(_, stored)| stored.as_fitted(&study));
    let study = study.with_study(with_arm.as_ref().unwrap_or(study.study));
    let robot = study.robot_in(&folders)?;
    let in_study = Error::identification::<IdentificationError>(study.path);
    // Names are checked before any log is read.
    // The study is always examined (as by `check`), because any result may be used.
    let mut settings = study.settings(study.path, &robot)?;
    settings.diagnosis = DiagnosisChoice::Always;
    if source.is_some() {
        // Instruments need fixed terms, so the friction terms of the study are used.
        let is_auto = |search: &FrictionSearch| study.drive.friction_of(&search.joint) == Some(FrictionChoice::Auto);
        settings.friction = settings.friction.retaining(is_auto);
        settings.drive_inertia.clear();
    }
    settings.check_names(&robot.parametric).map_err(|error| in_study(IdentificationError::Consistency(error)))?;
    let task = study.task_with(settings, &robot, &folders)?;
    let sources = study.log_sources(&folders)?;
    study.check_overlap(&sources, &task.recordings).map_err(Error::study(study.path))?;
    let mut read = vec![("robot", study.robot_input(&robot))];
    read.extend(study.table_inputs(&folders));
    read.extend(sources.into_iter().map(|source| ("log", StudyInput::from(source))));
    read.extend(arm.iter().map(|(path, _)| ("result", StudyInput::File(path.clone()))));
    let mut timings = Timings { robot: start.elapsed().as_secs_f64(), ..Timings::default() };

    let execution = options.execution();
    let identification = || -> Result<_, Error> {
        let found = match (&arm, &study.arm, source) {
            (Some((path, stored)), Some(section), _) => {
                let arm = stored.known_arm(path, &robot.parametric, section.refit)?;
                identify_payload(&task, &arm, execution)
            }
            (_, _, Some(source)) => identify_task_with_instruments(&task, source, execution),
            _ => identify_task(&task, execution),
        };
        found.map_err(&in_study)
    };
    let hashes = || provenance(study, &read);
    let (provenance, found) = concurrently(options.threads, hashes, identification);
    let (found, provenance) = (found?, provenance?);
    timings.logs = found.times.logs_s;
    timings.estimation = found.times.estimation_s;
    timings.validation = found.times.examination_s;
    timings.total = start.elapsed().as_secs_f64();
    timings.made_at = now();

    let metadata = FitMetadata { timings, provenance, is_payload: arm.is_some() };
    build_outcome(study, &robot, &task, found, metadata)
}

pub(in crate::jobs) struct FitMetadata {
    pub(in crate::jobs) timings: Timings,
    pub(in crate::jobs) provenance: Provenance,
    /// Whether payloads on a known arm were estimated.
    pub(in crate::jobs) is_payload: bool,
}

/// Writes the result and the model files of an identification.
///
/// # Errors
/// Rows that do not match the estimate.
pub(in crate::jobs) fn build_outcome(
    study: StudyFile<'_>,
    robot: &StudyRobot,
    task: &IdentificationTask,
    found: Identification,
    FitMetadata { timings, provenance, is_payload }: FitMetadata,
) -> Result<IdentificationOutcome, Error> {
    let in_study = Error::identification::<IdentificationError>(study.path);
    let inertials = found.inertials();
    let verdict = physical_verdict(&study, &found, &inertials);
    let (files, no_urdf) = match exported_model(&study, robot, task, &found, &verdict, is_payload) {
        Ok(files) => (Some(files.with_provenance(&provenance, &form_results(&found))), None),
        Err(reason) => (None, Some(reason)),
    };
    let (mut urdf, mut table, mut mjcf, mut no_mjcf, mut sdf, mut no_sdf) = (None, None, None, None, None, None);
    if let Some(files) = files {
        (urdf, table) = (Some(files.urdf), files.table);
        match files.mjcf {
            Some(Ok(text)) => mjcf = Some(text),
            Some(Err(reason)) => no_mjcf = Some(reason),
            None => {}
        }
        match files.sdf {
            Some(Ok(text)) => sdf = Some(text),
            Some(Err(reason)) => no_sdf = Some(reason),
            None => {}
        }
    }
    let training = training_result(&found, &task.recordings).map_err(|error| in_study(error.into()))?;
    let parts = Parts {
        name: study.title(),
        timings,
        provenance,
        verdict,
        no_urdf,
        no_mjcf,
        no_sdf,
        inertials: &inertials,
        is_payload,
        training,
    };
    let mut result = result_file(&study, robot, task, &found, parts);
    result.problems = result.found_problems();
    result.robot.file = study.relative(&robot.robot.path);
    for log in &mut result.logs {
        log.import.file = study.relative(Path::new(&log.import.file));
    }
    result.seal();
    let mut traces = found.examination.traces;
    traces.extend(found.held_out.into_iter().filter_map(|log| log.trace));
    for RecordingEvents { index, search } in &found.events {
        if let Some(trace) = traces.iter_mut().find(|trace| trace.log == task.recordings[*index].name) {
            trace.events = event_traces(search, &result.robot.joints);
        }
    }
    let robot = RobotAppearance::new(robot.parametric.model(), &robot.robot.path);
    Ok(IdentificationOutcome { result, estimate: found.estimate, inertials, urdf, table, mjcf, sdf, traces, robot })
}

fn known_arm(section: &ArmSection, folders: &Folders) -> Result<(std::path::PathBuf, ResultFile), Error> {
    let path = folders.find(&section.result, None)?;
    let stored = ResultFile::read(&path)?;
    Ok((path, stored))
}

fn physical_verdict(study: &Study, found: &Identification, inertials: &[InertialParameters]) -> PhysicalVerdict {
    let consistent = &found.consistent;
    let mut verdict = verdict(found.model(), inertials, &consistent.parameters);
    if let Some(fit) = &consistent.fit {
        let arm_estimate = found.training.columns.arm_estimate(found.estimate());
        verdict.fit = Some(physical_fit_result(fit, &arm_estimate));
        let is_fitted_to_logs = found.estimator.is_plain() && study.arm.is_none();
        verdict.note = String::from(if is_fitted_to_logs {
            "of the physically consistent set with the best fit to the logs; the base parameters are the unconstrained estimate"
        } else {
            "of the physically consistent set nearest to the estimate; the base parameters are the unconstrained estimate"
        });
    }
    verdict.failure.clone_from(&consistent.failure);
    verdict.sign = found.examination.sign;
    verdict.impossible_priors = consistent
        .inconsistent_nominal
        .iter()
        .map(|(body, least)| format!("{body}: smallest eigenvalue of the pseudo-inertia {least:.2e}"))
        .collect();
    verdict
}

/// A result remains valid if URDF cannot express its parameters.
fn exported_model(
    study: &Study,
    robot: &StudyRobot,
    task: &IdentificationTask,
    found: &Identification,
    verdict: &PhysicalVerdict,
    is_payload: bool,
) -> Result<ModelFiles, String> {
    if is_payload {
        return Err(verdict.failure.clone().unwrap_or_default());
    }
    if task.settings.consistency.is_some() && (verdict.failure.is_some() || !verdict.consistent) {
        let reason = verdict.failure.clone().unwrap_or_else(|| verdict.violations.join("; "));
        return Err(format!(
            "the bodies are not physically consistent: {reason} (set estimator.physical = false to write them anyway)"
        ));
    }
    let sources = sources(found.model(), found.estimate());
    model_files(study, robot, found, &sources)
}

struct Parts<'a> {
    name: String,
    timings: Timings,
    provenance: Provenance,
    verdict: PhysicalVerdict,
    no_urdf: Option<String>,
    no_mjcf: Option<String>,
    no_sdf: Option<String>,
    inertials: &'a [InertialParameters],
    is_payload: bool,
    training: TrainingResult,
}

fn result_file(
    study: &Study,
    robot: &StudyRobot,
    task: &IdentificationTask,
    found: &Identification,
    parts: Parts<'_>,
) -> ResultFile {
    let (model, estimate, base) = (found.model(), found.estimate(), found.training.columns.base());
    let parameters = &found.consistent.parameters;
    let rows_of = |matrix: &DMatrix<f64>| -> Vec<Vec<f64>> {
        (0..base).map(|row| matrix.view((row, 0), (1, base)).iter().copied().collect()).collect()
    };
    let (mut gross_errors, mut noise_correlation, mut noise_levels) = (None, None, None);
    let (mut series, mut spline_motion, mut simulated) = (None, None, None);
    match found.estimation.findings.clone() {
        Findings::GrossErrors(found) => gross_errors = Some(found),
        Findings::NoiseCorrelation(found) => noise_correlation = Some(found),
        Findings::NoiseLevels(found) => noise_levels = Some(found),
        Findings::Series(found) => series = Some(found),
        Findings::Spline(found) => spline_motion = Some(found),
        Findings::Simulated(found) => simulated = Some(found),
        Findings::None => {}
    }
    let knowledge = task.settings.consistency.clone().unwrap_or_default();
    let conditionals = conditionals(&found.training, estimate, &found.estimation.estimate.half_width_95, &knowledge);
    let held_out = found.held_out.iter();
    let bands = held_out.clone().flat_map(|log| &log.validation.residuals).filter_map(|joint| joint.band.clone());
    ResultFile {
        schema: RESULT_SCHEMA.to_owned(),
        name: parts.name,
        problems: Vec::new(),
        thresholds: study.thresholds.report.clone(),
        provenance: Some(parts.provenance),
        robot: robot_summary(robot),
        method: method_summary(study, found),
        noise_in_regressor: found.estimation.noise_in_regressor.clone(),
        gross_errors,
        noise_correlation,
        noise_levels,
        periodic: None,
        series,
        spline_motion,
        simulated,
        base_parameters: base_parameters(found, &conditionals),
        base_parameter_covariance: rows_of(&estimate.covariance),
        base_parameter_joint_covariance: rows_of(&estimate.joint_covariance()),
        bodies: bodies(model, parts.inertials, &sources(model, estimate), &found.consistent.parameter_std),
        description_differences: description_comparison(found, &task.settings.thresholds.description),
        possible_intervals: found.consistent.intervals.clone(),
        essential: found.essential.clone(),
        correlations: strongest_correlations(estimate, MAX_CORRELATIONS),
        joints: joint_results(model, estimate, parameters, &found.examination.pooled_delays),
        drive_inertia_choice: found.drive_inertia.clone().or_else(|| study.drive_inertia_untested(robot)),
        friction_choice: [&found.training.friction_choice[..], &study.friction_as_stated(robot)]
            .into_iter()
            .flat_map(friction_results)
            .collect(),
        model: if parts.is_payload { None } else { stored_model(study, found, parts.inertials) },
        forms: form_results(found),
        payloads: found.payloads.clone(),
        offsets: offset_results(found, &task.recordings),
        drive_gains: found.training.gains.as_ref().map(|(_, gains)| gains.clone()),
        couplings: term_results(model, estimate, parameters, |term| term.own_joint().is_none()),
        training: parts.training,
        torque_band: bands.collect(),
        validation: held_out.map(|log| log.validation.clone()).collect(),
        physical: parts.verdict,
        logs: log_summaries(task, found),
        check: found.diagnosis.as_ref().map(|diagnosis| {
            let mut check = diagnosis_check(study, robot, &task.settings, diagnosis, &CheckSettings::default());
            check.findings.extend(floating_base(robot));
            check
        }),
        no_urdf: parts.no_urdf,
        no_mjcf: parts.no_mjcf,
        no_sdf: parts.no_sdf,
        timings_s: parts.timings,
    }
}

fn log_summaries(task: &IdentificationTask, found: &Identification) -> Vec<LogSummary> {
    let joints = found.model().joint_names();
    let pairs = found.training.logs.iter().zip(&found.examination.delays);
    let has_no_better = |diagnosis: &Diagnosis| diagnosis.search.best.is_none() && !diagnosis.is_unexplained();
    let is_best_as_written = found.diagnosis.as_ref().is_some_and(has_no_better);
    let training = pairs.map(|(factors, delays)| {
        let mut summary = training_summary(&task.recordings[factors.index], factors, delays, &joints);
        summary.model_findings.extend(found.examination.sign.as_ref().and_then(sign_findings));
        summary.model_findings.extend(friction_sign_findings(&found.examination.friction_signs, is_best_as_written));
        summary.model_findings.extend(position_torque_findings(&found.examination.position_torques));
        summary
    });
    let held_out = found.held_out.iter().map(|log| held_out_summary(&task.recordings[log.index], log, &joints));
    // The best hypothesis already gives the mistake; findings about the sign of single joints are consequences of it.
    let is_explained = found.diagnosis.as_ref().is_some_and(|diagnosis| diagnosis.search.best.is_some());
    let mut all: Vec<LogSummary> = training.chain(held_out).collect();
    let indices = found.training.logs.iter().map(|log| log.index).chain(found.held_out.iter().map(|log| log.index));
    for (summary, index) in all.iter_mut().zip(indices) {
        for RecordingEvents { search, .. } in found.events.iter().filter(|of_log| of_log.index == index) {
            summary.model_findings.extend(event_findings(search, &summary.log));
            summary.events.clone_from(&search.events);
        }
    }
    if is_explained {
        for log in &mut all {
            log.model_findings.retain(|finding| finding.level != Level::Problem);
        }
    }
    all
}
