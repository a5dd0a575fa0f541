//! Repetition of the fit with a lower cut-off of the positions, after `auto` selected instrumental variables.

use crate::error::IdentificationError;
use crate::estimators::{Estimation, Estimator, InstrumentSettings, NoiseInRegressor, estimate};
use crate::friction::JointFriction;
use crate::settings::IdentificationSettings;
use crate::task::IdentificationTask;
use crate::training::{Training, training_rows};
use dynident_dynamics::ParametricModel;
use dynident_estimation::EstimateStatus;
use dynident_rows::Logs;

/// Rows, estimate and settings, with the estimator that `auto` selected and the currently compensated lag.
pub(crate) struct Fit<'a> {
    pub(crate) logs: Logs<'a>,
    pub(crate) training: Training,
    pub(crate) estimation: Estimation,
    pub(crate) settings: IdentificationSettings,
}

/// Reason for keeping the stated friction if `auto` selected instrumental variables.
const NOISE_REASON: &str = "position noise biases the least squares that would select it";

/// Applies the estimator that `auto` selected; `robot` has the drive inertia that resulted from the test. If `auto`
/// selected instrumental variables and the cut-off is automatic, rows and estimate are computed again, with the stated
/// friction and a cut-off that passes less noise to the regressor. Least squares, held-out errors and lags are then not
/// dominated by noise.
pub(crate) fn with_less_noise<'a>(
    task: &'a IdentificationTask,
    robot: &ParametricModel,
    chosen: &[usize],
    mut found: Fit<'a>,
) -> Result<Fit<'a>, IdentificationError> {
    let Some((cutoff_hz, noise)) = take_estimator(&mut found) else { return Ok(found) };
    let IdentificationTask { recordings, payloads, .. } = task;
    let thresholds = found.settings.thresholds.cutoff;
    let lower_hz = thresholds.instruments_ratio * cutoff_hz;
    let before_hz = found.logs.motion.differentiator.cutoff_hz();
    let is_lower = found.settings.motion.differentiator.wants_cutoff()
        && before_hz.is_some_and(|before_hz| lower_hz < thresholds.max_lowered_ratio * before_hz);
    if !is_lower && found.training.friction_choice.is_empty() {
        return Ok(found);
    }
    let (logs, before) = if is_lower {
        // There is only noise above the lower cut-off, so held-out errors are for the frequency band below it.
        let execution = found.logs.execution;
        let lower =
            Logs::new(robot.model(), recordings, found.settings.row_settings(), chosen, Some(lower_hz), execution)?;
        (lower, Some(found.logs))
    } else {
        (found.logs, None)
    };
    // The previous friction was selected by least squares, which the noise biases.
    let as_stated = |joint: &JointFriction| JointFriction::as_stated(&joint.joint, NOISE_REASON);
    let friction_choice = found.training.friction_choice.iter().map(as_stated).collect();
    let training = training_rows(&logs, &found.settings, robot.clone().into(), chosen, payloads, None)?;
    let training = Training { friction_choice, ..training };
    let mut estimation = estimate(&training.rows(&logs, &found.settings, chosen), None)?;
    if let Some(again) = &mut estimation.noise_in_regressor {
        if again.instruments.weak || estimation.estimate.status == EstimateStatus::IterationLimit {
            return Ok(Fit { logs: before.unwrap_or(logs), ..found });
        }
        // The verdict belongs to the rows in which the noise was detected.
        (again.verdict, again.fast_motion, again.hausman) = (noise.verdict, noise.fast_motion, noise.hausman);
        (again.least_squares, again.instruments_taken) = (noise.least_squares, true);
        again.cutoff_before_hz = before_hz.filter(|_| is_lower);
    }
    Ok(Fit { logs, training, estimation, settings: found.settings })
}

/// Stores the estimator that `auto` selected in the settings. If it is instrumental variables, returns the cut-off of
/// the instruments, hertz, and the findings about noise.
pub(crate) fn take_estimator(found: &mut Fit<'_>) -> Option<(f64, NoiseInRegressor)> {
    let Estimator::Auto(own) = found.settings.estimation.estimator.clone() else { return None };
    let noise = found.estimation.noise_in_regressor.as_ref().filter(|noise| noise.instruments_taken);
    let taken = noise.and_then(|noise| Some((noise.instrument_cutoff_hz?[1], noise.clone())));
    found.settings.estimation.estimator = match &taken {
        Some((cutoff_hz, _)) => Estimator::Instrumental(InstrumentSettings { cutoff_hz: Some(*cutoff_hz), ..own }),
        None => Estimator::Weighted,
    };
    taken
}
