//! What held-out logs alone have: a load, or a mistake.

use super::error::DiagnosisError;
use super::explanation::{Explanation, predicted};
use super::held_out_reading::{HeldOutReading, held_out_reading};
use super::motion_rows::{INSTANTS, MotionRows, MotionSamples};
use super::reading::Reading;
use super::torque_clock::TorqueClock;
use super::unseen_load::{UnseenLoad, unseen_load};
use crate::consistent::ConsistencySettings;
use crate::logs::Logs;
use crate::recording::Role;
use crate::regressor_model::RegressorModel;

/// Times what a load or a mistake leaves of a log that one robot for all logs may leave: then there is neither.
const AS_WELL: f64 = 1.3;

/// What was found in held-out logs.
#[derive(Clone, Debug, Default)]
pub(super) struct HeldOutLogs {
    /// Loads that they carry and training logs do not, or the other way round.
    pub(super) unseen_loads: Vec<UnseenLoad>,
    /// Mistakes that they alone have.
    pub(super) readings: Vec<HeldOutReading>,
}

/// What is known of the training logs.
pub(super) struct Trained<'a> {
    /// Their instants.
    pub(super) rows: &'a MotionRows,
    /// The study as written, on these.
    pub(super) reading: &'a Reading,
    /// Base parameters by least squares from all their rows; none where the model is not the study's.
    pub(super) known: Option<&'a [f64]>,
    /// How consistent robots are looked for.
    pub(super) consistency: &'a ConsistencySettings,
}

/// Asks every held-out log whether the parameters of the training logs explain it: those that a robot can have
/// ([`Reading::parameters`]), for others predict nothing where the training did not move, and those of all rows. Where
/// they do not, and no robot explains all logs as well, the load or the mistake that does is what the log has.
/// `taken_off_s` is the lag that each joint's torque was freed of.
///
/// # Errors
/// Recordings that cannot be read, too few rows.
pub(super) fn held_out_logs(
    (logs, taken_off_s): (&Logs<'_>, &[f64]),
    model: &RegressorModel,
    trained: &Trained<'_>,
) -> Result<HeldOutLogs, DiagnosisError> {
    let mut found = HeldOutLogs::default();
    for log in logs.of_role(Role::Validate) {
        let samples = [MotionSamples::of_recording(logs, model, log)?];
        let rows = samples[0].instants(INSTANTS);
        let clock = TorqueClock::new(&model.parametric, &samples, taken_off_s.to_vec());
        let mut of_log = (None, None);
        for theta in trained.known.into_iter().chain([&trained.reading.parameters[..]]) {
            of_log = of_one(model, (&rows, clock.as_ref()), log, (theta, &trained.reading.left));
            if of_log == (None, None) {
                break;
            }
        }
        let left_without = of_log.0.as_ref().map(|load| load.left_with);
        let left_without = left_without.or(of_log.1.as_ref().map(|reading| reading.left_without));
        let Some(left_without) = left_without else { continue };
        if left_of_one_robot(model, &rows, trained)? > AS_WELL * left_without {
            found.unseen_loads.extend(of_log.0);
            found.readings.extend(of_log.1);
        }
    }
    Ok(found)
}

/// Root mean square of what the best robot for the training logs and this one leaves of this one's torque, Nm, joints
/// stacked.
fn left_of_one_robot(model: &RegressorModel, rows: &MotionRows, trained: &Trained<'_>) -> Result<f64, DiagnosisError> {
    let mut all = trained.rows.clone();
    all.append(rows);
    let together = Explanation::new(&model.parametric, &all, Some(trained.consistency))?;
    let explained = predicted(&model.parametric, rows, together.parameters());
    let left = rows.tau.iter().zip(&explained).flat_map(|(tau, by)| tau.iter().zip(by).map(|(tau, by)| tau - by));
    let count = (rows.len() * rows.tau.len()).max(1) as f64;
    Ok((left.map(|left| left * left).sum::<f64>() / count).sqrt())
}

/// The load or the mistake that explains one log.
fn of_one(
    model: &RegressorModel,
    (rows, clock): (&MotionRows, Option<&TorqueClock<'_>>),
    log: usize,
    known: (&[f64], &[f64]),
) -> (Option<UnseenLoad>, Option<HeldOutReading>) {
    let robot = &model.parametric;
    let load = unseen_load(robot, rows, log, known.0);
    let reading = held_out_reading(robot, (rows, clock), log, known);
    // What leaves less explains it: a load has four free numbers, a mistake hardly any.
    let (with, without) = (load.as_ref().map(|load| load.left_with), reading.as_ref().map(|r| r.left_without));
    match with.zip(without) {
        Some((with, without)) if with < without => (load, None),
        Some(_) => (None, reading),
        None => (load, reading),
    }
}
