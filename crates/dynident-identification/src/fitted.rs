//! Estimate from recordings: decisions, the last fit, and the sources of its error bars.

use crate::bars::{ErrorBars, ErrorSource};
use crate::between_logs::{LogVariation, variation_of_logs};
use crate::decisions::{Choices, DECISIONS, Job, Workspace, decide_all};
use crate::error::IdentificationError;
use crate::lag::{LagChoice, LagKind, gain_errors};
use crate::less_noise::Fit;
use crate::payload::free_gains;
use crate::settings::{GainChoice, IdentificationSettings};
use crate::stage_times::StageTimes;
use crate::task::IdentificationTask;
use dynident_recording::log::OneOrMany;
use dynident_rows::{Execution, Recording, excerpts};
use std::sync::Arc;
use std::time::Instant;

pub(crate) struct Fitted<'a> {
    /// The last fit, with the compensated lag and the estimator that `auto` selected.
    pub(crate) fit: Fit<'a>,
    pub(crate) choices: Choices,
    pub(crate) lag: LagChoice,
    pub(crate) between_logs: Option<LogVariation>,
    /// Covariance of the estimate from sources of error other than noise.
    pub(crate) bars: ErrorBars,
    pub(crate) times: StageTimes,
}

/// Makes all decisions and fits the model. Decisions for long logs are made on an [excerpt](dynident_rows::excerpts)
/// and then revised on all rows.
pub(crate) fn fitted<'a>(
    task: &'a IdentificationTask,
    training: &[usize],
    execution: Execution<'a>,
    job: Job<'_>,
) -> Result<Fitted<'a>, IdentificationError> {
    let started = Instant::now();
    let is_model = job.arm().is_none();
    let excerpt = choices_of_excerpt(task, training, execution, &job)?;
    let (choices, excerpts, excerpt_s) = match excerpt {
        Some(Excerpt { choices, recordings, logs_s }) => (Some(choices), Some(recordings), logs_s),
        None => (None, None, 0.0),
    };
    let mut work = Workspace::new(task, training, execution, job.shorter(), choices);
    decide_all(&DECISIONS, &mut work)?;
    work.finish()?;
    let bars = DECISIONS
        .iter()
        .filter_map(|decision| decision.error(&work))
        .fold(ErrorBars::default(), |bars, (source, covariance)| bars.with(source, Some(covariance)));
    let logs_s = work.logs_s + excerpt_s;
    let (choices, mut fit, lag_fit, is_lag_free) = work.into_parts()?;

    let lag = if is_lag_free { choices.lag().clone().choice() } else { stated_lag(&fit) };
    if let (Some(lag_fit), Some((_, gains))) = (&lag_fit, &mut fit.training.gains) {
        for (joint, share) in free_gains(gains).into_iter().zip(gain_errors(lag_fit, &lag)) {
            gains[joint].widen(share);
        }
    }
    if let Some(excerpts) = excerpts {
        fit.logs = fit.logs.with_excerpts(Arc::new(excerpts));
    }
    let (bars, between_logs) = if is_model && fit.settings.estimation.estimator.reads_filtered_rows() {
        let variation = variation_of_logs(&fit.training, &fit.settings.estimation, &fit.estimation.estimate);
        let (covariance, between_logs) = variation.unzip();
        (bars.with(ErrorSource::LogVariation, covariance), between_logs)
    } else {
        (bars, None)
    };
    let estimation_s = started.elapsed().as_secs_f64() - logs_s;
    let times = StageTimes { logs_s, estimation_s, examination_s: 0.0 };
    Ok(Fitted { fit, choices, lag, between_logs, bars, times })
}

struct Excerpt {
    choices: Choices,
    recordings: Vec<Recording>,
    logs_s: f64,
}

/// Choices from an excerpt. `None` for short logs, and if few choices are open: with external instruments, a known arm
/// or unknown gains.
fn choices_of_excerpt(
    task: &IdentificationTask,
    training: &[usize],
    execution: Execution<'_>,
    job: &Job<'_>,
) -> Result<Option<Excerpt>, IdentificationError> {
    let IdentificationTask { robot, recordings, payloads, settings } = task;
    if !job.is_plain() || settings.gains == GainChoice::Unknown {
        return Ok(None);
    }
    let started = Instant::now();
    let has_choices = settings.friction.is_selected() || !settings.drive_inertia.is_empty();
    let Some(recordings) = excerpts(recordings, settings.row_settings(), has_choices, training, execution)? else {
        return Ok(None);
    };
    let read_s = started.elapsed().as_secs_f64();
    let (robot, payloads, settings) = (robot.clone(), payloads.clone(), settings.clone());
    let task = IdentificationTask { robot, recordings, payloads, settings };
    let mut work = Workspace::new(&task, training, execution, Job::Model(None), None);
    // The fit to all rows will report errors of the recordings.
    let Ok(()) = decide_all(&DECISIONS, &mut work) else { return Ok(None) };
    let (choices, logs_s) = (work.choices().clone().of_excerpt(task.settings.lags), work.logs_s + read_s);
    drop(work);
    Ok(Some(Excerpt { choices, recordings: task.recordings, logs_s }))
}

fn stated_lag(fit: &Fit<'_>) -> LagChoice {
    let IdentificationSettings { motion, .. } = &fit.settings;
    let Some(stated) = &motion.torque_lag_s else { return LagChoice::default() };
    let lag_s = match stated {
        OneOrMany::One(lag_s) => vec![*lag_s; fit.training.model.dof()],
        OneOrMany::Many(lags) => lags.clone(),
    };
    LagChoice { kind: LagKind::Stated, lag_s, ..LagChoice::default() }
}
