//! Decision: friction at another cut-off.
//!
//! Friction has details above the band of the motion, so it is selected at the highest cut-off with nearly the smallest
//! parameter error. That cut-off is predicted with the stated friction, whose wide step is not sensitive to velocity
//! noise. With the selected friction the prediction can change: noise smears a narrow step, and other terms compensate
//! for it. Friction is therefore selected again, once, in two cases: at a lower cut-off if the velocity noise exceeds a
//! small ratio of the step width, or at a clearly higher cut-off. On the rows of that cut-off, each joint takes the
//! friction with the lower Bayesian information criterion (Schwarz, Annals of Statistics 6 (1978) 461). A lower cut-off
//! shows less, so terms that it adds need stronger evidence.

use super::choices::{Choices, FrictionChoice};
use super::decision::{Decision, Next};
use super::workspace::Workspace;
use crate::bandwidth::choose_cutoff;
use crate::chosen_friction::{ChosenFriction, better_friction, friction_of_logs};
use crate::error::IdentificationError;
use crate::friction::smooth_width;
use crate::less_noise::Fit;
use crate::thresholds::CutoffThresholds;
use crate::training::TrainingPasses;
use dynident_rows::{LogSpectrum, Logs};

pub(super) struct CutoffOfFriction;

impl Decision for CutoffOfFriction {
    fn decide(&self, work: &mut Workspace<'_, '_>) -> Result<Next, IdentificationError> {
        if core::mem::replace(&mut work.choices.has_cutoff_of_friction, true) {
            return Ok(Next::Proceed);
        }
        work.fit()?;
        let Some(fit) = &work.fit else { return Ok(Next::Proceed) };
        let (FrictionChoice::Made(friction), Some(before_hz)) = (&work.choices.friction, work.choices.friction_hz)
        else {
            return Ok(Next::Proceed);
        };
        let Some(other_hz) = other_cutoff_hz(fit, &work.choices, friction, before_hz) else {
            return Ok(Next::Proceed);
        };
        let robot = work.drives().robot;
        let Fit { logs, settings, .. } = fit;
        let logs = logs.clone().with_chosen_cutoff(&settings.motion, Some(other_hz));
        let rows = logs.with_torque_beyond_motion(&robot.clone().into())?;
        let passes = TrainingPasses::of_logs(&rows, settings, work.training, &work.task.payloads);
        let at_cutoff = TrainingPasses { logs: &logs, ..passes };
        let other = friction_of_logs(&at_cutoff, &rows, &robot, None)?;
        let found = better_friction(&passes, &robot, friction, other, other_hz < before_hz)?;
        let cutoff = choose_cutoff(&logs, settings, &found.model, work.training)?;
        if cutoff.is_some() {
            work.choices.cutoff_with_friction = cutoff;
        }
        work.choices.friction = FrictionChoice::Made(found);
        work.choices.finish();
        work.fit = None;
        Ok(Next::StartAgain)
    }
}

/// The cut-off at which friction is selected again, hertz. Friction was selected at `before_hz`.
fn other_cutoff_hz(fit: &Fit<'_>, choices: &Choices, friction: &ChosenFriction, before_hz: f64) -> Option<f64> {
    let cutoff = choices.cutoff()?;
    if friction.joints.is_empty() {
        return None;
    }
    let CutoffThresholds { min_friction_ratio, max_step_noise_ratio, .. } = fit.settings.thresholds.cutoff;
    let is_smeared = |cutoff_hz: f64| is_step_smeared(&fit.logs, friction, cutoff_hz, max_step_noise_ratio);
    let high_hz = cutoff.highest_alike_hz();
    if high_hz > min_friction_ratio * before_hz && !is_smeared(high_hz) {
        return Some(high_hz);
    }
    let is_lower = min_friction_ratio * cutoff.cutoff_hz <= before_hz;
    (is_lower && is_smeared(before_hz)).then_some(cutoff.cutoff_hz)
}

/// Whether position noise after a low-pass at `cutoff_hz` smears the narrowest smooth step. White noise of standard
/// deviation σ gives the velocity noise `σ 2π √(2 f³ / 3 rate)`.
fn is_step_smeared(logs: &Logs<'_>, friction: &ChosenFriction, cutoff_hz: f64, max_noise_ratio: f64) -> bool {
    let widths = friction.joints.iter().flat_map(|joint| joint.terms.iter().flatten()).filter_map(smooth_width);
    let narrowest = widths.fold(f64::INFINITY, f64::min);
    let noise = |log: &LogSpectrum| {
        let of_position = log.position_noise.iter().copied().fold(0.0, f64::max);
        of_position * core::f64::consts::TAU * (2.0 * cutoff_hz.powi(3) / (3.0 * log.rate_hz)).sqrt()
    };
    logs.spectra().iter().map(noise).fold(0.0, f64::max) > max_noise_ratio * narrowest
}
