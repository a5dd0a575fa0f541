//! The whole way from recordings to an identified model, stage by stage.

use crate::bandwidth::CutoffByError;
use crate::bars::{ErrorBars, ErrorSource};
use crate::between_logs::BetweenLogs;
use crate::consistent::{
    ConsistencyError, ParameterInterval, consistent_intervals, consistent_with_estimate, inconsistent_nominal_bodies,
    inertials, nearest_to_nominal, parameter_std,
};
use crate::diagnosis::{Diagnosis, DiagnosisTask, diagnose};
use crate::doubt::{break_limits, have_jumps, is_doubtful};
use crate::drive_inertia::DriveInertiaChoice;
use crate::error::IdentificationError;
use crate::estimators::{Estimation, Estimator, InstrumentSource};
use crate::examination::{
    FrictionSign, HeldOutExamination, LogTrace, LogValidation, ModelUnderTest, PriorAgreement, TorqueLag,
    TorqueSignCheck, Uncertainty, examine_training, friction_signs, pooled_delay, sign_evidence, tested_on,
};
use crate::execution::Execution;
use crate::fitted::fitted;
use crate::lag::LagChoice;
use crate::logs::{Logs, of_role};
use crate::one_fit::{Fitted, Job, StageTimes};
use crate::payload::{KnownArm, PayloadError, PayloadResult, gain_error, payload_results};
use crate::recording::Role;
use crate::regressor_model::RegressorModel;
use crate::settings::{DiagnosisChoice, GainChoice, IdentificationSettings};
use crate::task::IdentificationTask;
use crate::training::Training;
use dynident_estimation::consistent::PhysicalFit;
use dynident_estimation::{EssentialReport, Estimate, LinearProblem, essential, left_out_ratios};
use dynident_model::InertialParameters;
use dynident_recording::MotionSettings;
use rayon::prelude::*;
use std::time::Instant;

/// Physically consistent parameters beside an estimate, or why there are none.
#[derive(Clone, Debug)]
pub struct ConsistentParameters {
    /// The consistent set that explains the data best; none if it was not asked for or does not exist.
    pub fit: Option<PhysicalFit>,
    /// Why there is none although it was asked for.
    pub failure: Option<String>,
    /// All parameters, ten for each body and one for each term: the consistent set's, or else the set nearest to the
    /// nominal one that has the estimated base parameters.
    pub parameters: Vec<f64>,
    /// Standard deviation of each of `parameters` ([`parameter_std`]); none where there is no consistent set, and for
    /// bodies that are not described.
    pub parameter_std: Vec<Option<f64>>,
    /// Intervals of all parameters over all consistent sets that the data do not reject, if asked for.
    pub intervals: Option<Vec<ParameterInterval>>,
    /// Bodies whose nominal parameters are no body's, with the least eigenvalue of their pseudo-inertia.
    pub inconsistent_nominal: Vec<(String, f64)>,
}

/// What the training recordings say of the estimate.
#[derive(Clone, Debug)]
pub struct TrainingExamination {
    /// For each training recording the delays of its torque, joint by joint; none where it does not determine one.
    pub delays: Vec<Vec<Option<TorqueLag>>>,
    /// Measured and predicted torque over time.
    pub traces: Vec<LogTrace>,
    /// The delays of all recordings together, joint by joint.
    pub pooled_delays: Vec<Option<TorqueLag>>,
    /// How well consistent sets explain the torque with either sign; none where a fit fails, and for payloads.
    pub sign: Option<TorqueSignCheck>,
    /// The mean friction of every joint with friction of its own; empty for payloads on a known arm.
    pub friction_signs: Vec<FrictionSign>,
}

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
    /// What the estimator returned: values with error bars by the residuals alone, and what it can determine.
    pub estimation: Estimation,
    /// The other terms of the error bars.
    pub bars: ErrorBars,
    /// The estimate with all terms in its error bars, and with parameters held at zero where that was asked for.
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
/// alone: [`Logs::new`], [`training_rows`](crate::training_rows), [`estimate`](crate::estimators::estimate()),
/// [`consistent_stage`], [`examine_training`], [`examine_held_out`](crate::examination::examine_held_out).
///
/// # Errors
/// [`IdentificationError`]: recordings, settings that do not go together. A poor fit is not an error.
pub fn identify(task: &IdentificationTask, execution: Execution<'_>) -> Result<Identification, IdentificationError> {
    execution.install(|| identified(task, execution, &mut Job::Model(None)))
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
    execution.install(|| identified(task, execution, &mut Job::Model(Some(source))))
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
    execution.install(|| identified(task, execution, &mut Job::Payload(arm)))
}

fn identified(
    task: &IdentificationTask,
    execution: Execution<'_>,
    job: &mut Job<'_, '_>,
) -> Result<Identification, IdentificationError> {
    let IdentificationTask { robot, recordings, payloads, settings } = task;
    let chosen = of_role(recordings, Role::Identify);
    if chosen.is_empty() {
        return Err(IdentificationError::NoTrainingLog);
    }
    settings.check_names(robot).map_err(IdentificationError::Consistency)?;

    // Rows and factors, with filters and friction stated or chosen and the torque's lag taken off; then the estimate.
    let Fitted {
        logs,
        training,
        estimation,
        settings,
        cutoff,
        robot,
        drive_inertia,
        stated_friction,
        lag,
        between_logs,
        bars,
        mut times,
        ..
    } = fitted(task, &chosen, execution, job)?;
    let (settings, started) = (&settings, Instant::now());
    let mut estimate = bars.total(&estimation.estimate);
    let mut dropped = None;
    if let Some(essential_settings) = &settings.estimation.essential {
        let (rest, report) = essential(&estimate, essential_settings)?;
        (estimate, dropped) = (rest, Some(report));
    }

    // Bodies, friction and drives that a robot can have; then what held-out recordings say of them.
    let held = job.arm().is_some();
    let bodies = || -> Result<_, IdentificationError> {
        let consistent = if held {
            held_arm(task, &training, &estimate)
        } else {
            consistent_stage(&logs, settings, &training, &estimate)?
        };
        let estimation_s = started.elapsed().as_secs_f64();
        let physical = consistent.fit.as_ref().map(|fit| &fit.base_values[..]);
        let held_out = examine_all_held_out(&logs, settings, &training, &estimate, physical);
        Ok((consistent, estimation_s, held_out))
    };
    // Beside that, what training recordings say of the estimate.
    // Friction that was chosen has no wrong sign: where it would, there is none. The stated terms tell.
    let signs = || match &stated_friction {
        _ if held => Ok((None, Vec::new())),
        Some((stated, plain)) => torque_signs(stated, plain),
        None => torque_signs(&training, &estimate),
    };
    let examined = || examine_all_training(&logs, settings, &training, &estimate);
    let (bodies, (signs, examined)) = if execution.parallel() {
        rayon::join(bodies, || rayon::join(signs, examined))
    } else {
        (bodies(), (signs(), examined()))
    };
    let (consistent, estimation_s, held_out) = bodies?;
    let (sign, friction_signs) = signs?;
    let examination = TrainingExamination { sign, friction_signs, ..examined? };
    let held_out = held_out?;
    // Where something does not fit: what the recordings would be under another study.
    let theta = consistent.fit.as_ref().map(|fit| &fit.base_values[..]);
    let agreements = || training.logs.iter().filter_map(|log| log.nominal_agreement.as_ref());
    let is_doubted = || {
        is_doubtful(&training, theta)
            || examination.friction_signs.iter().any(FrictionSign::is_reversed)
            || agreements().any(PriorAgreement::is_reversed)
            || agreements().any(PriorAgreement::is_poor)
            || examination.sign.as_ref().is_some_and(TorqueSignCheck::is_reversed)
            || break_limits(&training, robot.model())
            || held_out.iter().any(|log| is_far_worse(&log.validation, &estimate.joint_sigma))
    };
    let plain = training.columns.is_plain().then(|| &estimate.values[..training.columns.base()]);
    let own_terms = training.friction_choice.is_empty();
    let diagnosis = match settings.diagnosis {
        DiagnosisChoice::Never => None,
        _ if held || have_jumps(&training) => None,
        DiagnosisChoice::WhenDoubtful if !is_doubted() => None,
        DiagnosisChoice::WhenDoubtful | DiagnosisChoice::Always => {
            let (logs, theta) = (&logs, plain.filter(|_| own_terms));
            Some(diagnose(DiagnosisTask { logs, settings, robot: &robot, training: &chosen, theta })?)
        }
    };
    times.estimation_s += estimation_s;
    times.examination_s = started.elapsed().as_secs_f64() - estimation_s;
    let of_arm = job.arm().map_or_else(Vec::new, |arm| arm.held(&training.model, &training.columns));
    let gain_std = if settings.gains == GainChoice::Stated { settings.gain_std } else { 0.0 };
    let gain_error = gain_error(&training.problem, &training.columns, &estimate, &of_arm, gain_std)?;
    let with_gains = ErrorBars::default().with(ErrorSource::Gains, gain_error).total(&estimate);
    Ok(Identification {
        payloads: payload_results(recordings, payloads, &chosen, &training.columns, &with_gains),
        motion: logs.motion.clone(),
        cutoff,
        motion_hz: logs.motion_hz(),
        drive_inertia,
        training,
        estimator: settings.estimation.estimator.clone(),
        estimation,
        bars,
        estimate,
        essential: dropped,
        consistent,
        examination,
        held_out,
        diagnosis,
        torque_lag: lag,
        between_logs,
        times,
    })
}

/// Times the noise of the fit that a held-out log may be worse before it gives reason to doubt: friction that changes
/// with the motion costs less.
const FAR_WORSE: f64 = 1.7;

/// Whether a held-out log is far worse explained than the training logs, joints in units of their own noise.
fn is_far_worse(log: &LogValidation, sigma: &[f64]) -> bool {
    let in_fit_band = log.in_fit_band.as_ref().unwrap_or(&log.model);
    let joints = in_fit_band.joints.iter().zip(sigma).filter(|(_, sigma)| **sigma > 0.0);
    let squares: Vec<f64> = joints.map(|(joint, sigma)| (joint.rmse_nm / sigma).powi(2)).collect();
    squares.iter().sum::<f64>() > FAR_WORSE * FAR_WORSE * squares.len() as f64
}

/// The arm's bodies are those of the earlier result; what the estimate of payloads says of them is the set nearest to
/// the nominal one.
fn held_arm(task: &IdentificationTask, training: &Training, estimate: &Estimate) -> ConsistentParameters {
    let robot = &training.model.parametric;
    let settings = task.settings.consistency.as_ref();
    ConsistentParameters {
        fit: None,
        failure: Some("the arm is known from an earlier result, which has its bodies and its URDF".to_owned()),
        parameters: nearest_to_nominal(robot, &estimate.values[..training.columns.base()]),
        parameter_std: vec![None; robot.nominal().len()],
        intervals: None,
        inconsistent_nominal: settings.map_or_else(Vec::new, |settings| inconsistent_nominal_bodies(robot, settings)),
    }
}

/// Consistent parameters for an estimate over the columns of `training`: the best set, and its intervals if asked for.
///
/// # Errors
/// Factors that do not belong to the estimate, intervals that cannot be had. That there is no consistent set is part of
/// the result.
pub fn consistent_stage(
    logs: &Logs<'_>,
    settings: &IdentificationSettings,
    training: &Training,
    estimate: &Estimate,
) -> Result<ConsistentParameters, IdentificationError> {
    let robot = &training.model.parametric;
    let (alone, arm) = arm_alone(training, estimate)?;
    let problem = alone.as_ref().unwrap_or(&training.problem);
    let plain = settings.estimation.estimator.is_plain();
    let fit =
        settings.consistency.as_ref().map(|knowledge| consistent_with_estimate(robot, problem, &arm, plain, knowledge));
    let (fit, failure) = match fit.transpose() {
        Ok(fit) => (fit, None),
        Err(reason) => (None, Some(reason.to_string())),
    };
    let intervals = match &settings.consistency {
        // Where there is no consistent set, `failure` says why.
        Some(knowledge) if settings.intervals && fit.is_some() => {
            let progress = logs.execution.progress;
            let found = consistent_intervals(robot, problem, &arm, plain, knowledge, progress);
            Some(found.map_err(|reason: ConsistencyError| IdentificationError::Intervals(reason))?)
        }
        _ => None,
    };
    let parameters = fit.as_ref().map(|fit| fit.parameters.clone());
    let knowledge = settings.consistency.as_ref();
    // A fit that succeeded has a problem that is one.
    let parameter_std = match knowledge.filter(|_| fit.is_some()) {
        Some(knowledge) => parameter_std(robot, problem, &arm, knowledge).map_err(IdentificationError::Consistency)?,
        None => vec![None; robot.nominal().len()],
    };
    Ok(ConsistentParameters {
        parameters: parameters.unwrap_or_else(|| nearest_to_nominal(robot, &arm.values)),
        parameter_std,
        inconsistent_nominal: knowledge
            .map_or_else(Vec::new, |knowledge| inconsistent_nominal_bodies(robot, knowledge)),
        fit,
        failure,
        intervals,
    })
}

/// The problem and the estimate without the columns of payloads and offsets of single logs; `None` where the problem
/// has none.
fn arm_alone(
    training: &Training,
    estimate: &Estimate,
) -> Result<(Option<LinearProblem>, Estimate), IdentificationError> {
    let columns = &training.columns;
    let alone = (!columns.is_plain()).then(|| columns.arm_problem(&training.problem, &estimate.values)).transpose()?;
    Ok((alone, columns.arm_estimate(estimate)))
}

/// How well consistent sets explain the torque with either sign, none where a fit fails; and the sign of each joint's
/// friction.
fn torque_signs(
    training: &Training,
    estimate: &Estimate,
) -> Result<(Option<TorqueSignCheck>, Vec<FrictionSign>), IdentificationError> {
    let (alone, arm) = arm_alone(training, estimate)?;
    let problem = alone.as_ref().unwrap_or(&training.problem);
    let frictions = friction_signs(&training.model, problem, &arm);
    Ok((sign_evidence(&training.model.parametric, problem, &arm), frictions))
}

/// [`examine_training`] of every training recording, side by side.
fn examine_all_training(
    logs: &Logs<'_>,
    settings: &IdentificationSettings,
    training: &Training,
    estimate: &Estimate,
) -> Result<TrainingExamination, IdentificationError> {
    let one = |log: &crate::training::LogFactors| {
        let theta = training.columns.base_values(log.index, &estimate.values);
        examine_training(logs, &settings.estimation, &training.model, log.index, &theta)
    };
    let found: Vec<_> = if logs.execution.parallel() {
        training.logs.par_iter().map(one).collect::<Result<_, _>>()?
    } else {
        training.logs.iter().map(one).collect::<Result<_, _>>()?
    };
    let (delays, traces): (Vec<Vec<Option<TorqueLag>>>, Vec<LogTrace>) = found.into_iter().unzip();
    let of_joint = |joint: usize| -> Vec<TorqueLag> { delays.iter().filter_map(|log| log[joint]).collect() };
    let pooled_delays = (0..training.model.dof()).map(|joint| pooled_delay(&of_joint(joint))).collect();
    Ok(TrainingExamination { delays, traces, pooled_delays, sign: None, friction_signs: Vec::new() })
}

/// Blocks of time that the training logs are cut into, for how well each is predicted by the fit to the others: large
/// enough that warmth and other motion tell them apart.
const LEFT_OUT_BLOCKS: usize = 4;

/// [`examine_held_out`] of every recording to test on, side by side.
fn examine_all_held_out(
    logs: &Logs<'_>,
    settings: &IdentificationSettings,
    training: &Training,
    estimate: &Estimate,
    physical: Option<&[f64]>,
) -> Result<Vec<HeldOutExamination>, IdentificationError> {
    let columns = &training.columns;
    let held_out = logs.of_role(Role::Validate);
    let ratios =
        if held_out.is_empty() { Vec::new() } else { left_out_ratios(&training.problem, estimate, LEFT_OUT_BLOCKS)? };
    let one = |&index: &usize| -> Result<_, IdentificationError> {
        let theta = columns.base_values(index, &estimate.values);
        let uncertainty = Uncertainty::of(estimate, columns.base_covariance(index, &estimate.covariance), &ratios);
        let physical =
            physical.map(|values| columns.base_values(index, &[values, &estimate.values[columns.base()..]].concat()));
        let tested = ModelUnderTest {
            theta: &theta,
            physical: physical.as_deref(),
            uncertainty: Some(&uncertainty),
            traced: true,
        };
        Ok(tested_on(logs, &settings.estimation, &training.model, index, &tested, held_out.len() == 1)?)
    };
    if held_out.is_empty() {
        return Ok(Vec::new());
    }
    let names: Vec<&str> = held_out.iter().map(|&index| &logs.recordings[index].name[..]).collect();
    logs.begin(&format!("testing on {}", names.join(", ")), &held_out);
    let tested = if logs.execution.parallel() {
        held_out.par_iter().map(one).collect()
    } else {
        held_out.iter().map(one).collect()
    };
    logs.end();
    tested
}
