//! Identification of a model from recordings, stage by stage.

use crate::bandwidth::CutoffByError;
use crate::bars::{ErrorBars, ErrorSource};
use crate::between_logs::LogVariation;
use crate::conditional::resting_joints;
use crate::consistent::inertials;
use crate::decisions::Job;
use crate::diagnosis::Diagnosis;
use crate::drive_inertia::DriveInertiaChoice;
use crate::error::IdentificationError;
use crate::estimators::{Estimation, Estimator, InstrumentSource};
use crate::events::{RecordingEvents, task_without_events};
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

/// An identified model, with all intermediate results.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Identification {
    /// Settings of the differentiation that were used, with one cut-off for all recordings.
    pub motion: MotionSettings,
    /// Comparison of cut-offs; `None` if the settings state the cut-off or the recordings are too short to compare
    /// cut-offs.
    pub cutoff: Option<CutoffByError>,
    /// Cut-off of the frequency band for held-out errors, hertz; `None` if they use the band of the fit.
    pub motion_hz: Option<f64>,
    /// Test of drive inertia; `None` if the robot's terms state it.
    pub drive_inertia: Option<DriveInertiaChoice>,
    /// Triangular factors of the training recordings, the model with the selected friction, columns of payloads, and
    /// torque gains.
    pub training: Training,
    /// Estimator that was used; for `auto` the selected one.
    pub estimator: Estimator,
    /// Result of the estimator, with error bars from the residuals only.
    pub estimation: Estimation,
    /// Other sources of error in the error bars.
    pub bars: ErrorBars,
    /// Estimate whose error bars include all sources of error. Inessential parameters are fixed at zero if the settings
    /// require it.
    pub estimate: Estimate,
    /// Parameters that were fixed at zero because the data hardly determine them; `None` unless requested.
    pub essential: Option<EssentialReport>,
    /// Physically consistent parameters of bodies, friction and drives.
    pub consistent: ConsistentParameters,
    /// Estimated payloads.
    pub payloads: Vec<PayloadResult>,
    /// Lags of the torque in the training recordings, and measured and predicted torque over time.
    pub examination: TrainingExamination,
    /// Tests on recordings that were not used for the fit.
    pub held_out: Vec<HeldOutExamination>,
    /// Comparison of hypotheses about mistakes in the study; `None` if the fit gave no reason for it, and for payloads.
    pub diagnosis: Option<Diagnosis>,
    /// The model as each class of export formats can represent it; empty for payloads on a known arm and with unknown
    /// gains.
    pub forms: Vec<FormFit>,
    /// The compensated lag of the torque and its remaining uncertainty.
    pub torque_lag: LagChoice,
    /// Variation of the parameters between training logs beyond their error bars, which the error bars of the estimate
    /// include; `None` for a single log.
    pub between_logs: Option<LogVariation>,
    /// Events in the recordings. Intervals of events may be excluded from the fit.
    pub events: Vec<RecordingEvents>,
    /// Computing time of each stage.
    pub times: StageTimes,
}

impl Identification {
    /// Robot model with its torque terms, base parameters and regressor columns.
    pub fn model(&self) -> &RegressorModel {
        &self.training.model
    }

    /// Estimate of base parameters, payloads and offsets of single logs.
    pub fn estimate(&self) -> &Estimate {
        &self.estimate
    }

    /// Estimated base parameters.
    pub fn base_values(&self) -> &[f64] {
        &self.estimate.values[..self.training.columns.base()]
    }

    /// Inertial parameters of all bodies, from the physically consistent set if available.
    pub fn inertials(&self) -> Vec<InertialParameters> {
        inertials(self.model().model(), &self.consistent.parameters)
    }

    /// Base parameters of the physically consistent set, if available.
    pub fn consistent_base_values(&self) -> Option<&[f64]> {
        self.consistent.fit.as_ref().map(|fit| &fit.base_values[..])
    }
}

/// Fits a robot model to the recordings with the role [`Identify`](Role::Identify) and tests it on the others. The
/// stages are: rows and triangular factors, estimate, physically consistent parameters, examination, and held-out
/// examination. Each stage can be called separately: [`Logs::new`](crate::Logs::new),
/// [`training_rows`](crate::training_rows), [`estimate`](crate::estimators::estimate()),
/// [`consistent_stage`](crate::consistent_stage), [`examine_training`](crate::examination::examine_training),
/// [`examine_held_out`](crate::examination::examine_held_out).
///
/// # Errors
/// [`IdentificationError`]: recordings cannot be read, or settings contradict each other. A poor fit is not an error.
pub fn identify(task: &IdentificationTask, execution: Execution<'_>) -> Result<Identification, IdentificationError> {
    execution.install(|| identified(task, execution, Job::Model(None)))
}

/// As [`identify()`], with instrumental variables from `source`. This can be a simulation of the closed loop with the
/// current model (method IDIM-IV: call again with a new simulation until the parameters converge), or a repeated run.
/// [`Estimator::Instrumental`](crate::estimators::Estimator::Instrumental) uses the instruments for the estimate; other
/// estimators are only tested with them.
///
/// # Errors
/// As [`identify()`], and errors of `source`.
pub fn identify_with_instruments(
    task: &IdentificationTask,
    source: &mut dyn InstrumentSource,
    execution: Execution<'_>,
) -> Result<Identification, IdentificationError> {
    execution.install(|| identified(task, execution, Job::Model(Some(source))))
}

/// Identifies payloads on a known arm. The error bars of the payloads include the uncertainty of the arm. `task.robot`
/// must have the torque terms with which the arm was identified. The bodies of the arm are not estimated again; its
/// friction and torque offsets are estimated again only if [`KnownArm::refit`] states this.
///
/// # Errors
/// As [`identify()`].
pub fn identify_payload(
    task: &IdentificationTask,
    arm: &KnownArm,
    execution: Execution<'_>,
) -> Result<Identification, IdentificationError> {
    if task.settings.friction.is_selected() {
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
    let IdentificationTask { recordings, settings, .. } = task;
    let chosen = of_role(recordings, Role::Identify);
    if chosen.is_empty() {
        return Err(IdentificationError::NoTrainingLog);
    }
    settings.check_names(&task.robot).map_err(IdentificationError::Consistency)?;
    settings.thresholds.validate()?;
    settings.estimation.thresholds.validate()?;

    let (events, without_events) = task_without_events(task, execution)?;
    let task = without_events.as_ref().unwrap_or(task);
    let IdentificationTask { robot, recordings, payloads, .. } = task;

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
    let mut examined = stage.examined()?;
    stage.test_without_events(&mut examined, &events)?;
    let drives = choices.drives();
    let robot = drives.map_or(robot, |drives| &drives.robot);
    let diagnosis = stage.diagnosis(&examined, robot, &chosen)?;
    let forms = if arm.is_some() || training.gains.is_some() {
        Vec::new()
    } else {
        form_fits(
            &logs,
            settings,
            &training.model,
            &examined.consistent.parameters,
            &chosen,
            &resting_joints(&training),
        )?
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
        events,
        times,
    })
}

/// Fixes parameters at zero that the data hardly determine, if requested.
fn without_inessential(
    estimate: Estimate,
    settings: &IdentificationSettings,
) -> Result<(Estimate, Option<EssentialReport>), IdentificationError> {
    let Some(essential_settings) = &settings.estimation.essential else { return Ok((estimate, None)) };
    let (rest, report) = essential(&estimate, essential_settings)?;
    Ok((rest, Some(report)))
}
