//! From recordings to an estimate: drives, cut-off, friction, factors, parameters, with the torque's lag among the
//! unknowns.

use crate::bandwidth::{CutoffByError, choose_cutoff};
use crate::between_logs::{BetweenLogs, with_variation};
use crate::chosen_friction::{
    ChosenFriction, choose_friction, constants_of_all_rows, friction_by_cutoffs, friction_of_less_noise,
};
use crate::drive_inertia::{DriveInertiaChoice, choose_drive_inertia};
use crate::error::IdentificationError;
use crate::estimators::{Estimation, InstrumentSource, estimate};
use crate::excerpt::excerpts;
use crate::execution::Execution;
use crate::friction::{ConstantsError, JointFriction};
use crate::lag::{LagCandidates, LagChoice, LagFit, LagKind, LagRounds, gain_errors, lag_fit};
use crate::less_noise::{Estimated, with_less_noise};
use crate::likelihood::schwarz;
use crate::logs::Logs;
use crate::payload::{KnownArm, Payload, free_gains};
use crate::regressor_model::RegressorModel;
use crate::settings::{GainChoice, IdentificationSettings};
use crate::task::IdentificationTask;
use crate::training::{Training, training_rows};
use dynident_dynamics::ParametricModel;
use dynident_estimation::Estimate;
use dynident_recording::MotionSettings;
use dynident_recording::log::OneOrMany;
use std::time::Instant;

/// Where the time went, seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageTimes {
    /// From logs to factors.
    pub logs_s: f64,
    /// From factors to parameters.
    pub estimation_s: f64,
    /// Delays, traces and held-out recordings.
    pub examination_s: f64,
}

impl StageTimes {
    /// The sum of both.
    fn and(&self, other: &Self) -> Self {
        Self {
            logs_s: self.logs_s + other.logs_s,
            estimation_s: self.estimation_s + other.estimation_s,
            examination_s: self.examination_s + other.examination_s,
        }
    }
}

/// What is looked for.
pub(crate) enum Job<'a, 's> {
    Model(Option<&'s mut dyn InstrumentSource>),
    Payload(&'a KnownArm),
}

impl Job<'_, '_> {
    pub(crate) fn arm(&self) -> Option<&KnownArm> {
        match self {
            Self::Model(_) => None,
            Self::Payload(arm) => Some(arm),
        }
    }

    /// A model without instruments from outside, which can be fitted more than once.
    fn is_plain(&self) -> bool {
        matches!(self, Self::Model(None))
    }
}

/// Rows and estimate, and what was chosen on the way.
pub(crate) struct Fitted<'a> {
    pub(crate) logs: Logs<'a>,
    pub(crate) training: Training,
    pub(crate) estimation: Estimation,
    /// The task's, with the estimator that `auto` took and the lag that was taken off.
    pub(crate) settings: IdentificationSettings,
    pub(crate) cutoff: Option<CutoffByError>,
    /// The task's robot, with the drive inertia that was seen and friction as stated.
    pub(crate) robot: ParametricModel,
    /// Whether drive inertia was seen; none where terms state it.
    pub(crate) drive_inertia: Option<DriveInertiaChoice>,
    /// Rows and fit with friction as stated, where it was chosen.
    pub(crate) stated_friction: Option<(Training, Estimate)>,
    /// The model with the friction that was chosen, whatever noise made of it afterwards, and how it was chosen.
    friction: (RegressorModel, Vec<JointFriction>),
    /// The cut-off at which it was chosen, where the data chose both.
    friction_hz: Option<f64>,
    /// The cut-off that was chosen here before friction.
    before_friction: Option<CutoffByError>,
    /// What the constants of chosen friction add to the bars.
    constants_error: Option<ConstantsError>,
    pub(crate) lag: LagChoice,
    /// None for a single log.
    pub(crate) between_logs: Option<BetweenLogs>,
    /// Halves of the 95 % intervals before lag, logs and constants of friction have widened them.
    pub(crate) noise_half_width_95: Vec<f64>,
    pub(crate) times: StageTimes,
}

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
        Some(choices) => with_choices(task, &choices, chosen, execution)?,
        None => without_lag(task, chosen, execution, job)?,
    };
    if is_model && found.settings.estimation.estimator.reads_filtered_rows() {
        let weighted = found.settings.estimation.weighted();
        let varied = with_variation(&found.training, &weighted, &found.estimation.estimate);
        found.between_logs = varied.map(|(estimate, between)| {
            found.estimation.estimate = estimate;
            between
        });
    }
    if let Some(error) = &found.constants_error {
        found.estimation.estimate = error.added_to(found.training.problem.columns(), &found.estimation.estimate);
    }
    Ok(found)
}

/// What was chosen: everything that takes more than one pass over the recordings.
struct Choices {
    robot: ParametricModel,
    drive_inertia: Option<DriveInertiaChoice>,
    cutoff: Option<CutoffByError>,
    /// The cut-off of the torque's motion band, where the fit has another.
    motion_hz: Option<f64>,
    friction: ChosenFriction,
    lag: LagChoice,
    /// How long it took.
    times: StageTimes,
}

/// What an [excerpt](crate::excerpt) of long recordings chooses; none where they are not long, and where instruments
/// from outside or an arm that is known leave little to choose.
fn choices_of_excerpt(
    task: &IdentificationTask,
    chosen: &[usize],
    execution: Execution<'_>,
    job: &Job<'_, '_>,
) -> Result<Option<Choices>, IdentificationError> {
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
    Ok(Some(Choices {
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
        lag: found.lag,
        times: StageTimes { logs_s: found.times.logs_s + read_s, ..found.times },
    }))
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
    let mut found = lag_rounds((task, settings, rounds), (chosen, Some(choices)), execution, &mut Job::Model(None))?;
    found.times = found.times.and(&choices.times);
    Ok(found)
}

/// Rows and estimate; where the rows show a lag of the torque that moves parameters, again without it.
///
/// Friction that is chosen with a lag in the rows can make up for it, so that no lag is seen any more; and friction
/// that no stated term has looks like a lag. So where chosen friction leaves no common lag but the stated terms alone
/// show one, both are fitted, and the one counts that says most of the rows with the fewest parameters ([`schwarz`]).
fn without_lag<'a>(
    task: &'a IdentificationTask,
    chosen: &[usize],
    execution: Execution<'a>,
    job: &mut Job<'_, '_>,
) -> Result<Fitted<'a>, IdentificationError> {
    let settings = &task.settings;
    let is_free = settings.motion.torque_lag_s.is_none() && job.is_plain();
    let mut found = lag_rounds((task, settings.clone(), LagRounds::of(settings.lags)), (chosen, None), execution, job)?;
    if !is_free || settings.friction.is_empty() || found.lag.kind == LagKind::Common {
        return Ok(found);
    }
    let stated = IdentificationSettings { friction: Vec::new(), ..settings.clone() };
    let mut of_stated = fitted_like(&found, (task, &stated), chosen, execution, job)?;
    let mut first = LagRounds::of(LagCandidates::Common);
    let mut times = found.times.and(&of_stated.times);
    if first.again(free_lag(&of_stated, chosen)?.as_ref(), &mut of_stated.estimation.estimate) {
        let motion = MotionSettings { torque_lag_s: first.torque_lag_s(), ..settings.motion.clone() };
        let settings = IdentificationSettings { motion, ..settings.clone() };
        let rounds = LagRounds::of(settings.lags).after(first.choice());
        let other = lag_rounds((task, settings, rounds), (chosen, None), execution, job)?;
        times = times.and(&other.times);
        if schwarz(&other.training.problem, &other.estimation.estimate)
            < schwarz(&found.training.problem, &found.estimation.estimate)
        {
            found = other;
        }
    }
    found.times = times;
    Ok(found)
}

/// Fits from these rounds on, until the rows show no lag that moves parameters; with choices where they are made.
fn lag_rounds<'a>(
    (task, mut settings, mut rounds): (&'a IdentificationTask, IdentificationSettings, LagRounds),
    (chosen, choices): (&[usize], Option<&Choices>),
    execution: Execution<'a>,
    job: &mut Job<'_, '_>,
) -> Result<Fitted<'a>, IdentificationError> {
    let is_free = task.settings.motion.torque_lag_s.is_none() && job.is_plain();
    let mut times = StageTimes::default();
    // Friction by rows of less noise, once the lag is off; then the lag once more.
    let mut of_less_noise: Option<Choices> = None;
    let mut is_asked = choices.is_some() || !job.is_plain();
    loop {
        let choices = choices.or(of_less_noise.as_ref());
        let mut found = fitted_once((task, &settings), (chosen, Known::from(choices)), execution, job)?;
        times = times.and(&found.times);
        let started = Instant::now();
        let fit = if is_free { free_lag(&found, chosen)? } else { None };
        found.noise_half_width_95.clone_from(&found.estimation.estimate.half_width_95);
        let again = rounds.again(fit.as_ref(), &mut found.estimation.estimate);
        times.estimation_s += started.elapsed().as_secs_f64();
        if !again && !core::mem::replace(&mut is_asked, true) {
            let started = Instant::now();
            of_less_noise = choices_of_less_noise((&found, &task.payloads), chosen)?;
            times.estimation_s += started.elapsed().as_secs_f64();
            if of_less_noise.is_some() {
                continue;
            }
        }
        if !again {
            found.times = times;
            found.lag = if is_free { rounds.choice() } else { stated_lag(&settings, found.training.model.dof()) };
            if let (Some(fit), Some((_, gains))) = (&fit, &mut found.training.gains) {
                for (joint, share) in free_gains(gains).into_iter().zip(gain_errors(fit, &found.lag)) {
                    gains[joint].widen(share);
                }
            }
            return Ok(found);
        }
        settings.motion.torque_lag_s = rounds.torque_lag_s();
    }
}

/// The same choices with friction by rows of less noise; none where they stay.
fn choices_of_less_noise(
    (found, payloads): (&Fitted<'_>, &[Payload]),
    chosen: &[usize],
) -> Result<Option<Choices>, IdentificationError> {
    let Fitted { logs, settings, robot, cutoff, friction: (model, joints), friction_hz, .. } = found;
    let (Some(cutoff), Some(high_hz)) = (cutoff, *friction_hz) else { return Ok(None) };
    let (model, joints) = (model.clone(), joints.clone());
    let friction = ChosenFriction { model, joints, ..ChosenFriction::as_stated(robot.clone().into()) };
    let places = (chosen, payloads);
    let compared = (&friction, cutoff.cutoff_hz, high_hz);
    let Some((own, friction)) = friction_of_less_noise((logs, settings), robot, places, compared)? else {
        return Ok(None);
    };
    let cutoff = own.unwrap_or_else(|| cutoff.clone());
    Ok(Some(Choices {
        robot: robot.clone(),
        drive_inertia: found.drive_inertia.clone(),
        motion_hz: Some(cutoff.motion_hz).filter(|motion_hz| *motion_hz != cutoff.cutoff_hz),
        cutoff: Some(cutoff),
        friction,
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
    let found = (&training.columns, &estimation.estimate.values[..], gains);
    Ok(lag_fit((logs, settings), &training.model, found, chosen)?)
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

/// What is known before logs are read.
#[derive(Clone, Copy)]
enum Known<'k, 'a> {
    Nothing,
    /// Choices that were made by an excerpt, or by rows of less noise.
    Choices(&'k Choices),
    /// A fit to the same recordings that differs only in how its friction was chosen.
    Alike(&'k Fitted<'a>),
}

impl<'k> From<Option<&'k Choices>> for Known<'k, '_> {
    fn from(choices: Option<&'k Choices>) -> Self {
        choices.map_or(Self::Nothing, Self::Choices)
    }
}

/// [`fitted_once`] with other friction than `found`: where that has no lag taken off, drives and first cut-off are its.
fn fitted_like<'a>(
    found: &Fitted<'a>,
    (task, settings): (&'a IdentificationTask, &IdentificationSettings),
    chosen: &[usize],
    execution: Execution<'a>,
    job: &mut Job<'_, '_>,
) -> Result<Fitted<'a>, IdentificationError> {
    let is_alike = found.settings.motion.torque_lag_s == settings.motion.torque_lag_s;
    let known = if is_alike { Known::Alike(found) } else { Known::Nothing };
    fitted_once((task, settings), (chosen, known), execution, job)
}

/// One way from logs to an estimate, with the lag of the settings taken off; with choices where they are made.
fn fitted_once<'a>(
    (task, settings): (&'a IdentificationTask, &IdentificationSettings),
    (chosen, known): (&[usize], Known<'_, 'a>),
    execution: Execution<'a>,
    job: &mut Job<'_, '_>,
) -> Result<Fitted<'a>, IdentificationError> {
    let IdentificationTask { robot, recordings, payloads, .. } = task;
    let filters = (&settings.motion, &task.settings.parallel_filter);
    let cutoff_hz = job.arm().and_then(KnownArm::cutoff_hz);
    let logs = Logs::new(robot.model(), recordings, filters, chosen, cutoff_hz, execution)?;

    // Drives, filters and friction, by the logs where they are left to them.
    let started = Instant::now();
    let Chosen { robot, drive_inertia, logs, before_friction, cutoff, friction, friction_hz } = match known {
        Known::Choices(choices) => chosen_before((logs, settings), choices, (chosen, payloads))?,
        Known::Alike(found) => chosen_here((logs, settings), robot, (chosen, payloads), (job, Some(found)))?,
        Known::Nothing => chosen_here((logs, settings), robot, (chosen, payloads), (job, None))?,
    };
    let choice_s = started.elapsed().as_secs_f64();

    // Factors, then the estimate. Where noise in the regressor biases least squares, both once more with less of it.
    let refit = job.arm().map(KnownArm::refit);
    let mut training = training_rows((&logs, settings), friction.model.clone(), chosen, payloads, refit)?;
    training.friction_choice.clone_from(&friction.joints);
    let logs_s = training.timings_s[0];
    let before_s = training.timings_s[1] + choice_s;
    let started = Instant::now();
    let estimation = match job {
        Job::Payload(arm) => {
            let (model, columns) = (&training.model, &training.columns);
            Estimation::plain(arm.estimate(model, columns, &training.problem, &settings.estimation)?)
        }
        Job::Model(source) => match &training.gains {
            Some((found, _)) => Estimation::plain(found.clone()),
            None => estimate(&training.rows((&logs, settings), chosen), source.take())?,
        },
    };
    let found = Estimated { logs, training, estimation, settings: settings.clone() };
    let Estimated { logs, training, estimation, settings } = with_less_noise(task, &robot, chosen, found)?;
    let estimation_s = before_s + started.elapsed().as_secs_f64();
    Ok(Fitted {
        logs,
        training,
        estimation,
        settings,
        cutoff,
        robot,
        drive_inertia,
        stated_friction: friction.stated,
        friction: (friction.model, friction.joints),
        friction_hz,
        before_friction,
        constants_error: friction.constants_error,
        lag: LagChoice::default(),
        between_logs: None,
        noise_half_width_95: Vec::new(),
        times: StageTimes { logs_s, estimation_s, examination_s: 0.0 },
    })
}

/// Drives, filters and friction.
struct Chosen<'a> {
    robot: ParametricModel,
    drive_inertia: Option<DriveInertiaChoice>,
    logs: Logs<'a>,
    /// The cut-off before friction was chosen, where it was chosen here.
    before_friction: Option<CutoffByError>,
    cutoff: Option<CutoffByError>,
    friction: ChosenFriction,
    /// The cut-off at which friction was chosen, where the data chose both.
    friction_hz: Option<f64>,
}

/// Drives, filters and friction by the logs where they are left to them; drives and the first cut-off as a fit that is
/// alike chose them.
fn chosen_here<'a>(
    (logs, settings): (Logs<'a>, &IdentificationSettings),
    robot: &ParametricModel,
    (chosen, payloads): (&[usize], &[Payload]),
    (job, alike): (&Job<'_, '_>, Option<&Fitted<'a>>),
) -> Result<Chosen<'a>, IdentificationError> {
    let (robot, drive_inertia) = match (job.arm(), alike) {
        (Some(_), _) => (robot.clone(), None),
        (None, Some(alike)) => (alike.robot.clone(), alike.drive_inertia.clone()),
        (None, None) => choose_drive_inertia((&logs, settings), robot, (chosen, payloads))?,
    };
    let first = RegressorModel::from(robot.clone());
    let cutoff = match alike.and_then(|alike| alike.before_friction.clone()) {
        Some(cutoff) => Some(cutoff),
        None => choose_cutoff((&logs, settings), &first, chosen)?,
    };
    let before_friction = cutoff.clone();
    let mut friction_hz = None;
    let (logs, cutoff, friction) = if settings.friction.is_empty() {
        let logs = logs.with_chosen_cutoff(&settings.motion, cutoff.as_ref().map(|choice| choice.cutoff_hz));
        let friction = if settings.friction_before.is_empty() {
            ChosenFriction::as_stated(first)
        } else {
            choose_friction((&logs, settings), &robot, (chosen, payloads))?
        };
        (logs, cutoff, friction)
    } else {
        let places = (chosen, payloads);
        let (at_hz, of_friction, friction) = friction_by_cutoffs((&logs, settings), &robot, places, cutoff.as_ref())?;
        friction_hz = at_hz;
        let cutoff = of_friction.or(cutoff);
        (logs.with_chosen_cutoff(&settings.motion, cutoff.as_ref().map(|choice| choice.cutoff_hz)), cutoff, friction)
    };
    let logs = match alike {
        Some(alike) => logs.with_motion_of(&alike.logs),
        None => logs,
    };
    Ok(Chosen { robot, drive_inertia, logs, before_friction, cutoff, friction, friction_hz })
}

/// The same as an excerpt chose it, the constants of friction by all rows.
fn chosen_before<'a>(
    (logs, settings): (Logs<'a>, &IdentificationSettings),
    choices: &Choices,
    (chosen, payloads): (&[usize], &[Payload]),
) -> Result<Chosen<'a>, IdentificationError> {
    let Choices { robot, drive_inertia, cutoff, motion_hz, friction, .. } = choices;
    let logs = logs.with_chosen_cutoff(&settings.motion, cutoff.as_ref().map(|choice| choice.cutoff_hz));
    let logs = logs.with_motion_band(*motion_hz);
    let of_constants = logs.with_torque_beyond_motion(&robot.clone().into())?;
    let friction = constants_of_all_rows((&of_constants, settings), robot, friction, (chosen, payloads))?;
    let (robot, drive_inertia) = (robot.clone(), drive_inertia.clone());
    Ok(Chosen {
        robot,
        drive_inertia,
        logs,
        before_friction: None,
        cutoff: cutoff.clone(),
        friction,
        friction_hz: None,
    })
}
