//! Writes the identified robot of an iteration like `identify`: result.json, robot description, pages.

use crate::clock::now;
use crate::error::Error;
use crate::jobs::identify::{FitMetadata, IdentificationOutcome, build_outcome};
use crate::jobs::options::RunOptions;
use crate::jobs::provenance::later_provenance;
use crate::output_set::OutputSet;
use crate::result::{BaseParameterResult, Provenance, Timings};
use crate::study::{StudyFile, StudyInput, StudyRobot};
use dynident_identification::{IdentificationError, IdentificationTask, Role, identify};
use dynident_iteration::robot::{RunRequest, controller_json};
use dynident_iteration::{Iteration, IterationError, IterationStore, ModelParameters, RunRecord, friction_chosen};
use std::borrow::Cow;
use std::path::PathBuf;
use std::time::Instant;

const RESULT: &str = "result.json";
const URDF: &str = "identified.urdf";
const TABLE: &str = "identified.toml";
const MJCF: &str = "identified.xml";
const SDF: &str = "identified.sdf";
const CONTROLLER: &str = "controller.json";
const PAGE: &str = "identification.html";

/// Files written at the end of an iteration and removed at its start.
const MODEL_FILES: [&str; 7] = [RESULT, URDF, TABLE, MJCF, SDF, CONTROLLER, PAGE];

/// A finished iteration of trajectories that are identified together.
pub(super) struct EndedStage<'a> {
    pub(super) iteration: Iteration,
    pub(super) records: Vec<RunRecord>,
    pub(super) store: &'a IterationStore,
}

pub(super) struct RobotFiles {
    files: Vec<(&'static str, Vec<u8>)>,
    pub(super) base_parameters: Vec<BaseParameterResult>,
}

impl RobotFiles {
    /// No files, because no run was accepted.
    pub(super) fn none() -> Self {
        Self { files: Vec::new(), base_parameters: Vec::new() }
    }

    /// Adds these files to the set and removes older ones. If there are no files, those of another command remain.
    pub(super) fn added_to(self, mut set: OutputSet, are_own: bool) -> OutputSet {
        if self.files.is_empty() && !are_own {
            return set;
        }
        for name in MODEL_FILES {
            if self.files.iter().all(|(written, _)| *written != name) {
                set = set.absent(name);
            }
        }
        self.files.into_iter().fold(set, |set, (name, bytes)| set.file(name, bytes))
    }
}

/// Identifies the robot from all accepted runs, all joints at once; no files without an accepted run.
///
/// # Errors
/// Missing logs, or rows without an estimate.
pub(super) fn robot_found(
    study: StudyFile<'_>,
    robot: &StudyRobot,
    begun: &Provenance,
    stages: &[EndedStage<'_>],
    options: &RunOptions<'_>,
    failed: impl Fn(IterationError) -> Error + Copy,
) -> Result<RobotFiles, Error> {
    let start = Instant::now();
    let mut whole: Option<IdentificationTask> = None;
    let mut logs: Vec<PathBuf> = Vec::new();
    for stage in stages {
        let Some(task) = stage.iteration.identification_task(&stage.records, stage.store).map_err(failed)? else {
            continue;
        };
        let legs = stage.iteration.task().legs.len();
        logs.extend(task.recordings.iter().enumerate().map(|(place, recording)| {
            // The name has the form `run 3, leg 2`.
            let run = recording.name.split([' ', ',']).nth(1).and_then(|run| run.parse().ok()).unwrap_or(1);
            // Validation logs are last.
            match recording.role {
                Role::Identify => stage.store.log_path(run, place % legs),
                Role::Validate => stage.store.held_out_log_path(run),
            }
        }));
        match &mut whole {
            Some(whole) => whole.recordings.extend(task.recordings),
            None => whole = Some(task),
        }
    }
    let (Some(task), Some(last)) = (whole, stages.last()) else { return Ok(RobotFiles::none()) };
    let in_study = Error::identification::<IdentificationError>(study.path);
    let mut found = identify(&task, options.execution()).map_err(&in_study)?;
    found.training.friction_choice = friction_chosen(&last.records);
    let read: Vec<_> = logs.iter().map(|log| ("log", StudyInput::File(log.clone()))).collect();
    let timings = Timings {
        logs: found.times.logs_s,
        estimation: found.times.estimation_s,
        validation: found.times.examination_s,
        total: start.elapsed().as_secs_f64(),
        made_at: now(),
        ..Timings::default()
    };
    let parameters = found.consistent.parameters.clone();
    let metadata = FitMetadata { timings, provenance: later_provenance(study, begun, &read)?, is_payload: false };
    let mut outcome = build_outcome(study, robot, &task, found, metadata)?;
    for (summary, path) in outcome.result.logs.iter_mut().zip(&logs) {
        summary.import.file = study.relative(path);
    }
    outcome.result.seal();
    let mut files = vec![
        (RESULT, outcome.result.to_json().map_err(|error| not_json(&error))?.into_bytes()),
        (CONTROLLER, json(&controller(last, &parameters).map_err(failed)?)?),
        (PAGE, outcome.report()?.into_bytes()),
    ];
    let IdentificationOutcome { urdf, table, mjcf, sdf, result, .. } = outcome;
    files.extend(
        [(URDF, urdf), (TABLE, table), (MJCF, mjcf), (SDF, sdf)]
            .into_iter()
            .filter_map(|(name, text)| Some((name, text?.into_bytes()))),
    );
    Ok(RobotFiles { files, base_parameters: result.base_parameters })
}

fn json(value: &serde_json::Value) -> Result<Vec<u8>, Error> {
    let text = dynident_text::json::to_string_pretty(value).map_err(|error| not_json(&error))?;
    Ok((text + "\n").into_bytes())
}

fn not_json(error: &serde_json::Error) -> Error {
    Error::Result { path: PathBuf::from(RESULT), message: error.to_string() }
}

fn controller(stage: &EndedStage<'_>, parameters: &[f64]) -> Result<serde_json::Value, IterationError> {
    let EndedStage { iteration, records, .. } = stage;
    let model = iteration.controller_model(records, &ModelParameters::All(parameters.to_vec()))?;
    let settings = iteration.settings();
    let joints = iteration.task().robot.joint_names();
    let legs = records.last().map_or(Ok(Cow::Borrowed(&iteration.task().legs[..])), |last| iteration.legs_of(last))?;
    let reference = legs[0].reference();
    let request = RunRequest {
        model: Some(&model),
        envelope: settings.safety.envelope.as_ref(),
        ..RunRequest::new(records.len() + 1, reference, &settings.controller)
    };
    Ok(controller_json(&request, &joints))
}
