//! Search for payloads and mistakes of single held-out logs.

use super::error::DiagnosisError;
use super::explanation::{Explanation, predicted};
use super::held_out_hypothesis::{HeldOutHypothesis, KnownRobot, held_out_hypothesis};
use super::hypothesis::Hypothesis;
use super::lag_search::LagSearch;
use super::motion_rows::{INSTANTS, MotionRows, MotionSamples};
use super::repeated_motion::repeats_motion;
use super::unmodelled_payload::{UnmodelledPayload, unmodelled_payload};
use crate::consistent::ConsistencySettings;
use crate::diagnosis_settings::DiagnosisSettings;
use dynident_rows::{Logs, RegressorModel, Role};

#[derive(Clone, Debug, Default)]
pub(super) struct HeldOutLogs {
    pub(super) payloads: Vec<UnmodelledPayload>,
    pub(super) hypotheses: Vec<HeldOutHypothesis>,
    pub(super) repeated_motions: Vec<usize>,
}

enum Cause {
    Payload(UnmodelledPayload),
    Mistake(HeldOutHypothesis),
}

impl Cause {
    /// Root mean square residual of all joints that it leaves, Nm.
    fn left(&self) -> f64 {
        match self {
            Self::Payload(payload) => payload.left_with,
            Self::Mistake(mistake) => mistake.left_without,
        }
    }
}

pub(super) struct TrainingResult<'a> {
    pub(super) model: &'a RegressorModel,
    pub(super) rows: &'a MotionRows,
    pub(super) as_written: &'a Hypothesis,
    /// Base parameters from all rows by least squares; `None` if the model differs from that of the study.
    pub(super) theta: Option<&'a [f64]>,
    pub(super) consistency: &'a ConsistencySettings,
    /// The compensated lag of each joint's torque, s.
    pub(super) compensated_s: &'a [f64],
    pub(super) settings: &'a DiagnosisSettings,
}

/// The payload or the mistake of each held-out log that explains the log clearly better than two alternatives: the
/// robot of the training logs, and one robot for all logs. It is reported only if neither the parameters from all rows
/// nor those of a physically consistent robot ([`Hypothesis::parameters`]) explain the log. The reason: free parameters
/// that the training motion does not excite cannot predict the torque of another motion. If both parameter sets lead to
/// different causes, the one that leaves the smaller residual is reported.
pub(super) fn held_out_logs(logs: &Logs<'_>, trained: &TrainingResult<'_>) -> Result<HeldOutLogs, DiagnosisError> {
    let (robot, settings) = (&trained.model.parametric, trained.settings);
    let mut found = HeldOutLogs::default();
    let is_bare = |log: &usize| logs.recordings[*log].payload.is_none();
    for log in logs.of_role(Role::Validate).into_iter().filter(is_bare) {
        let samples = [MotionSamples::of_recording(logs, trained.model, log, &settings.motion)?];
        let rows = samples[0].instants(INSTANTS);
        if repeats_motion(trained.rows, &rows, &settings.held_out) {
            found.repeated_motions.push(log);
        }
        let lag_search = LagSearch::new(robot, &samples, trained.compensated_s.to_vec(), settings);
        let explained = |theta: &[f64]| {
            let known = KnownRobot { robot, theta, left: &trained.as_written.left, settings };
            let payload = unmodelled_payload(robot, &rows, log, theta, &settings.held_out).map(Cause::Payload);
            let mistake = held_out_hypothesis(known, &rows, lag_search.as_ref(), log).map(Cause::Mistake);
            payload.into_iter().chain(mistake).min_by(|a, b| a.left().total_cmp(&b.left()))
        };
        let parameters = trained.theta.into_iter().chain([&trained.as_written.parameters[..]]);
        let Some(causes) = parameters.map(explained).collect::<Option<Vec<_>>>() else { continue };
        let Some(cause) = causes.into_iter().min_by(|a, b| a.left().total_cmp(&b.left())) else { continue };
        if left_of_one_robot(&rows, trained)? > settings.held_out.max_ratio_of_one_robot * cause.left() {
            match cause {
                Cause::Payload(payload) => found.payloads.push(payload),
                Cause::Mistake(mistake) => found.hypotheses.push(mistake),
            }
        }
    }
    Ok(found)
}

/// Root mean square residual of all joints in this log, Nm, for the best single robot for the training logs and this
/// log together.
fn left_of_one_robot(rows: &MotionRows, trained: &TrainingResult<'_>) -> Result<f64, DiagnosisError> {
    let robot = &trained.model.parametric;
    let mut all = trained.rows.clone();
    all.append(rows);
    let together = Explanation::new(robot, &all, Some(trained.consistency))?;
    let explained = predicted(robot, rows, together.parameters());
    let left = rows.tau.iter().zip(&explained).flat_map(|(tau, by)| tau.iter().zip(by).map(|(tau, by)| tau - by));
    let count = (rows.len() * rows.tau.len()).max(1) as f64;
    Ok((left.map(|left| left * left).sum::<f64>() / count).sqrt())
}
