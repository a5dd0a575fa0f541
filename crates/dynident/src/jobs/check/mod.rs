//! `check`: tests whether study, robot and logs are consistent, before any fit.

mod bench;
mod changes;
mod commands;
mod description;
mod findings;
mod settings;
mod torques;
mod wording;

pub use settings::CheckSettings;

use crate::error::Error;
use crate::inputs::InputFiles;
use crate::jobs::options::RunOptions;
use crate::result::{CHECK_SCHEMA, CheckFile, CheckFinding, StudyChange, StudyCheck};
use crate::study::{Folders, Study, StudyFile, StudyRobot};
use bench::bench_findings;
use commands::{command_findings, is_without_torque};
use dynident_identification::diagnosis::Diagnosis;
use dynident_identification::{
    IdentificationError, IdentificationSettings, RecordingEvents, StudyExamination, event_findings, examine_study,
};
use dynident_model::{AuditFinding, AuditLevel, InertialParameters, Mat3, audit};
use dynident_recording::{ImportReport, Level};
use findings::{currents_without_scale, log_load, position_torque, study_check};
use std::path::Path;

/// Names of the audit checks for physically inconsistent bodies; these do not depend on the robot's size.
const INCONSISTENT_BODY_CHECKS: [&str; 4] =
    ["mass-not-positive", "inertia-not-positive", "triangle-inequality", "inertia-too-large"];
/// Code of the finding about a recorder that repeats rows.
pub(super) const REPEATED_VALUES: &str = "import-repeated-values";
/// A body is treated as a point mass if its inertia about the centre of mass is at most this, relative to mass times
/// squared arm length.
const MAX_POINT_INERTIA_RATIO: f64 = 1e-12;

/// Examines a study against its robot and its logs: channels, clock and samples of every log. Also finds the
/// hypothesis about mistakes in the study with which a physically consistent robot explains the training logs best.
/// Writes no files.
///
/// # Errors
/// Every variant of [`Error`] for files, study and logs. Mistakes that are found are not errors.
pub fn check(study: &Study, study_path: &Path, options: &RunOptions<'_>) -> Result<CheckFile, Error> {
    check_with(study, study_path, options, &CheckSettings::default())
}

/// Like [`check()`], with other thresholds.
///
/// # Errors
/// Same as for [`check()`], and invalid thresholds.
pub fn check_with(
    study: &Study,
    study_path: &Path,
    options: &RunOptions<'_>,
    thresholds: &CheckSettings,
) -> Result<CheckFile, Error> {
    let study = StudyFile::new(study, study_path);
    thresholds.validate().map_err(Error::section(study.path, "check"))?;
    study.require_training_log(study.path)?;
    let files = InputFiles::of(study, options.data.as_deref());
    let folders = study.folders(options.data.as_deref());
    let robot = study.robot_in(&folders)?;
    let sources = study.log_sources(&folders)?;
    if is_without_torque(&study) {
        return check_commanded(&study, &robot, &folders, &files, thresholds);
    }
    let in_study = Error::identification::<IdentificationError>(study.path);
    let settings = study.settings(study.path, &robot)?;
    let task = study.task_with(settings, &robot, &folders)?;
    study.check_overlap(&sources, &task.recordings).map_err(Error::study(study.path))?;
    let examined = files.while_unchanged(|| examine_study(&task, options.execution()).map_err(in_study))?;

    let mut check = examined.diagnosis.as_ref().map_or_else(
        || StudyCheck { joints: robot.parametric.joint_names(), ..StudyCheck::default() },
        |diagnosis| diagnosis_check(&study, &robot, &task.settings, diagnosis, thresholds),
    );
    check.findings.extend(examined.position_torques.iter().map(position_torque));
    check.findings.extend(examined.loads.iter().map(|load| log_load(&study, &robot, load)));
    for (index, import) in &examined.imports {
        check.findings.extend(import.iter().flat_map(|import| import_findings(&study.log_name(*index), import)));
    }
    for RecordingEvents { index, search } in &examined.events {
        let log = study.log_name(*index);
        check
            .findings
            .extend(event_findings(search, &log).iter().map(|finding| CheckFinding::about_log(&log, finding)));
    }
    // A dead channel distorts the test of the robot description, and every test that needs its torque.
    if check.findings.iter().any(|finding| finding.kind == "log" && finding.level == Level::Problem) {
        check.findings.retain(|finding| !["description", "torque"].contains(&&finding.kind[..]));
    }
    check.findings.extend(command_findings(&study, &robot, &sources, &thresholds.commands)?);
    check.findings.extend(floating_base(&robot));
    check.findings.extend(impossible_bodies(&robot));
    check.findings.extend(too_few_rows(&examined, thresholds));
    check.findings.sort_by_key(|finding| core::cmp::Reverse(finding.level));
    Ok(CheckFile { schema: CHECK_SCHEMA.to_owned(), name: study.title(), check })
}

/// Like [`check_with`], for logs with commands instead of torques: no hypotheses about torques are compared.
fn check_commanded(
    study: &StudyFile<'_>,
    robot: &StudyRobot,
    folders: &Folders,
    files: &InputFiles,
    thresholds: &CheckSettings,
) -> Result<CheckFile, Error> {
    let sources = study.log_sources(folders)?;
    let findings = files.while_unchanged(|| {
        let recordings = study.recordings(robot, folders, &sources)?;
        study.check_overlap(&sources, &recordings).map_err(Error::study(study.path))?;
        Ok(command_findings(study, robot, &sources, &thresholds.commands)?)
    })?;
    let mut check = StudyCheck {
        joints: robot.parametric.joint_names(),
        findings,
        commanded_logs: sources.len(),
        ..StudyCheck::default()
    };
    check.findings.extend(bench_findings(study, &sources));
    check.findings.extend(floating_base(robot));
    check.findings.extend(impossible_bodies(robot));
    check.findings.sort_by_key(|finding| core::cmp::Reverse(finding.level));
    Ok(CheckFile { schema: CHECK_SCHEMA.to_owned(), name: study.title(), check })
}

fn too_few_rows(examined: &StudyExamination, thresholds: &CheckSettings) -> Option<CheckFinding> {
    let [too_few, few] =
        [thresholds.too_few_equations, thresholds.few_equations].map(|each| examined.rows < each * examined.parameters);
    let what = if too_few { "are too short" } else { "are short" };
    few.then(|| CheckFinding {
        level: if too_few { Level::Problem } else { Level::Warning },
        kind: "rows".to_owned(),
        what: format!("the training logs {what} for this robot"),
        evidence: format!(
            "{} equations for {} parameters after filter and decimation: a fit {} follow the noise; record longer logs, or give more logs the role \"identify\"",
            examined.rows,
            examined.parameters,
            if too_few { "would" } else { "may" }
        ),
        write: Vec::new(),
        or: Vec::new(),
        code: "check-rows".to_owned(),
    })
}

/// Warning that the base of the robot can move, although Dynident reads it as fixed.
pub(super) fn floating_base(robot: &StudyRobot) -> Option<CheckFinding> {
    let loss = robot.robot.losses_of_base().next()?;
    Some(CheckFinding {
        level: Level::Warning,
        kind: "description".to_owned(),
        what: loss.to_string(),
        evidence: "a motion or an inclination of the base changes all torques".to_owned(),
        write: Vec::new(),
        or: Vec::new(),
        code: "check-description".to_owned(),
    })
}

/// One warning for all physically inconsistent bodies of the robot description. Base parameters are not affected, but
/// parameters that are not identifiable keep the values of the robot description.
fn impossible_bodies(robot: &StudyRobot) -> Option<CheckFinding> {
    let model = &robot.robot.model;
    let of_audit = audit(model)
        .into_iter()
        .filter(|found| found.level != AuditLevel::Info && INCONSISTENT_BODY_CHECKS.contains(&found.check));
    let mut doubtful: Vec<String> =
        of_audit.map(|AuditFinding { place, message, .. }| format!("{place} of the description: {message}")).collect();
    let points = model.bodies().iter().filter(|body| body.prior().is_some_and(|body| is_a_point(&body, model.arm_m())));
    doubtful.extend(points.map(|body| format!("body {} of the description: has a mass but no inertia", body.name())));
    let first = doubtful.first()?;
    let more = match doubtful.len() {
        1 => String::new(),
        all => format!(" and {} more", all - 1),
    };
    Some(CheckFinding {
        level: Level::Warning,
        kind: "description".to_owned(),
        what: format!("{first}{more}"),
        evidence: format!(
            "`dynident inspect {}` lists all, and corrects simple errors with --fix; parameters that the logs do not determine stay \
             as in the robot description",
            robot.robot.path.display()
        ),
        write: Vec::new(),
        or: Vec::new(),
        code: "check-description".to_owned(),
    })
}

/// Whether a body is a point mass, for an arm of this length.
fn is_a_point(body: &InertialParameters, arm_m: f64) -> bool {
    let trace = |inertia: Mat3| (0..3).map(|k| inertia.0[k][k].abs()).sum::<f64>();
    let most = MAX_POINT_INERTIA_RATIO * body.mass_kg() * arm_m.powi(2);
    body.mass_kg() > 0.0 && body.inertia_at_com().is_some_and(|inertia| trace(inertia) <= most)
}

/// Findings of a diagnosis, and about the torque units in the study.
pub(super) fn diagnosis_check(
    study: &Study,
    robot: &StudyRobot,
    settings: &IdentificationSettings,
    diagnosis: &Diagnosis,
    thresholds: &CheckSettings,
) -> StudyCheck {
    let mut check = study_check(study, robot, settings, diagnosis, thresholds);
    if let Some(currents) = currents_without_scale(study, settings) {
        let is_of_torque = |change: &StudyChange| change.table.ends_with("torque");
        let is_unit = |finding: &CheckFinding| finding.kind == "unit" && finding.write.iter().all(is_of_torque);
        let (mut units, others): (Vec<CheckFinding>, Vec<CheckFinding>) =
            check.findings.into_iter().partition(|finding| is_unit(finding));
        units.retain(|finding| !finding.write.is_empty());
        let first = units.into_iter().next().map_or_else(|| currents.clone(), |unit| with_estimate(&currents, unit));
        check.findings = core::iter::once(first).chain(others).collect();
    }
    check
}

/// Finding about currents without a scale, with the scale that follows from the masses of the robot description.
fn with_estimate(currents: &CheckFinding, estimated: CheckFinding) -> CheckFinding {
    let evidence =
        format!("{}; estimated with the masses of the robot description: {}", currents.evidence, estimated.evidence);
    CheckFinding { evidence, write: estimated.write, ..currents.clone() }
}

fn import_findings(log: &str, import: &ImportReport) -> Vec<CheckFinding> {
    let matters = import.findings.iter().filter(|finding| finding.level != Level::Info);
    // The key applies to all logs, and to positions and torques together.
    let every =
        import.rows_to_a_position.filter(|every| import.rows_to_a_torque.is_none_or(|of_torque| of_torque == *every));
    let key = every.map(|every| StudyChange { table: "format".to_owned(), line: format!("keep_every = {every}") });
    let found = |finding: &dynident_recording::Finding| CheckFinding {
        write: key.iter().filter(|_| finding.code == REPEATED_VALUES).cloned().collect(),
        ..CheckFinding::about_log(log, finding)
    };
    matters.map(found).collect()
}
