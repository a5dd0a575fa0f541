//! `validate`: a model on logs that were not used for its fit.

use crate::error::Error;
use crate::inputs::InputFiles;
use crate::jobs::log_summary::held_out_summary;
use crate::jobs::options::RunOptions;
use crate::jobs::provenance::read_input;
use crate::result::{InputFile, LogSummary, ResultFile, VALIDATION_SCHEMA, ValidationFile};
use crate::study::{Folders, Study, StudyFile, StudyInput};
use dynident_identification::examination::{HeldOutExamination, LogTrace, ModelUnderTest, examine_held_out};
use dynident_identification::{Logs, Role};
use std::path::Path;

/// Validates the model of a `result.json` on the logs of a study with the role `validate`, or on all logs if no log has
/// this role. A log that was used for the fit is listed in `problems` of the returned file.
///
/// # Errors
/// If the result does not belong to the study's robot, or a log cannot be read.
pub fn validate(
    result_path: &Path,
    study: &Study,
    study_path: &Path,
    options: &RunOptions<'_>,
) -> Result<ValidationFile, Error> {
    validate_result(&ResultFile::read(result_path)?, result_path, study, study_path, options)
}

/// Like [`validate()`] with a result in memory; `result_path` is its name in messages.
///
/// # Errors
/// Same as for [`validate()`].
pub fn validate_result(
    stored: &ResultFile,
    result_path: &Path,
    study: &Study,
    study_path: &Path,
    options: &RunOptions<'_>,
) -> Result<ValidationFile, Error> {
    Ok(validated(stored, result_path, study, study_path, options, false)?.0)
}

/// Torque over time of the logs that [`validate_result()`] uses: measured, and predicted by the exported model.
///
/// # Errors
/// Same as for [`validate()`].
pub fn validation_traces(
    stored: &ResultFile,
    result_path: &Path,
    study: &Study,
    study_path: &Path,
    options: &RunOptions<'_>,
) -> Result<Vec<LogTrace>, Error> {
    Ok(validated(stored, result_path, study, study_path, options, true)?.1)
}

fn validated(
    stored: &ResultFile,
    result_path: &Path,
    study: &Study,
    study_path: &Path,
    options: &RunOptions<'_>,
    traced: bool,
) -> Result<(ValidationFile, Vec<LogTrace>), Error> {
    let study = StudyFile::new(study, study_path);
    study.require_log(study.path)?;
    let files = InputFiles::of(study, options.data.as_deref());
    let folders = study.folders(options.data.as_deref());
    let fitted = stored.as_fitted(&study);
    let study = study.with_study(&fitted);
    let robot = study.robot_in(&folders)?;
    let theta = stored.base_values(result_path, &robot.parametric)?;
    let consistent = stored.consistent_values(result_path)?;
    let model = stored.regressor_model(result_path, &robot.parametric)?;
    let payloads = stored.payloads(result_path, study, &model)?;
    let task = study.task(study.path, &robot, &folders)?;
    let mut chosen = study.logs_of_role(Role::Validate);
    if chosen.is_empty() {
        chosen = (0..study.log.len()).collect();
    }
    let execution = options.execution();
    let (recordings, settings) = (&task.recordings, &task.settings);
    let tested = execution.install(|| {
        let logs =
            Logs::new(robot.model(), recordings, settings.row_settings(), &chosen, stored.cutoff_hz(), execution)?
                .with_motion_band(stored.motion_hz());
        let one = |&index: &usize| {
            let carried = recordings[index].payload.as_ref();
            let theta = payloads.base_values(carried, &theta);
            let physical = consistent.as_ref().map(|values| payloads.base_values(carried, values));
            let tested = ModelUnderTest {
                theta: &theta,
                physical: physical.as_deref(),
                uncertainty: None,
                traced,
                offset_share: settings.held_out_offset_share(),
            };
            examine_held_out(&logs, &settings.estimation, &model, index, &tested)
        };
        chosen.iter().map(one).collect::<Result<Vec<_>, _>>()
    });
    let tested = files.while_unchanged(|| tested.map_err(Error::identification(study.path)))?;
    let joints = model.joint_names();
    let summary = |log: &HeldOutExamination| {
        let mut summary = held_out_summary(&recordings[log.index], log, &joints);
        summary.import.file = study.relative(Path::new(&summary.import.file));
        summary
    };
    let logs: Vec<LogSummary> = tested.iter().map(summary).collect();
    let mut problems = training_logs(stored, study, &folders, &chosen)?;
    problems.extend(logs.iter().flat_map(LogSummary::problems));
    files.unchanged()?;
    let (validation, traces): (Vec<_>, Vec<_>) = tested.into_iter().map(|log| (log.validation, log.trace)).unzip();
    let file = ValidationFile { schema: VALIDATION_SCHEMA.to_owned(), name: study.title(), logs, problems, validation };
    Ok((file, traces.into_iter().flatten().collect()))
}

fn training_logs(
    stored: &ResultFile,
    study: StudyFile<'_>,
    folders: &Folders,
    chosen: &[usize],
) -> Result<Vec<String>, Error> {
    let mut problems = Vec::new();
    for &index in chosen {
        let input = read_input("log", &StudyInput::from(study.log_source(folders, index)?), study)?;
        if let Some(fitted) = fitted_to(stored, &input) {
            problems.push(format!(
                "log `{}` is the training log `{fitted}`, so this is no validation: use a log of another run",
                study.log_name(index)
            ));
        }
    }
    Ok(problems)
}

/// Name of the training log with the same content as `input`; `None` if there is no such log, or if parts of that
/// file were held out.
fn fitted_to<'a>(stored: &'a ResultFile, input: &InputFile) -> Option<&'a str> {
    let inputs = &stored.provenance.as_ref()?.inputs;
    let known = inputs.iter().find(|known| known.what == "log" && known.sha256 == input.sha256)?;
    let of_file = || stored.logs.iter().filter(|log| log.import.file == known.file);
    if of_file().any(|log| log.role == Role::Validate) {
        return None;
    }
    of_file().find(|log| log.role == Role::Identify).map(|log| &log.log[..])
}
