//! Friction and the cut-off at which it is chosen.
//!
//! Friction has details above the motion's band, so it is chosen at the highest cut-off that serves the parameters. But
//! that cut-off is predicted with the friction that a study begins with, whose wide step does not mind noise of the
//! velocity. With the friction that was found the prediction can be another: noise smears a narrow step, and terms that
//! nobody has make up for it. So where the fit then asks for a lower cut-off and the noise is more than a small part of
//! a step's width, or for a clearly higher one, friction is chosen there as well, and on the rows of that cut-off joint
//! by joint the one counts that says most of them with the fewest numbers (Schwarz, Annals of Statistics 6 (1978) 461):
//! what smears the friction of one joint is no reason to doubt another's. A lower cut-off shows less, and what it adds
//! has to be seen more clearly.

use super::choice::{ChosenFriction, GridFriction, better_friction, friction_of_logs};
use crate::bandwidth::{CutoffByError, choose_cutoff};
use crate::error::IdentificationError;
use crate::friction::smooth_width;
use crate::logs::{LogSpectrum, Logs};
use crate::payload::Payload;
use crate::settings::IdentificationSettings;
use crate::training::TrainingPasses;
use dynident_dynamics::ParametricModel;

/// Cut-offs closer than this are one: they are tried in steps of √2.
const APART: f64 = 1.2;
/// Noise of the velocity that is less than this part of a step's width does not smear it: it widens a smooth step by
/// half the square of this part.
const SMEARED: f64 = 0.05;

/// Friction that the recordings `training` choose at the cut-off `at_hz` (of the logs where there is none), and the
/// cut-off for a fit with it. Its terms are those of a grid where they were found before.
///
/// # Errors
/// Recordings that cannot be read, rows that do not carry an estimate.
pub(crate) fn friction_with_cutoff(
    logs: &Logs<'_>,
    settings: &IdentificationSettings,
    robot: &ParametricModel,
    training: &[usize],
    payloads: &[Payload],
    at_hz: Option<f64>,
    of_grid: Option<GridFriction>,
) -> Result<(Option<CutoffByError>, ChosenFriction), IdentificationError> {
    let logs = logs.clone().with_chosen_cutoff(&settings.motion, at_hz);
    let of_constants = logs.with_torque_beyond_motion(&robot.clone().into())?;
    let friction = friction_of_logs(&logs, &of_constants, settings, robot, training, payloads, of_grid)?;
    Ok((choose_cutoff(&logs, settings, &friction.model, training)?, friction))
}

/// The friction that the recordings choose at another cut-off than `at_hz`, where they chose `friction` and then
/// `cutoff` for the fit: of the joints where the other says more of the rows there; with its own cut-off.
///
/// Friction that the study's terms do not have counts as noise in the prediction that `at_hz` comes from, which then
/// asks for less than the friction is told by. So where the prediction with the friction that was found goes higher,
/// the other is chosen there; where `at_hz` lies above the cut-off of the fit and its noise smears the friction, at
/// that cut-off.
///
/// # Errors
/// As [`friction_with_cutoff`].
pub(crate) fn friction_of_other_cutoff(
    passes: &TrainingPasses<'_>,
    robot: &ParametricModel,
    friction: &ChosenFriction,
    cutoff: &CutoffByError,
    at_hz: f64,
) -> Result<Option<OtherFriction>, IdentificationError> {
    let TrainingPasses { logs, settings, training, payloads, .. } = *passes;
    let high_hz = cutoff.highest_alike_hz();
    let other_hz = if friction.joints.is_empty() {
        None
    } else if high_hz > APART * at_hz && !is_smeared(logs, friction, high_hz) {
        Some(high_hz)
    } else if APART * cutoff.cutoff_hz <= at_hz && is_smeared(logs, friction, at_hz) {
        Some(cutoff.cutoff_hz)
    } else {
        None
    };
    let Some(other_hz) = other_hz else { return Ok(None) };
    let logs = logs.clone().with_chosen_cutoff(&settings.motion, Some(other_hz));
    let rows = logs.with_torque_beyond_motion(&robot.clone().into())?;
    let other = friction_of_logs(&logs, &rows, settings, robot, training, payloads, None)?;
    let passes = TrainingPasses::of_logs(&rows, settings, training, payloads);
    let friction = better_friction(&passes, robot, friction, other, other_hz < at_hz)?;
    let cutoff = choose_cutoff(&logs, settings, &friction.model, training)?;
    Ok(Some(OtherFriction { friction, cutoff }))
}

/// Friction by the rows of another cut-off.
pub(crate) struct OtherFriction {
    pub(crate) friction: ChosenFriction,
    /// For a fit with it.
    pub(crate) cutoff: Option<CutoffByError>,
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
