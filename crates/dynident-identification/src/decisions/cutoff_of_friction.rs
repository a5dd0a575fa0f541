//! Decision whether friction is selected again at another cut-off.
//!
//! Fast changes of friction at reversals are above the frequency band of the motion. Friction is therefore selected at
//! the highest cut-off whose predicted parameter error is nearly the smallest. This prediction uses the friction that
//! the study states. Its smoothed sign of the velocity is wide, so it is not sensitive to velocity noise. With the
//! selected friction, the prediction can change: velocity noise blurs a narrow smoothed sign, and other terms
//! compensate for this. Friction is therefore selected again, once, in two cases: at a lower cut-off if the velocity
//! noise exceeds a small ratio of the width of the smoothed sign, or at a clearly higher cut-off. With the rows of that
//! cut-off, each joint gets the friction with the lower Bayesian information criterion (Schwarz, Annals of Statistics 6
//! (1978) 461). Rows at a lower cut-off contain less information, so terms that they add need stronger evidence.

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

/// Cut-off at which friction is selected again, hertz; `None` if it is not selected again. `before_hz` is the cut-off
/// of the first selection.
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

/// Whether position noise after a low-pass at `cutoff_hz` blurs the narrowest smoothed sign of the friction. White
/// position noise of standard deviation σ causes the velocity noise `σ 2π √(2 f³ / 3 rate)` with the cut-off f and the
/// sample rate.
fn is_step_smeared(logs: &Logs<'_>, friction: &ChosenFriction, cutoff_hz: f64, max_noise_ratio: f64) -> bool {
    let widths = friction.joints.iter().flat_map(|joint| joint.terms.iter().flatten()).filter_map(smooth_width);
    let narrowest = widths.fold(f64::INFINITY, f64::min);
    let noise = |log: &LogSpectrum| {
        let of_position = log.position_noise.iter().copied().fold(0.0, f64::max);
        of_position * core::f64::consts::TAU * (2.0 * cutoff_hz.powi(3) / (3.0 * log.rate_hz)).sqrt()
    };
    logs.spectra().iter().map(noise).fold(0.0, f64::max) > max_noise_ratio * narrowest
}
