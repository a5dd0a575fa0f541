//! Before any fit is believed: do study, robot and recordings fit together?

use crate::diagnosis::{Diagnosis, DiagnosisTask, diagnose};
use crate::doubt::have_jumps;
use crate::error::IdentificationError;
use crate::task::IdentificationTask;
use crate::training::training_rows;
use dynident_estimation::{WeightedSettings, weighted_least_squares};
use dynident_recording::ImportReport;
use dynident_rows::{Execution, Logs, RegressorModel, Role, of_role};

/// What was found about a task's recordings before any fit is believed.
#[derive(Clone, Debug)]
pub struct StudyExamination {
    /// For each recording its number and what its import found; none for motions that were made already.
    pub imports: Vec<(usize, Option<ImportReport>)>,
    /// Mistakes, units of torque, payloads; none where jumps in a log make the comparison meaningless.
    pub diagnosis: Option<Diagnosis>,
    /// Rows of all joints that a fit would have.
    pub rows: usize,
    /// Base parameters that a fit would have.
    pub parameters: usize,
}

/// Reads every recording of a task, and searches mistakes in the training recordings and payloads in the others. No
/// friction is chosen and no bodies are estimated.
///
/// # Errors
/// Recordings that cannot be read, too few rows.
pub fn examine_study(
    task: &IdentificationTask,
    execution: Execution<'_>,
) -> Result<StudyExamination, IdentificationError> {
    execution.install(|| examined(task, execution))
}

fn examined(task: &IdentificationTask, execution: Execution<'_>) -> Result<StudyExamination, IdentificationError> {
    let IdentificationTask { robot, recordings, payloads, settings } = task;
    let chosen = of_role(recordings, Role::Identify);
    if chosen.is_empty() {
        return Err(IdentificationError::NoTrainingLog);
    }
    let logs = Logs::new(robot.model(), recordings, settings.row_settings(), &chosen, None, execution)?;
    let training = training_rows(&logs, settings, robot.clone().into(), &chosen, payloads, None)?;
    let estimate = weighted_least_squares(&training.problem, &WeightedSettings::default())?;
    let theta = &estimate.values[..training.columns.base()];
    let known = training.columns.is_plain().then_some(theta);
    let mut imports: Vec<(usize, Option<ImportReport>)> =
        training.logs.iter().map(|log| (log.index, log.statistics.report.clone())).collect();
    // Before the diagnosis, which finds them kept.
    let model: RegressorModel = robot.clone().into();
    for index in of_role(recordings, Role::Validate) {
        imports.push((index, logs.pass(&model, index).each_block(&mut |_| Ok(()))?));
    }
    let task = DiagnosisTask { logs: &logs, settings, robot, training: &chosen, theta: known };
    let diagnosis = if have_jumps(&training) { None } else { Some(diagnose(task)?) };
    let rows = training.problem.joint_rows().iter().sum();
    Ok(StudyExamination { imports, diagnosis, rows, parameters: robot.base().count() })
}
