//! The whole way from recordings to an identified model, stage by stage.

use crate::bandwidth::CutoffByError;
use crate::bars::{ErrorBars, ErrorSource};
use crate::between_logs::BetweenLogs;
use crate::consistent::inertials;
use crate::decisions::Job;
use crate::diagnosis::Diagnosis;
use crate::drive_inertia::DriveInertiaChoice;
use crate::error::IdentificationError;
use crate::estimators::{Estimation, Estimator, InstrumentSource};
use crate::examination::HeldOutExamination;
use crate::fitted::{Fitted, fitted};
use crate::forms::{FormFit, form_fits};
use crate::lag::LagChoice;
use crate::less_noise::Fit;
use crate::payload::{KnownArm, PayloadError, PayloadResult, gain_error, payload_results};
use crate::settings::{GainChoice, IdentificationSettings};
use crate::stage_times::StageTimes;
use crate::stages::{ConsistentParameters, Stage, TrainingExamination};
use crate::task::IdentificationTask;
use crate::training::Training;
use dynident_estimation::{EssentialReport, Estimate, essential};
use dynident_model::InertialParameters;
use dynident_recording::MotionSettings;
use dynident_rows::{Execution, RegressorModel, Role, of_role};
use std::time::Instant;

/// An identified model with everything that was found on the way.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Identification {
    /// The motion settings in force, with one cut-off for all recordings.
    pub motion: MotionSettings,
    /// How the cut-off was chosen; none where it was given or the recordings are too short to try any.
    pub cutoff: Option<CutoffByError>,
    /// The cut-off whose band held-out figures are for, where the fit has another.
    pub motion_hz: Option<f64>,
    /// Whether drives were seen to have inertia; none where terms state it.
    pub drive_inertia: Option<DriveInertiaChoice>,
    /// The training recordings as factors, the model with the friction that was chosen, payload columns, gains.
    pub training: Training,
    /// The estimator that made the estimate: of `auto` the one that it took.
    pub estimator: Estimator,
    /// The result of the estimator: values with error bars by the residuals alone, and its findings.
    pub estimation: Estimation,
    /// The other terms of the error bars.
    pub bars: ErrorBars,
    /// The estimate with all terms in its error bars, and with inessential parameters held at zero if the settings
    /// require it.
    pub estimate: Estimate,
    /// What was held at zero because the data hardly determine it, if that was asked for.
    pub essential: Option<EssentialReport>,
    /// Bodies, friction and drives.
    pub consistent: ConsistentParameters,
    /// Payloads that were estimated.
    pub payloads: Vec<PayloadResult>,
    /// Delays and torque over time of the training recordings.
    pub examination: TrainingExamination,
    /// Tests on recordings that were not fitted to.
    pub held_out: Vec<HeldOutExamination>,
    /// Other readings of the recordings beside the task's; none where there was no reason to try them, and for
    /// payloads.
    pub diagnosis: Option<Diagnosis>,
    /// The model with the torque terms of each class of forms; empty for payloads on a known arm and with unknown gains.
    pub forms: Vec<FormFit>,
    /// The lag of the torque that was taken off the rows, and how well the rest is known.
    pub torque_lag: LagChoice,
    /// By how much training logs differ beyond their own error bars, which the estimate's bars hold; none for a single
    /// one.
    pub between_logs: Option<BetweenLogs>,
    /// Where the time went.
    pub times: StageTimes,
}

impl Identification {
    /// The model: terms, base parameters, layout.
    pub fn model(&self) -> &RegressorModel {
        &self.training.model
    }

    /// The estimate over base parameters, payloads and offsets of single logs.
    pub fn estimate(&self) -> &Estimate {
        &self.estimate
    }

    /// Base parameters as estimated.
    pub fn base_values(&self) -> &[f64] {
        &self.estimate.values[..self.training.columns.base()]
    }

    /// Inertial parameters of all bodies: of the consistent set, where there is one.
    pub fn inertials(&self) -> Vec<InertialParameters> {
        inertials(self.model().model(), &self.consistent.parameters)
    }

    /// Base parameters of the consistent set, where there is one.
    pub fn consistent_base_values(&self) -> Option<&[f64]> {
        self.consistent.fit.as_ref().map(|fit| &fit.base_values[..])
    }
}

/// Fits a robot's model to its recordings with the role [`Identify`](Role::Identify) and tests it on the others: rows
/// and factors, estimate, consistent parameters, examination, held-out examination. Each of these stages can be called
/// alone: [`Logs::new`](crate::Logs::new), [`training_rows`](crate::training_rows),
/// [`estimate`](crate::estimators::estimate()), [`consistent_stage`](crate::consistent_stage),
/// [`examine_training`](crate::examination::examine_training),
/// [`examine_held_out`](crate::examination::examine_held_out).
///
/// # Errors
/// [`IdentificationError`]: recordings, settings that do not go together. A poor fit is not an error.
pub fn identify(task: &IdentificationTask, execution: Execution<'_>) -> Result<Identification, IdentificationError> {
    execution.install(|| identified(task, execution, Job::Model(None)))
}

/// As [`identify()`] with instruments from `source`: the closed loop simulated with the model so far (IDIM-IV: call
/// again with a new simulation until the parameters settle), or a repeated run. With
/// [`Estimator::Instrumental`](crate::estimators::Estimator::Instrumental) they make the estimate, with another
/// estimator they test it.
///
/// # Errors
/// As [`identify()`], and what `source` returns.
pub fn identify_with_instruments(
    task: &IdentificationTask,
    source: &mut dyn InstrumentSource,
    execution: Execution<'_>,
) -> Result<Identification, IdentificationError> {
    execution.install(|| identified(task, execution, Job::Model(Some(source))))
}

/// Payloads on an arm that is known already, with the arm's error bars in theirs. The task's robot has the arm's terms;
/// bodies of the arm are not looked for.
///
/// # Errors
/// As [`identify()`].
pub fn identify_payload(
    task: &IdentificationTask,
    arm: &KnownArm,
    execution: Execution<'_>,
) -> Result<Identification, IdentificationError> {
    if !task.settings.friction.is_empty() {
        return Err(PayloadError::FrictionOfKnownArm.into());
    }
    if !task.settings.drive_inertia.is_empty() {
        return Err(PayloadError::DrivesOfKnownArm.into());
    }
    execution.install(|| identified(task, execution, Job::Payload(arm)))
}

fn identified(
    task: &IdentificationTask,
    execution: Execution<'_>,
    job: Job<'_>,
) -> Result<Identification, IdentificationError> {
    let IdentificationTask { robot, recordings, payloads, settings } = task;
    let chosen = of_role(recordings, Role::Identify);
    if chosen.is_empty() {
        return Err(IdentificationError::NoTrainingLog);
    }
    settings.check_names(robot).map_err(IdentificationError::Consistency)?;

    let arm = job.arm();
    let Fitted { fit, choices, lag, between_logs, bars, mut times } = fitted(task, &chosen, execution, job)?;
    let Fit { logs, training, estimation, settings } = fit;
    let friction = choices.friction();
    let (settings, started) = (&settings, Instant::now());
    let total = bars.total(&estimation.estimate);
    let (estimate, dropped) = without_inessential(total, settings)?;
    let stage = Stage {
        task,
        execution,
        logs: &logs,
        settings,
        training: &training,
        estimate: &estimate,
        stated_friction: friction.as_ref().and_then(|friction| friction.stated.as_ref()),
        arm_is_known: arm.is_some(),
        started,
    };
    let examined = stage.examined()?;
    let drives = choices.drives();
    let robot = drives.map_or(robot, |drives| &drives.robot);
    let diagnosis = stage.diagnosis(&examined, robot, &chosen)?;
    let forms = if arm.is_some() || training.gains.is_some() {
        Vec::new()
    } else {
        form_fits(&logs, settings, &training.model.parametric, &examined.consistent.parameters, &chosen)?
    };
    times.estimation_s += examined.estimation_s;
    times.examination_s = started.elapsed().as_secs_f64() - examined.estimation_s;
    let of_arm = arm.map_or_else(Vec::new, |arm| arm.held(&training.model, &training.columns));
    let gain_std = if settings.gains == GainChoice::Stated { settings.gain_std } else { 0.0 };
    let gain_error = gain_error(&training.problem, &training.columns, &estimate, &of_arm, gain_std)?;
    let with_gains = ErrorBars::default().with(ErrorSource::Gains, gain_error).total(&estimate);
    Ok(Identification {
        payloads: payload_results(recordings, payloads, &chosen, &training.columns, &with_gains),
        motion: logs.motion.clone(),
        cutoff: choices.cutoff().cloned(),
        motion_hz: logs.motion_hz(),
        drive_inertia: drives.and_then(|drives| drives.choice.clone()),
        estimator: settings.estimation.estimator.clone(),
        essential: dropped,
        consistent: examined.consistent,
        examination: examined.examination,
        held_out: examined.held_out,
        training,
        estimation,
        bars,
        estimate,
        diagnosis,
        forms,
        torque_lag: lag,
        between_logs,
        times,
    })
}

/// The estimate with parameters held at zero that the data hardly determine, if the settings ask for it.
fn without_inessential(
    estimate: Estimate,
    settings: &IdentificationSettings,
) -> Result<(Estimate, Option<EssentialReport>), IdentificationError> {
    let Some(essential_settings) = &settings.estimation.essential else { return Ok((estimate, None)) };
    let (rest, report) = essential(&estimate, essential_settings)?;
    Ok((rest, Some(report)))
}
