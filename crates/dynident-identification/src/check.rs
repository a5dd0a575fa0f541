//! Consistency of study, robot and recordings, tested without selecting friction or estimating bodies.

use crate::changes::{LogLoad, log_loads};
use crate::diagnosis::{Diagnosis, DiagnosisTask, diagnose};
use crate::doubt::have_jumps;
use crate::error::IdentificationError;
use crate::events::{RecordingEvents, task_without_events};
use crate::examination::{PositionTorque, position_torques};
use crate::settings::GainChoice;
use crate::task::{IdentificationTask, logs_without_payload};
use crate::training::training_rows;
use dynident_estimation::{WeightedSettings, weighted_least_squares};
use dynident_recording::ImportReport;
use dynident_rows::{Execution, Logs, RegressorModel, Role, of_role};

/// Results of the tests before a fit.
#[derive(Clone, Debug)]
pub struct StudyExamination {
    /// Index and import report of each recording; the report is `None` for a prepared motion.
    pub imports: Vec<(usize, Option<ImportReport>)>,
    /// Mistakes in the study, wrong units of torque, undeclared payloads; `None` if jumps in a log invalidate the
    /// comparison.
    pub diagnosis: Option<Diagnosis>,
    /// Loads that only one of several training recordings carries; empty if a mistake in the study explains the
    /// recordings better.
    pub loads: Vec<LogLoad>,
    /// Events in the recordings; the diagnosis does not use intervals that are excluded from the fit.
    pub events: Vec<RecordingEvents>,
    /// Joints whose unexplained torque is a function of their position; empty if a mistake in the study explains the
    /// recordings.
    pub position_torques: Vec<PositionTorque>,
    /// Number of rows of all joints that a fit would use.
    pub rows: usize,
    /// Number of base parameters that a fit would estimate.
    pub parameters: usize,
}

/// Reads every recording of a task. Searches for mistakes of the study in the training recordings, and for payloads and
/// mistakes in the held-out recordings. No friction is selected and no bodies are estimated.
///
/// # Errors
/// Recordings cannot be read, or there are too few rows.
pub fn examine_study(
    task: &IdentificationTask,
    execution: Execution<'_>,
) -> Result<StudyExamination, IdentificationError> {
    execution.install(|| examined(task, execution))
}

fn examined(task: &IdentificationTask, execution: Execution<'_>) -> Result<StudyExamination, IdentificationError> {
    let IdentificationTask { recordings, settings, .. } = task;
    let chosen = of_role(recordings, Role::Identify);
    if chosen.is_empty() {
        return Err(IdentificationError::NoTrainingLog);
    }
    let (events, without_events) = task_without_events(task, execution)?;
    let task = without_events.as_ref().unwrap_or(task);
    let IdentificationTask { robot, recordings, payloads, .. } = task;
    let logs = Logs::new(robot.model(), recordings, settings.row_settings(), &chosen, None, execution)?;
    let training = training_rows(&logs, settings, robot.clone().into(), &chosen, payloads, None)?;
    let estimate = weighted_least_squares(&training.problem, &WeightedSettings::default())?;
    // Hypotheses are tested on the arm without declared payloads.
    let bare = logs_without_payload(recordings, &chosen);
    let mut arm = estimate.values[..training.columns.base()].to_vec();
    if bare.len() < chosen.len() && settings.gains == GainChoice::Stated {
        let rows = training_rows(&logs, settings, robot.clone().into(), &bare, payloads, None)?;
        arm = weighted_least_squares(&rows.problem, &WeightedSettings::default())?.values[..arm.len()].to_vec();
    }
    let known = training.columns.are_plain(&bare).then_some(&arm[..]);
    let mut imports: Vec<(usize, Option<ImportReport>)> =
        training.logs.iter().map(|log| (log.index, log.statistics.report.clone())).collect();
    // The held-out recordings are read before the diagnosis, which can then use the motions in memory.
    let model: RegressorModel = robot.clone().into();
    for index in of_role(recordings, Role::Validate) {
        imports.push((index, logs.pass(&model, index).each_block(&mut |_| Ok(()))?));
    }
    let task = DiagnosisTask { logs: &logs, settings, robot, training: &bare, theta: known };
    let diagnosis = if have_jumps(&training) { None } else { Some(diagnose(task)?) };
    let best = diagnosis.as_ref().is_none_or(|found| found.search.best.is_some());
    let position_torques = match known {
        Some(_) if !best => position_torques(&logs, &training.model, &bare, &settings.examination)?,
        _ => Vec::new(),
    };
    let has_mistake = diagnosis.as_ref().is_none_or(|found| found.search.best.is_some() || found.is_unexplained());
    // Logs that do not determine the parameters cannot be compared.
    let (limits, settings) = (&settings.thresholds.log_load, settings.estimation.weighted());
    let loads = if has_mistake { Vec::new() } else { log_loads(&training, &settings, limits).unwrap_or_default() };
    let rows = training.problem.joint_rows().iter().sum();
    let parameters = robot.base().count();
    Ok(StudyExamination { imports, diagnosis, loads, events, position_torques, rows, parameters })
}
