//! Decision about the lag that is compensated before friction is selected.
//!
//! The selection of friction takes most of the time, so the lag is first estimated with friction terms whose constants
//! are on a grid. Friction that is selected from rows with a lag can compensate this lag, above all Maxwell-slip
//! friction, which responds with a delay. Conversely, friction that the stated terms do not contain looks like a lag.
//! Therefore there are two cases. A lag that is significant with all friction terms is estimated with friction without
//! hysteresis. A lag that is significant only with the stated terms is accepted if it lowers the Bayesian information
//! criterion of the fit with all terms.

use super::choices::FrictionChoice;
use super::cutoff::Cutoff;
use super::decision::{Decision, Next, decide_all};
use super::drive_inertia::DriveInertia;
use super::grid_friction::GridOfFriction;
use super::lag::{Lag, free_lag};
use super::workspace::Workspace;
use crate::chosen_friction::{GridTerms, is_friction_open, stated_friction};
use crate::error::IdentificationError;
use crate::lag::{LagCandidates, LagRounds};
use crate::likelihood::bic;
use crate::training::TrainingPasses;

pub(super) struct LagBeforeFriction;

const ALL_TERMS: [&dyn Decision; 3] = [&DriveInertia, &Cutoff, &GridOfFriction(GridTerms::All)];
const WITHOUT_MEMORY: [&dyn Decision; 4] = [&DriveInertia, &Cutoff, &GridOfFriction(GridTerms::WithoutMemory), &Lag];

impl Decision for LagBeforeFriction {
    fn decide(&self, work: &mut Workspace<'_, '_>) -> Result<Next, IdentificationError> {
        if work.choices.has_lag_before_friction || !is_friction_open(&work.settings, &work.task.robot) {
            return Ok(Next::Proceed);
        }
        let mut without_lag = work.trial(work.choices.clone());
        decide_all(&ALL_TERMS, &mut without_lag)?;
        let is_seen = shows_lag(&mut without_lag)?;
        let has_lag = is_seen || {
            let mut stated = without_lag.trial(without_lag.choices.with_open_friction());
            let logs = stated.logs_at(stated.choices.cutoff().map(|choice| choice.cutoff_hz))?;
            let passes = TrainingPasses::of_logs(&logs, &stated.settings, stated.training, &stated.task.payloads);
            let friction = stated_friction(&passes, &stated.drives().robot)?;
            stated.choices.friction = FrictionChoice::Made(friction);
            let shows = shows_lag(&mut stated)?;
            work.logs_s += stated.logs_s;
            shows
        };
        work.logs_s += without_lag.logs_s;
        if !has_lag {
            work.adopt(without_lag);
            return Ok(Next::Proceed);
        }

        // Revise the common lag with friction without hysteresis until the remaining lag is not significant. Different
        // lags of single joints can only be estimated with the final friction.
        let candidates = work.settings.lags;
        let common = without_lag.choices.with_open_friction().with_lag(LagRounds::of(LagCandidates::Common));
        let mut with_lag = without_lag.trial(common);
        decide_all(&WITHOUT_MEMORY, &mut with_lag)?;
        with_lag.choices.lag = LagRounds::of(candidates).after(with_lag.choices.lag.clone().choice());
        work.logs_s += with_lag.logs_s;
        if is_seen {
            with_lag.choices.friction = FrictionChoice::Open;
            work.adopt(with_lag);
            return Ok(Next::Proceed);
        }
        let mut with_lag = with_lag.trial(with_lag.choices.with_open_friction());
        decide_all(&ALL_TERMS, &mut with_lag)?;
        let is_better = criterion(&mut with_lag)? < criterion(&mut without_lag)?;
        work.logs_s += with_lag.logs_s;
        work.adopt(if is_better { with_lag } else { without_lag });
        Ok(Next::Proceed)
    }
}

/// Whether the rows of the fit have a significant lag that is common to all joints.
fn shows_lag(work: &mut Workspace<'_, '_>) -> Result<bool, IdentificationError> {
    let training = work.training;
    let fit = work.fit()?;
    let lags = free_lag(fit, training)?;
    Ok(LagRounds::of(LagCandidates::Common).again(lags.as_ref(), &fit.estimation.estimate))
}

fn criterion(work: &mut Workspace<'_, '_>) -> Result<f64, IdentificationError> {
    let fit = work.fit()?;
    Ok(bic(&fit.training.problem, &fit.estimation.estimate))
}
