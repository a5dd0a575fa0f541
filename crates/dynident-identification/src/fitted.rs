//! From recordings to an estimate, with the torque's lag among the unknowns: fits until the rows show none.

use crate::bars::ErrorSource;
use crate::between_logs::variation_of_logs;
use crate::chosen_friction::{ChosenFriction, GridTerms, OtherFriction, friction_of_other_cutoff};
use crate::error::IdentificationError;
use crate::excerpt::excerpts;
use crate::execution::Execution;
use crate::friction::ConstantsError;
use crate::lag::{LagCandidates, LagChoice, LagFit, LagKind, LagRounds, gain_errors, lag_fit};
use crate::likelihood::schwarz;
use crate::one_fit::{Choices, Fitted, Job, Known, StageTimes, fitted_once};
use crate::payload::{Payload, free_gains};
use crate::recording::Recording;
use crate::settings::{GainChoice, IdentificationSettings};
use crate::task::IdentificationTask;
use crate::training::TrainingPasses;
use dynident_recording::log::OneOrMany;
use std::sync::Arc;
use std::time::Instant;

/// Rows and estimate, with the lag of the torque, what varies between logs and the constants of chosen friction in its
/// error bars.
pub(crate) fn fitted<'a>(
    task: &'a IdentificationTask,
    chosen: &[usize],
    execution: Execution<'a>,
    job: &mut Job<'_, '_>,
) -> Result<Fitted<'a>, IdentificationError> {
    let is_model = job.arm().is_none();
    let mut found = match choices_of_excerpt(task, chosen, execution, job)? {
        Some((choices, excerpts)) => {
            let mut found = with_choices(task, &choices, chosen, execution)?;
            found.logs = found.logs.with_excerpts(Arc::new(excerpts));
            found
        }
        None => without_lag(task, chosen, execution, job)?,
    };
    if is_model && found.settings.estimation.estimator.reads_filtered_rows() {
        let weighted = found.settings.estimation.weighted();
        let variation = variation_of_logs(&found.training, &weighted, &found.estimation.estimate);
        let (covariance, between_logs) = variation.unzip();
        found.bars = found.bars.with(ErrorSource::BetweenLogs, covariance);
        found.between_logs = between_logs;
    }
    let of_columns =
        |error: &ConstantsError| error.covariance_of(found.training.problem.columns(), &found.estimation.estimate);
    let covariance = found.constants_error.as_ref().map(of_columns);
    found.bars = found.bars.with(ErrorSource::FrictionConstants, covariance);
    Ok(found)
}

/// What an [excerpt](crate::excerpt) of long recordings chooses, and the excerpt; none where they are not long, and
/// where instruments from outside or an arm that is known leave little to choose.
fn choices_of_excerpt(
    task: &IdentificationTask,
    chosen: &[usize],
    execution: Execution<'_>,
    job: &Job<'_, '_>,
) -> Result<Option<(Choices, Vec<Recording>)>, IdentificationError> {
    let IdentificationTask { robot, recordings, payloads, settings } = task;
    if !job.is_plain() || settings.gains == GainChoice::Unknown {
        return Ok(None);
    }
    let started = Instant::now();
    let Some(recordings) = excerpts(recordings, settings, chosen, execution)? else { return Ok(None) };
    let read_s = started.elapsed().as_secs_f64();
    let (robot, payloads, settings) = (robot.clone(), payloads.clone(), settings.clone());
    let task = IdentificationTask { robot, recordings, payloads, settings };
    // What is wrong with recordings, or too little in them, their whole says.
    let Ok(found) = without_lag(&task, chosen, execution, &mut Job::Model(None)) else { return Ok(None) };
    let (model, joints) = found.friction;
    let choices = Choices {
        robot: found.robot,
        drive_inertia: found.drive_inertia,
        motion_hz: found.logs.motion_hz(),
        cutoff: found.cutoff,
        friction: ChosenFriction {
            model,
            joints,
            stated: found.stated_friction,
            constants_error: found.constants_error,
        },
        is_of_excerpt: true,
        lag: found.lag,
        times: StageTimes { logs_s: found.times.logs_s + read_s, ..found.times },
    };
    Ok(Some((choices, task.recordings)))
}

/// Rows and estimate of all rows with what an excerpt of them chose; of the lag and of the constants of friction what
/// they show beyond that.
fn with_choices<'a>(
    task: &'a IdentificationTask,
    choices: &Choices,
    chosen: &[usize],
    execution: Execution<'a>,
) -> Result<Fitted<'a>, IdentificationError> {
    let mut settings = task.settings.clone();
    let mut rounds = LagRounds::of(settings.lags);
    if settings.motion.torque_lag_s.is_none() {
        settings.motion.torque_lag_s = choices.lag.taken_off();
        rounds = rounds.after(choices.lag.clone());
    }
    let start = LagStart::of(settings, rounds);
    let mut found = lag_rounds(task, start, chosen, Some(choices), execution, &mut Job::Model(None))?;
    found.times = found.times.and(&choices.times);
    Ok(found)
}

/// Rows and estimate; where the rows show a lag of the torque that moves parameters, again without it.
fn without_lag<'a>(
    task: &'a IdentificationTask,
    chosen: &[usize],
    execution: Execution<'a>,
    job: &mut Job<'_, '_>,
) -> Result<Fitted<'a>, IdentificationError> {
    let settings = &task.settings;
    let is_free = settings.motion.torque_lag_s.is_none() && job.is_plain();
    let start = if is_free && !settings.friction.is_empty() {
        best_start(task, chosen, execution, job)?
    } else {
        LagStart::of(settings.clone(), LagRounds::of(settings.lags))
    };
    lag_rounds(task, start, chosen, None, execution, job)
}

/// Where the rounds begin that take off the lag.
struct LagStart<'a> {
    /// With the lag that is taken off from the beginning.
    settings: IdentificationSettings,
    rounds: LagRounds,
    /// A fit with friction of a grid to rows with that lag taken off, where there was one.
    first_look: Option<Fitted<'a>>,
    times: StageTimes,
}

impl<'a> LagStart<'a> {
    fn of(settings: IdentificationSettings, rounds: LagRounds) -> Self {
        Self { settings, rounds, first_look: None, times: StageTimes::default() }
    }

    /// The start after looks for a common lag beside friction without memory, until there is none that moves
    /// parameters: lags of single joints are told only beside friction that is chosen whole. `without_lag` is a fit to
    /// the same recordings.
    fn looked(
        task: &'a IdentificationTask,
        without_lag: &Fitted<'a>,
        chosen: &[usize],
        execution: Execution<'a>,
        job: &mut Job<'_, '_>,
    ) -> Result<Self, IdentificationError> {
        let mut settings = task.settings.clone();
        let mut rounds = LagRounds::of(LagCandidates::Common);
        let mut times = StageTimes::default();
        let mut alike = Some(without_lag);
        loop {
            let known = Known::Look(GridTerms::WithoutMemory, alike.take());
            let found = fitted_once(task, &settings, chosen, known, execution, job)?;
            times = times.and(&found.times);
            if !rounds.again(free_lag(&found, chosen)?.as_ref(), &found.estimation.estimate) {
                let rounds = LagRounds::of(task.settings.lags).after(rounds.choice());
                return Ok(Self { settings, rounds, first_look: Some(found), times });
            }
            settings.motion.torque_lag_s = rounds.torque_lag_s();
        }
    }

    /// The same start after a look beside friction of all terms.
    fn with_memory(
        self,
        task: &'a IdentificationTask,
        chosen: &[usize],
        execution: Execution<'a>,
        job: &mut Job<'_, '_>,
    ) -> Result<Self, IdentificationError> {
        let known = Known::Look(GridTerms::All, self.first_look.as_ref());
        let found = fitted_once(task, &self.settings, chosen, known, execution, job)?;
        let times = self.times.and(&found.times);
        Ok(Self { first_look: Some(found), times, ..self })
    }

    /// What the look says of the rows, the less the better.
    fn criterion(&self) -> f64 {
        let of = |found: &Fitted<'_>| schwarz(&found.training.problem, &found.estimation.estimate);
        self.first_look.as_ref().map_or(f64::INFINITY, of)
    }
}

/// Where to begin. Choosing friction is what takes time, so the lag is first looked for beside friction of a grid.
///
/// Friction that is chosen with a lag in the rows can make up for it, above all what remembers (Maxwell-slip), which is
/// late by itself; and friction that no stated term has looks like a lag. So a lag that is seen beside friction of all
/// terms counts as it is beside friction without memory. One that only the stated terms show counts where the rows say
/// more with it and friction of all terms than without it, with the fewest parameters ([`schwarz`]).
fn best_start<'a>(
    task: &'a IdentificationTask,
    chosen: &[usize],
    execution: Execution<'a>,
    job: &mut Job<'_, '_>,
) -> Result<LagStart<'a>, IdentificationError> {
    let settings = &task.settings;
    let none = LagStart::of(settings.clone(), LagRounds::of(settings.lags));
    let none = none.with_memory(task, chosen, execution, job)?;
    let Some(found) = &none.first_look else { return Ok(none) };
    let shows_lag = |found: &Fitted<'_>| -> Result<bool, IdentificationError> {
        let fit = free_lag(found, chosen)?;
        Ok(LagRounds::of(LagCandidates::Common).again(fit.as_ref(), &found.estimation.estimate))
    };
    let is_seen = shows_lag(found)?;
    let mut times = none.times;
    if !is_seen {
        let stated = IdentificationSettings { friction: Vec::new(), ..settings.clone() };
        let of_stated = fitted_once(task, &stated, chosen, Known::Alike(found), execution, job)?;
        times = times.and(&of_stated.times);
        if !shows_lag(&of_stated)? {
            return Ok(LagStart { times, ..none });
        }
    }
    let mut late = LagStart::looked(task, found, chosen, execution, job)?;
    if !is_seen {
        late = late.with_memory(task, chosen, execution, job)?;
    }
    let times = times.and(&late.times);
    let best = if is_seen || late.criterion() < none.criterion() { late } else { none };
    Ok(LagStart { times, ..best })
}

/// Fits from this start on, until the rows show no lag that moves parameters; with choices where they are made.
/// Friction is chosen at another cut-off only once the lag is off; then the lag is looked for once more.
fn lag_rounds<'a>(
    task: &'a IdentificationTask,
    start: LagStart<'a>,
    chosen: &[usize],
    choices: Option<&Choices>,
    execution: Execution<'a>,
    job: &mut Job<'_, '_>,
) -> Result<Fitted<'a>, IdentificationError> {
    let LagStart { mut settings, mut rounds, mut first_look, mut times } = start;
    let is_free = task.settings.motion.torque_lag_s.is_none() && job.is_plain();
    let mut is_other_cutoff_asked = choices.is_some() || !job.is_plain();
    let mut of_other_cutoff: Option<Choices> = None;
    loop {
        let known = match (choices.or(of_other_cutoff.as_ref()), &first_look) {
            (Some(choices), _) => Known::Choices(choices),
            (None, Some(found)) => Known::Alike(found),
            (None, None) => Known::Nothing,
        };
        let mut found = fitted_once(task, &settings, chosen, known, execution, job)?;
        first_look = None;
        times = times.and(&found.times);
        let started = Instant::now();
        let fit = if is_free { free_lag(&found, chosen)? } else { None };
        let again = rounds.again(fit.as_ref(), &found.estimation.estimate);
        times.estimation_s += started.elapsed().as_secs_f64();
        if again {
            settings.motion.torque_lag_s = rounds.torque_lag_s();
            continue;
        }
        if !core::mem::replace(&mut is_other_cutoff_asked, true) {
            let started = Instant::now();
            of_other_cutoff = choices_of_other_cutoff(&found, &task.payloads, chosen)?;
            times.estimation_s += started.elapsed().as_secs_f64();
            if of_other_cutoff.is_some() {
                continue;
            }
        }
        found.times = times;
        found.bars = found.bars.with(ErrorSource::Lag, rounds.error(fit.as_ref(), &found.estimation.estimate));
        found.lag = if is_free { rounds.choice() } else { stated_lag(&settings, found.training.model.dof()) };
        if let (Some(fit), Some((_, gains))) = (&fit, &mut found.training.gains) {
            for (joint, share) in free_gains(gains).into_iter().zip(gain_errors(fit, &found.lag)) {
                gains[joint].widen(share);
            }
        }
        return Ok(found);
    }
}

/// The same choices with friction of another cut-off; none where they stay.
fn choices_of_other_cutoff(
    found: &Fitted<'_>,
    payloads: &[Payload],
    chosen: &[usize],
) -> Result<Option<Choices>, IdentificationError> {
    let Fitted { logs, settings, robot, cutoff, friction: (model, joints), friction_hz, .. } = found;
    let (Some(cutoff), Some(chosen_hz)) = (cutoff, *friction_hz) else { return Ok(None) };
    let (model, joints) = (model.clone(), joints.clone());
    let friction = ChosenFriction { model, joints, ..ChosenFriction::as_stated(robot.clone().into()) };
    let Some(other) = friction_of_other_cutoff(
        &TrainingPasses::of_logs(logs, settings, chosen, payloads),
        robot,
        &friction,
        cutoff,
        chosen_hz,
    )?
    else {
        return Ok(None);
    };
    let OtherFriction { friction, cutoff: own } = other;
    let cutoff = own.unwrap_or_else(|| cutoff.clone());
    Ok(Some(Choices {
        robot: robot.clone(),
        drive_inertia: found.drive_inertia.clone(),
        motion_hz: Some(cutoff.motion_hz).filter(|motion_hz| *motion_hz != cutoff.cutoff_hz),
        cutoff: Some(cutoff),
        friction,
        is_of_excerpt: false,
        lag: LagChoice::default(),
        times: StageTimes::default(),
    }))
}

/// The lags of the joints beside the parameters, where they can be taken off.
fn free_lag(found: &Fitted<'_>, chosen: &[usize]) -> Result<Option<LagFit>, IdentificationError> {
    if !has_free_lag(found) {
        return Ok(None);
    }
    let Fitted { logs, training, estimation, settings, .. } = found;
    let gains = training.gains.as_ref().map_or(&[][..], |(_, gains)| gains);
    let values = &estimation.estimate.values;
    Ok(lag_fit(logs, settings, &training.model, &training.columns, values, gains, chosen)?)
}

/// A lag that the study states.
fn stated_lag(settings: &IdentificationSettings, dof: usize) -> LagChoice {
    let Some(stated) = &settings.motion.torque_lag_s else { return LagChoice::default() };
    let lag_s = match stated {
        OneOrMany::One(lag_s) => vec![*lag_s; dof],
        OneOrMany::Many(lags) => lags.clone(),
    };
    LagChoice { kind: LagKind::Stated, lag_s, ..LagChoice::default() }
}

/// Whether a lag can be taken off and tells of the robot: rows of all joints, by an estimator that noise of the
/// positions does not bias, for that biases the lag that is measured by it.
fn has_free_lag(found: &Fitted<'_>) -> bool {
    found.training.joints.len() == found.training.model.dof()
        && found.settings.estimation.estimator.reads_filtered_rows()
}
