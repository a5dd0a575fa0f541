//! Friction and the cut-off at which it is chosen.
//!
//! Friction has details above the motion's band, so it is chosen at the highest cut-off that serves the parameters. But
//! that cut-off is predicted with the friction that a study begins with, whose wide step does not mind noise of the
//! velocity. With the friction that was found the prediction can be another: noise smears a narrow step, and terms that
//! nobody has make up for it. So where the fit then asks for a lower cut-off and the noise is more than a small part of
//! a step's width, or for a clearly higher one, friction is chosen there as well, and on the rows of that cut-off the
//! one counts that says most of them with the fewest numbers (Schwarz, Annals of Statistics 6 (1978) 461).

use super::choice::{ChosenFriction, friction_of_logs, friction_score};
use crate::bandwidth::{CutoffByError, choose_cutoff};
use crate::error::IdentificationError;
use crate::friction::smooth_width;
use crate::logs::{LogSpectrum, Logs};
use crate::payload::Payload;
use crate::settings::IdentificationSettings;
use dynident_dynamics::ParametricModel;

/// Cut-offs closer than this are one: they are tried in steps of √2.
const APART: f64 = 1.2;
/// Noise of the velocity that is less than this part of a step's width does not smear it: it widens a smooth step by
/// half the square of this part.
const SMEARED: f64 = 0.05;

/// Friction that the recordings choose at the highest cut-off that serves the parameters by `before`, a prediction with
/// the friction that a study begins with; that cut-off, and the one for a fit with the friction.
///
/// Friction that the study's terms do not have counts as noise in that prediction, which then asks for less than the
/// friction is told by. So where the prediction with the friction that was found goes higher, friction is chosen there
/// as well, and counts where it says more of these rows (Schwarz).
///
/// # Errors
/// As [`friction_with_cutoff`].
pub(crate) fn friction_by_cutoffs(
    (logs, settings): (&Logs<'_>, &IdentificationSettings),
    robot: &ParametricModel,
    places: (&[usize], &[Payload]),
    before: Option<&CutoffByError>,
) -> Result<(Option<f64>, Option<CutoffByError>, ChosenFriction), IdentificationError> {
    let at_hz = before.map(CutoffByError::highest_alike_hz);
    let (cutoff, friction) = friction_with_cutoff((logs, settings), robot, places, at_hz)?;
    let higher_hz = cutoff.as_ref().map(CutoffByError::highest_alike_hz);
    let Some((low_hz, high_hz)) = at_hz.zip(higher_hz).filter(|(low_hz, high_hz)| *high_hz > APART * low_hz) else {
        return Ok((at_hz, cutoff, friction));
    };
    if friction.joints.is_empty() || is_smeared(logs, &friction, high_hz) {
        return Ok((Some(low_hz), cutoff, friction));
    }
    Ok(match better_friction_at((logs, settings), robot, places, (&friction, high_hz))? {
        Some((of_other, other)) => (Some(high_hz), of_other, other),
        None => (Some(low_hz), cutoff, friction),
    })
}

/// Friction that the recordings `training` choose at the cut-off `at_hz` (of the logs where there is none), and the
/// cut-off for a fit with it.
///
/// # Errors
/// Recordings that cannot be read, rows that do not carry an estimate.
fn friction_with_cutoff(
    (logs, settings): (&Logs<'_>, &IdentificationSettings),
    robot: &ParametricModel,
    (training, payloads): (&[usize], &[Payload]),
    at_hz: Option<f64>,
) -> Result<(Option<CutoffByError>, ChosenFriction), IdentificationError> {
    let logs = logs.clone().with_chosen_cutoff(&settings.motion, at_hz);
    let of_constants = logs.with_torque_beyond_motion(&robot.clone().into())?;
    let friction = friction_of_logs((&logs, &of_constants), settings, robot, (training, payloads))?;
    Ok((choose_cutoff((&logs, settings), &friction.model, training)?, friction))
}

/// The friction that the recordings choose at the cut-off of the fit, where they chose `friction` at a higher one,
/// `high_hz`, whose noise smears it, and where the other says more of the rows; with its own cut-off.
///
/// # Errors
/// As [`friction_with_cutoff`].
pub(crate) fn friction_of_less_noise(
    (logs, settings): (&Logs<'_>, &IdentificationSettings),
    robot: &ParametricModel,
    places: (&[usize], &[Payload]),
    (friction, low_hz, high_hz): (&ChosenFriction, f64, f64),
) -> Result<Option<(Option<CutoffByError>, ChosenFriction)>, IdentificationError> {
    if APART * low_hz > high_hz || friction.joints.is_empty() || !is_smeared(logs, friction, high_hz) {
        return Ok(None);
    }
    better_friction_at((logs, settings), robot, places, (friction, low_hz))
}

/// The friction that the recordings choose at the cut-off `at_hz`, with the cut-off for a fit with it, where it says
/// more of the rows there than `friction` (Schwarz).
fn better_friction_at(
    (logs, settings): (&Logs<'_>, &IdentificationSettings),
    robot: &ParametricModel,
    places: (&[usize], &[Payload]),
    (friction, at_hz): (&ChosenFriction, f64),
) -> Result<Option<(Option<CutoffByError>, ChosenFriction)>, IdentificationError> {
    let logs = logs.clone().with_chosen_cutoff(&settings.motion, Some(at_hz));
    let (cutoff, other) = friction_with_cutoff((&logs, settings), robot, places, None)?;
    let rows = logs.with_torque_beyond_motion(&robot.clone().into())?;
    let score = |friction: &ChosenFriction| friction_score((&rows, settings), robot, friction, places);
    Ok((score(&other)? < score(friction)?).then_some((cutoff, other)))
}

/// Whether noise of the positions behind a low-pass at `cutoff_hz` makes noise of the velocity that smears the
/// narrowest smooth step: white noise of σ has `σ 2π √(2 f³ / 3 rate)` there. What is smeared does not look dry.
fn is_smeared(logs: &Logs<'_>, friction: &ChosenFriction, cutoff_hz: f64) -> bool {
    let widths = friction.joints.iter().flat_map(|joint| joint.terms.iter().flatten()).filter_map(smooth_width);
    let narrowest = widths.fold(f64::INFINITY, f64::min);
    let noise = |log: &LogSpectrum| {
        let of_position = log.position_noise.iter().copied().fold(0.0, f64::max);
        of_position * core::f64::consts::TAU * (2.0 * cutoff_hz.powi(3) / (3.0 * log.rate_hz)).sqrt()
    };
    logs.spectra().iter().map(noise).fold(0.0, f64::max) > SMEARED * narrowest
}
