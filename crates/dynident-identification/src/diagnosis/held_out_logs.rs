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
/// that the training motion does not excite cannot predict the torque of another motion.
pub(super) fn held_out_logs(logs: &Logs<'_>, trained: &TrainingResult<'_>) -> Result<HeldOutLogs, DiagnosisError> {
    let (robot, settings) = (&trained.model.parametric, trained.settings);
    let mut found = HeldOutLogs::default();
    for log in logs.of_role(Role::Validate) {
        let samples = [MotionSamples::of_recording(logs, trained.model, log, &settings.motion)?];
        let rows = samples[0].instants(INSTANTS);
        if repeats_motion(trained.rows, &rows, &settings.held_out) {
            found.repeated_motions.push(log);
        }
        let lag_search = LagSearch::new(robot, &samples, trained.compensated_s.to_vec(), settings);
        let (mut payload, mut hypothesis) = (None, None);
        for theta in trained.theta.into_iter().chain([&trained.as_written.parameters[..]]) {
            let known = KnownRobot { robot, theta, left: &trained.as_written.left, settings };
            payload = unmodelled_payload(robot, &rows, log, theta, &settings.held_out);
            hypothesis = held_out_hypothesis(known, &rows, lag_search.as_ref(), log);
            if let (Some(with), Some(without)) = (&payload, &hypothesis) {
                if with.left_with < without.left_without { hypothesis = None } else { payload = None }
            }
            if payload.is_none() && hypothesis.is_none() {
                break;
            }
        }
        let left = payload.as_ref().map(|payload| payload.left_with);
        let left = left.or(hypothesis.as_ref().map(|hypothesis| hypothesis.left_without));
        let Some(left) = left else { continue };
        if left_of_one_robot(&rows, trained)? > settings.held_out.max_ratio_of_one_robot * left {
            found.payloads.extend(payload);
            found.hypotheses.extend(hypothesis);
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
