//! From recordings to an estimate: cut-off, friction, factors, parameters, with the torque's lag among the unknowns.

use crate::bandwidth::{CutoffByError, choose_cutoff};
use crate::between_logs::{BetweenLogs, with_variation};
use crate::chosen_friction::{ChosenFriction, choose_friction};
use crate::error::IdentificationError;
use crate::estimators::{Estimation, InstrumentSource, estimate};
use crate::execution::Execution;
use crate::lag::{DELAY_SAMPLES, DelayCheck, LagChoice, LagFit, LagKind, choose_lag, fit_lags, with_lag_error};
use crate::less_noise::{Estimated, with_less_noise};
use crate::logs::Logs;
use crate::payload::KnownArm;
use crate::progress::Silent;
use crate::recording::{LogError, Samples};
use crate::regressor_model::RegressorModel;
use crate::rows::{JointRows, LogPass, RawSamples, RowConsumer};
use crate::settings::IdentificationSettings;
use crate::task::IdentificationTask;
use crate::training::{Training, training_rows};
use dynident_estimation::Estimate;
use dynident_recording::log::OneOrMany;
use rayon::prelude::*;
use std::time::Instant;

/// Rounds of measuring the lag and making the rows again without it, at most; one or two are usual.
const LAG_ROUNDS: usize = 3;

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
    /// Rows and fit with friction as stated, where it was chosen.
    pub(crate) stated_friction: Option<(Training, Estimate)>,
    pub(crate) lag: LagChoice,
    /// None for a single log.
    pub(crate) between_logs: Option<BetweenLogs>,
    pub(crate) times: StageTimes,
}

/// Rows and estimate, with the lag of the torque and what varies between logs in its error bars.
pub(crate) fn fitted<'a>(
    task: &'a IdentificationTask,
    chosen: &[usize],
    execution: Execution<'a>,
    job: &mut Job<'_, '_>,
) -> Result<Fitted<'a>, IdentificationError> {
    let is_model = job.arm().is_none();
    let mut found = without_lag(task, chosen, execution, job)?;
    if is_model && found.settings.estimation.estimator.reads_filtered_rows() {
        let weighted = found.settings.estimation.weighted();
        let varied = with_variation(&found.training, &weighted, &found.estimation.estimate);
        found.between_logs = varied.map(|(estimate, between)| {
            found.estimation.estimate = estimate;
            between
        });
    }
    Ok(found)
}

/// Rows and estimate; where the rows show a lag of the torque that moves parameters, again without it.
fn without_lag<'a>(
    task: &'a IdentificationTask,
    chosen: &[usize],
    execution: Execution<'a>,
    job: &mut Job<'_, '_>,
) -> Result<Fitted<'a>, IdentificationError> {
    let mut settings = task.settings.clone();
    let is_free = settings.motion.torque_lag_s.is_none() && job.is_plain();
    let mut found = fitted_once(task, &settings, chosen, execution, job)?;
    found.lag = stated_lag(&settings, found.training.model.dof());
    if !is_free {
        return Ok(found);
    }
    let mut times = found.times;
    for round in 0..=LAG_ROUNDS {
        let started = Instant::now();
        let fit = has_free_lag(task, &found, chosen).then(|| lag_fit(&found, chosen)).transpose()?.flatten();
        times.estimation_s += started.elapsed().as_secs_f64();
        // Noise that biases least squares biases the lag that is measured by it.
        let Some(fit) = fit else { break };
        let next = choose_lag(&fit, &found.lag.lag_s, &found.estimation.estimate);
        if next.kind == LagKind::None || round == LAG_ROUNDS {
            found.lag = LagChoice { kind: found.lag.kind, lag_s: found.lag.lag_s, ..next };
            found.estimation.estimate = with_lag_error(&fit, &found.lag, &found.estimation.estimate);
            break;
        }
        settings.motion.torque_lag_s = Some(OneOrMany::Many(next.lag_s.clone()));
        found = fitted_once(task, &settings, chosen, execution, job)?;
        found.lag = next;
        times.logs_s += found.times.logs_s;
        times.estimation_s += found.times.estimation_s;
    }
    found.times = times;
    Ok(found)
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

/// Whether a lag can be taken off and tells of the robot: rows of logs, whose every column is the arm's own.
fn has_free_lag(task: &IdentificationTask, found: &Fitted<'_>, chosen: &[usize]) -> bool {
    let of_log = |&index: &usize| matches!(task.recordings[index].samples, Samples::Log(_));
    found.training.columns.is_plain()
        && found.training.gains.is_none()
        && found.training.joints.len() == found.training.model.dof()
        && found.settings.estimation.estimator.reads_filtered_rows()
        && chosen.iter().all(of_log)
}

/// One way from logs to an estimate, with the lag of the settings taken off.
fn fitted_once<'a>(
    task: &'a IdentificationTask,
    settings: &IdentificationSettings,
    chosen: &[usize],
    execution: Execution<'a>,
    job: &mut Job<'_, '_>,
) -> Result<Fitted<'a>, IdentificationError> {
    let IdentificationTask { robot, recordings, payloads, .. } = task;
    let filters = (&settings.motion, &task.settings.parallel_filter);
    let cutoff_hz = job.arm().and_then(KnownArm::cutoff_hz);
    let logs = Logs::new(robot.model(), recordings, filters, chosen, cutoff_hz, execution)?;

    // Filters and friction, by the logs where they are left to them.
    let first = RegressorModel::from(robot.clone());
    let cutoff = choose_cutoff((&logs, settings), &first, chosen)?;
    let started = Instant::now();
    let (logs, cutoff, friction) = if settings.friction.is_empty() {
        let friction = ChosenFriction { model: first, joints: Vec::new(), stated: None };
        (with_choice(logs, settings, cutoff.as_ref().map(|choice| choice.cutoff_hz)), cutoff, friction)
    } else {
        let logs = with_choice(logs, settings, cutoff.as_ref().map(CutoffByError::highest_alike_hz));
        let friction = choose_friction((&logs, settings), robot, (chosen, payloads))?;
        let cutoff = choose_cutoff((&logs, settings), &friction.model, chosen)?.or(cutoff);
        (with_choice(logs, settings, cutoff.as_ref().map(|choice| choice.cutoff_hz)), cutoff, friction)
    };
    let choice_s = started.elapsed().as_secs_f64();

    // Factors, then the estimate. Where noise in the regressor biases least squares, both once more with less of it.
    let refit = job.arm().map(KnownArm::refit);
    let mut training = training_rows((&logs, settings), friction.model, chosen, payloads, refit)?;
    training.friction_choice = friction.joints;
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
    let Estimated { logs, training, estimation, settings } = with_less_noise(task, chosen, found)?;
    let estimation_s = before_s + started.elapsed().as_secs_f64();
    Ok(Fitted {
        logs,
        training,
        estimation,
        settings,
        cutoff,
        stated_friction: friction.stated,
        lag: LagChoice::default(),
        between_logs: None,
        times: StageTimes { logs_s, estimation_s, examination_s: 0.0 },
    })
}

/// The logs with a cut-off that was chosen.
fn with_choice<'a>(logs: Logs<'a>, settings: &IdentificationSettings, cutoff_hz: Option<f64>) -> Logs<'a> {
    match cutoff_hz {
        Some(cutoff_hz) => logs.with_cutoff(&settings.motion, cutoff_hz),
        None => logs,
    }
}

/// Gathers the samples that lags are estimated from.
struct LagPass<'a>(DelayCheck<'a>);

impl RowConsumer for LagPass<'_> {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
        self.0.filtered(rows);
        Ok(())
    }

    fn raw(&mut self, samples: &RawSamples<'_>) -> Result<(), LogError> {
        self.0.raw(samples);
        Ok(())
    }
}

/// The joints' lags by all training logs together.
fn lag_fit(found: &Fitted<'_>, chosen: &[usize]) -> Result<Option<LagFit>, LogError> {
    let Fitted { logs, training, estimation, settings, .. } = found;
    let theta = &estimation.estimate.values[..training.columns.base()];
    let of_log = |&index: &usize| -> Result<DelayCheck<'_>, LogError> {
        let mut samples = LagPass(DelayCheck::new(&training.model, theta));
        let pass = LogPass {
            most_samples: Some(DELAY_SAMPLES as u64),
            progress: &Silent,
            ..logs.pass(&training.model, index)
        };
        pass.run(&mut samples)?;
        Ok(samples.0)
    };
    let checks: Vec<DelayCheck<'_>> = if logs.execution.parallel() {
        chosen.par_iter().map(of_log).collect::<Result<_, _>>()?
    } else {
        chosen.iter().map(of_log).collect::<Result<_, _>>()?
    };
    Ok(fit_lags(&checks, (logs, &settings.estimation)))
}
