//! Stages after the estimate: physically consistent parameters, examination, held-out tests, diagnosis.

use crate::changes::{Differences, RestoredBody, knowledge_of, restored_errors};
use crate::consistent::{
    ConsistencyError, ConsistencySettings, ParameterInterval, consistent_intervals, consistent_with_estimate,
    inconsistent_nominal_bodies, nearest_to_nominal, parameter_std,
};
use crate::diagnosis::{Diagnosis, DiagnosisTask, diagnose};
use crate::doubt::{break_limits, have_jumps, is_doubtful};
use crate::error::IdentificationError;
use crate::events::{RecordingEvents, left_out, without_intervals};
use crate::examination::{
    FrictionSign, HeldOutExamination, LogTrace, LogValidation, ModelUnderTest, PositionTorque, TorqueLag,
    TorqueSignCheck, Uncertainty, WithoutEvents, examine_training, friction_signs, pooled_delay, position_torques,
    sign_evidence, tested_on,
};
use crate::settings::{DiagnosisChoice, IdentificationSettings};
use crate::task::{IdentificationTask, logs_without_payload};
use crate::thresholds::DescriptionThresholds;
use crate::training::Training;
use dynident_dynamics::ParametricModel;
use dynident_estimation::consistent::{PhysicalFit, PhysicalStatus};
use dynident_estimation::{Estimate, LinearProblem, left_out_ratios};
use dynident_rows::{Execution, Logs, Role};
use nalgebra::{DMatrix, DVector};
use std::time::Instant;

/// Physically consistent parameters of an estimate.
#[derive(Clone, Debug)]
pub struct ConsistentParameters {
    /// The physically consistent set with the best fit; `None` if not requested or not found.
    pub fit: Option<PhysicalFit>,
    /// Reason why there is no physically consistent set.
    pub failure: Option<String>,
    /// All parameters: ten for each body, then one for each friction or drive term. They are those of the physically
    /// consistent set. Without such a set, they are the set that has the estimated base parameters and is nearest to
    /// the nominal values.
    pub parameters: Vec<f64>,
    /// Standard deviation of each of `parameters` ([`parameter_std`]); `None` without a physically consistent set, and
    /// for bodies without nominal inertia.
    pub parameter_std: Vec<Option<f64>>,
    /// Which bodies differ from the robot description; `None` without a description of all bodies.
    pub differences: Option<Differences>,
    /// Whether the physically consistent set follows an explanation of these differences by one or two bodies, so that
    /// the other bodies keep the values of the description.
    pub follows_explanation: bool,
    /// Torque error for each body if the body gets the values of the description again; empty without `differences`.
    pub restored: Vec<RestoredBody>,
    /// Intervals of all parameters over all physically consistent sets that the data do not reject; `None` unless
    /// requested.
    pub intervals: Option<Vec<ParameterInterval>>,
    /// Bodies whose nominal inertia is not physically consistent, with the smallest eigenvalue of their pseudo-inertia.
    pub inconsistent_nominal: Vec<(String, f64)>,
}

/// Tests of the estimate on the training recordings.
#[derive(Clone, Debug)]
pub struct TrainingExamination {
    /// Lag of the torque in each training recording, by joint; `None` if not determined.
    pub delays: Vec<Vec<Option<TorqueLag>>>,
    /// Measured and predicted torque of each training recording over time.
    pub traces: Vec<LogTrace>,
    /// Lag of the torque over all recordings together, by joint.
    pub pooled_delays: Vec<Option<TorqueLag>>,
    /// Residuals of physically consistent sets for both signs of the torque; `None` if a fit fails, and for payloads.
    pub sign: Option<TorqueSignCheck>,
    /// Mean friction of every joint with friction terms; empty for payloads on a known arm.
    pub friction_signs: Vec<FrictionSign>,
    /// Joints whose unexplained torque is a function of their position.
    pub position_torques: Vec<PositionTorque>,
}

pub(crate) struct Stage<'a> {
    pub(crate) task: &'a IdentificationTask,
    pub(crate) execution: Execution<'a>,
    pub(crate) logs: &'a Logs<'a>,
    pub(crate) settings: &'a IdentificationSettings,
    pub(crate) training: &'a Training,
    pub(crate) estimate: &'a Estimate,
    /// Rows and fit with the friction that the study states, if friction was selected.
    pub(crate) stated_friction: Option<&'a (Training, Estimate)>,
    /// Whether the arm's parameters come from an earlier result.
    pub(crate) arm_is_known: bool,
    /// Time at which the estimate was finished.
    pub(crate) started: Instant,
}

pub(crate) struct Examined {
    pub(crate) consistent: ConsistentParameters,
    /// Time from the estimate to the physically consistent parameters, s.
    pub(crate) estimation_s: f64,
    pub(crate) held_out: Vec<HeldOutExamination>,
    pub(crate) examination: TrainingExamination,
}

impl Stage<'_> {
    /// Computes the physically consistent parameters and all tests, in parallel if the execution allows it.
    pub(crate) fn examined(&self) -> Result<Examined, IdentificationError> {
        let Self { task, logs, settings, training, estimate, .. } = *self;
        let bodies = || -> Result<_, IdentificationError> {
            let consistent = if self.arm_is_known {
                held_arm(task, training, estimate)
            } else {
                consistent_stage(logs, settings, training, estimate)?
            };
            let estimation_s = self.started.elapsed().as_secs_f64();
            let physical = consistent.fit.as_ref().map(|fit| &fit.base_values[..]);
            let held_out = examine_all_held_out(logs, settings, training, estimate, physical);
            Ok((consistent, estimation_s, held_out))
        };
        // The sign is tested with the stated terms, because the selection drops friction terms with a wrong sign.
        let signs = || match self.stated_friction {
            _ if self.arm_is_known => Ok((None, Vec::new())),
            Some((stated, plain)) => torque_signs(stated, plain),
            None => torque_signs(training, estimate),
        };
        let examined = || examine_all_training(logs, settings, training, estimate);
        let (bodies, (signs, examined)) = if self.execution.parallel() {
            rayon::join(bodies, || rayon::join(signs, examined))
        } else {
            (bodies(), (signs(), examined()))
        };
        let (consistent, estimation_s, held_out) = bodies?;
        let (sign, friction_signs) = signs?;
        let examination = TrainingExamination { sign, friction_signs, ..examined? };
        Ok(Examined { consistent, estimation_s, held_out: held_out?, examination })
    }

    /// Tests the held-out logs again without the intervals of clear events.
    pub(crate) fn test_without_events(
        &self,
        examined: &mut Examined,
        events: &[RecordingEvents],
    ) -> Result<(), IdentificationError> {
        let Self { task, logs, settings, training, estimate, .. } = *self;
        let Some(recordings) = without_intervals(&task.recordings, events, Role::Validate) else { return Ok(()) };
        let logs = &logs.with_recordings(&recordings);
        let physical = examined.consistent.fit.as_ref().map(|fit| &fit.base_values[..]);
        for held_out in &mut examined.held_out {
            let index = held_out.index;
            let Some(of_log) = events.iter().find(|of_log| of_log.index == index) else { continue };
            let left_out_s = left_out(&of_log.search);
            if left_out_s.is_empty() {
                continue;
            }
            let (theta, physical) = values_of_log(training, estimate, physical, index);
            let tested = ModelUnderTest {
                theta: &theta,
                physical: physical.as_deref(),
                uncertainty: None,
                traced: false,
                offset_share: settings.held_out_offset_share(),
            };
            let limits = (&settings.estimation, &settings.examination);
            let LogValidation { model, physical, .. } =
                tested_on(logs, limits, &training.model, index, &tested, false)?.validation;
            let set_aside = of_log.search.events.iter().filter(|event| event.set_aside);
            let left_out_share = set_aside.map(|event| event.share).sum();
            held_out.validation.without_events = Some(WithoutEvents { left_out_s, left_out_share, model, physical });
        }
        Ok(())
    }

    /// Tests hypotheses about mistakes in the study, if the settings require it or the examination shows that the fit
    /// is doubtful.
    pub(crate) fn diagnosis(
        &self,
        examined: &Examined,
        robot: &ParametricModel,
        chosen: &[usize],
    ) -> Result<Option<Diagnosis>, IdentificationError> {
        let Self { logs, settings, training, estimate, .. } = *self;
        let plain = training.columns.is_plain().then(|| &estimate.values[..training.columns.base()]);
        settings.examination.validate()?;
        let own_terms = training.friction_choice.is_empty();
        match settings.diagnosis {
            DiagnosisChoice::Never => Ok(None),
            _ if self.arm_is_known || have_jumps(training) => Ok(None),
            DiagnosisChoice::WhenDoubtful if !self.is_doubted(examined, robot) => Ok(None),
            DiagnosisChoice::WhenDoubtful | DiagnosisChoice::Always => {
                let theta = plain.filter(|_| own_terms);
                let bare = logs_without_payload(logs.recordings, chosen);
                Ok(Some(diagnose(DiagnosisTask { logs, settings, robot, training: &bare, theta })?))
            }
        }
    }

    fn is_doubted(&self, examined: &Examined, robot: &ParametricModel) -> bool {
        let Examined { consistent, held_out, examination, .. } = examined;
        let (training, limits) = (self.training, &self.settings.examination);
        let theta = consistent.fit.as_ref().map(|fit| &fit.base_values[..]);
        let agreements = || training.logs.iter().filter_map(|log| log.nominal_agreement.as_ref());
        let doubt = &self.settings.thresholds.doubt;
        is_doubtful(training, theta, doubt)
            || examination.friction_signs.iter().any(|sign| sign.is_reversed_by(limits))
            || agreements().any(|log| log.is_reversed_by(limits) || log.is_poor_by(limits))
            || examination.sign.as_ref().is_some_and(|sign| sign.is_reversed_by(limits))
            || break_limits(training, robot.model(), &self.settings.diagnosis_limits.motion)
            || held_out
                .iter()
                .any(|log| is_far_worse(&log.validation, &self.estimate.joint_sigma, doubt.max_held_out_ratio))
    }
}

/// Whether the residual on a held-out log is larger than the noise of the joints by more than the factor `max_ratio`,
/// root mean square over the joints.
fn is_far_worse(log: &LogValidation, sigma: &[f64], max_ratio: f64) -> bool {
    let in_fit_band = log.in_fit_band.as_ref().unwrap_or(&log.model);
    let joints = in_fit_band.joints.iter().zip(sigma).filter(|(_, sigma)| **sigma > 0.0);
    let squares: Vec<f64> = joints.map(|(joint, sigma)| (joint.rmse_nm / sigma).powi(2)).collect();
    squares.iter().sum::<f64>() > max_ratio * max_ratio * squares.len() as f64
}

/// Parameters of the bodies of a known arm: the set that has the estimated base parameters and is nearest to the
/// nominal values. (The physically consistent set belongs to the earlier result.)
fn held_arm(task: &IdentificationTask, training: &Training, estimate: &Estimate) -> ConsistentParameters {
    let robot = &training.model.parametric;
    let settings = task.settings.consistency.as_ref();
    ConsistentParameters {
        fit: None,
        failure: Some("the arm is known from an earlier result, which contains its bodies and its URDF".to_owned()),
        parameters: nearest_to_nominal(robot, &estimate.values[..training.columns.base()]),
        parameter_std: vec![None; robot.nominal().len()],
        differences: None,
        follows_explanation: false,
        restored: Vec::new(),
        intervals: None,
        inconsistent_nominal: settings.map_or_else(Vec::new, |settings| inconsistent_nominal_bodies(robot, settings)),
    }
}

/// Computes physically consistent parameters for an estimate with the columns of `training`: the best set, and its
/// intervals if requested. If there is no physically consistent set, this is not an error; the result contains the
/// reason.
///
/// # Errors
/// The factors do not belong to the estimate, or the intervals cannot be computed.
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
    let knowledge = settings.consistency.as_ref();
    let fit = knowledge.map(|knowledge| consistent_with_estimate(robot, problem, &arm, plain, knowledge));
    let (fit, failure) = match fit.transpose() {
        Ok(fit) => (fit, None),
        Err(reason) => (None, Some(reason.to_string())),
    };
    let limits = &settings.thresholds.description;
    let differences = match knowledge.filter(|_| fit.is_some()) {
        Some(knowledge) => description_differences(robot, &arm, knowledge, limits),
        None => None,
    };
    let followed = knowledge.zip(differences.as_ref()).zip(fit.as_ref()).and_then(|((knowledge, differences), fit)| {
        let own = knowledge_of(differences, differences.followed(limits)?, robot, knowledge, limits);
        let followed = consistent_with_estimate(robot, problem, &arm, plain, &own).ok()?;
        is_as_good(&followed, fit, &arm).then_some(followed)
    });
    let follows_explanation = followed.is_some();
    let fit = followed.or(fit);
    let intervals = match &settings.consistency {
        // If there is no physically consistent set, `failure` contains the reason.
        Some(knowledge) if settings.intervals && fit.is_some() => {
            let progress = logs.execution.progress;
            let found = consistent_intervals(robot, problem, &arm, plain, knowledge, progress);
            Some(found.map_err(|reason: ConsistencyError| IdentificationError::Intervals(reason))?)
        }
        _ => None,
    };
    let parameters = fit.as_ref().map(|fit| fit.parameters.clone());
    // After a successful fit, the problem is known to be valid.
    let mut parameter_std = match knowledge.filter(|_| fit.is_some()) {
        Some(knowledge) => parameter_std(robot, problem, &arm, knowledge).map_err(IdentificationError::Consistency)?,
        None => vec![None; robot.nominal().len()],
    };
    let mut restored = Vec::new();
    if let Some((differences, written)) = differences.as_ref().zip(parameters.as_ref())
        && let Some(uncertainty) = differences.uncertainty(written, robot.nominal())
    {
        for (std, averaged) in parameter_std.iter_mut().zip(uncertainty.std()) {
            *std = Some(averaged);
        }
        restored = restored_errors(differences, &uncertainty, robot, problem, written, limits);
    }
    Ok(ConsistentParameters {
        parameters: parameters.unwrap_or_else(|| nearest_to_nominal(robot, &arm.values)),
        parameter_std,
        differences,
        follows_explanation,
        restored,
        inconsistent_nominal: knowledge
            .map_or_else(Vec::new, |knowledge| inconsistent_nominal_bodies(robot, knowledge)),
        fit,
        failure,
        intervals,
    })
}

/// Explanations of the difference between an estimate and the robot description; `None` without a complete description,
/// and if the covariance is singular.
fn description_differences(
    robot: &ParametricModel,
    arm: &Estimate,
    knowledge: &ConsistencySettings,
    limits: &DescriptionThresholds,
) -> Option<Differences> {
    let is_fixed = |row: &usize| arm.rank.fixed.iter().any(|fixed| fixed.column == *row);
    let rows: Vec<usize> = (0..robot.base().count()).filter(|row| !is_fixed(row)).collect();
    let values = DVector::from_fn(rows.len(), |k, _| arm.values[rows[k]]);
    let all = arm.joint_covariance();
    let covariance = DMatrix::from_fn(rows.len(), rows.len(), |a, b| all[(rows[a], rows[b])]);
    Differences::from_description(robot, &rows, &values, &covariance, knowledge, limits).ok().flatten()
}

/// Whether a physically consistent set that follows an explanation (`followed`) fits the logs as well as the set
/// without it (`fit`): the logs do not contradict it, or not more than the other set.
fn is_as_good(followed: &PhysicalFit, fit: &PhysicalFit, arm: &Estimate) -> bool {
    let is_rejected = followed.difference(arm).is_none_or(|test| test.is_significant);
    followed.status == PhysicalStatus::Solved && (!is_rejected || followed.moved_sigma <= fit.moved_sigma)
}

/// The problem and the estimate without the columns of payloads and offsets of single logs. The problem is `None` if it
/// has no such columns.
fn arm_alone(
    training: &Training,
    estimate: &Estimate,
) -> Result<(Option<LinearProblem>, Estimate), IdentificationError> {
    let columns = &training.columns;
    let alone = (!columns.is_plain()).then(|| columns.arm_problem(&training.problem, &estimate.values)).transpose()?;
    Ok((alone, columns.arm_estimate(estimate)))
}

/// Residuals of physically consistent sets for both signs of the torque (`None` if a fit fails), and the sign of each
/// joint's friction.
fn torque_signs(
    training: &Training,
    estimate: &Estimate,
) -> Result<(Option<TorqueSignCheck>, Vec<FrictionSign>), IdentificationError> {
    let (alone, arm) = arm_alone(training, estimate)?;
    let problem = alone.as_ref().unwrap_or(&training.problem);
    let frictions = friction_signs(&training.model, problem, &arm);
    Ok((sign_evidence(&training.model.parametric, problem, &arm), frictions))
}

/// Calls [`examine_training`] for every training recording, in parallel if possible.
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
    let found: Vec<_> = logs.execution.try_map(&training.logs, one)?;
    let (delays, traces): (Vec<Vec<Option<TorqueLag>>>, Vec<LogTrace>) = found.into_iter().unzip();
    let of_joint = |joint: usize| -> Vec<TorqueLag> { delays.iter().filter_map(|log| log[joint]).collect() };
    let pooled_delays = (0..training.model.dof()).map(|joint| pooled_delay(&of_joint(joint))).collect();
    let chosen: Vec<usize> = training.logs.iter().map(|log| log.index).collect();
    // With payloads or offsets of single logs, the torque would need further columns.
    let is_plain = training.columns.is_plain();
    let chosen = if is_plain { &chosen[..] } else { &[] };
    let position_torques = position_torques(logs, &training.model, chosen, &settings.examination)?;
    Ok(TrainingExamination { delays, traces, pooled_delays, sign: None, friction_signs: Vec::new(), position_torques })
}

/// Base parameters for a log: those of the estimate, and those of the physically consistent set if there is one.
fn values_of_log(
    training: &Training,
    estimate: &Estimate,
    physical: Option<&[f64]>,
    index: usize,
) -> (Vec<f64>, Option<Vec<f64>>) {
    let columns = &training.columns;
    let further = &estimate.values[columns.base()..];
    let physical = physical.map(|values| columns.base_values(index, &[values, further].concat()));
    (columns.base_values(index, &estimate.values), physical)
}

/// Number of time blocks of the training logs, for factors on the error band: each block is predicted by the fit to the
/// other blocks. With few blocks, temperature and motion differ between blocks as they do between logs.
const VALIDATION_BLOCKS: usize = 4;

/// Calls [`examine_held_out`] for every held-out recording, in parallel if possible.
fn examine_all_held_out(
    logs: &Logs<'_>,
    settings: &IdentificationSettings,
    training: &Training,
    estimate: &Estimate,
    physical: Option<&[f64]>,
) -> Result<Vec<HeldOutExamination>, IdentificationError> {
    let held_out = logs.of_role(Role::Validate);
    let ratios =
        if held_out.is_empty() { Vec::new() } else { left_out_ratios(&training.problem, estimate, VALIDATION_BLOCKS)? };
    let one = |&index: &usize| -> Result<_, IdentificationError> {
        let columns = &training.columns;
        let (theta, physical) = values_of_log(training, estimate, physical, index);
        let uncertainty = Uncertainty::of(estimate, columns.base_covariance(index, &estimate.covariance), &ratios);
        let tested = ModelUnderTest {
            theta: &theta,
            physical: physical.as_deref(),
            uncertainty: Some(&uncertainty),
            traced: true,
            offset_share: settings.held_out_offset_share(),
        };
        Ok(tested_on(
            logs,
            (&settings.estimation, &settings.examination),
            &training.model,
            index,
            &tested,
            held_out.len() == 1,
        )?)
    };
    if held_out.is_empty() {
        return Ok(Vec::new());
    }
    let names: Vec<&str> = held_out.iter().map(|&index| &logs.recordings[index].name[..]).collect();
    logs.begin(&format!("testing on {}", names.join(", ")), &held_out);
    let tested = logs.execution.try_map(&held_out, one);
    logs.end();
    tested
}
