use crate::estimation::estimate::RunEstimate;
use crate::evidence::run_evidence::Clipping;
use crate::policy::convergence::{Names, shortfalls, stands_still};
use crate::policy::record::RunRecord;
use crate::setup::model_parameters::ModelParameters;
use crate::setup::settings::{IterationSettings, StartWith};
use crate::setup::status::IterationStatus;
use crate::setup::verdict_settings::VerdictSettings;
use crate::torque_check::TorqueCause;
use dynident_simulation::PerJoint;
use dynident_simulation::controllers::{ControllerSettings, JointPdSettings, JointPidSettings};
use thiserror::Error;

/// The next step.
#[derive(Clone, Debug, PartialEq)]
pub enum Next {
    /// Make this run.
    Run(RunPlan),
    /// The iteration has ended.
    Finished(IterationStatus),
}

/// A planned run.
#[derive(Clone, Debug, PartialEq)]
pub struct RunPlan {
    /// Number of the run, from 1.
    pub run: usize,
    /// Model of the controller; `None` for the controller without a model.
    pub model: Option<ModelParameters>,
    /// Share of the change from the last good parameters to the new parameters.
    pub damping: f64,
    /// Factor on the gains of the controller without a model.
    pub stiffness: f64,
}

impl RunPlan {
    fn with_model(run: usize, model: ModelParameters, damping: f64) -> Self {
        Self { run, model: Some(model), damping, stiffness: 1.0 }
    }

    /// Returns the settings of its controller.
    pub fn controller(&self, settings: &IterationSettings) -> ControllerSettings {
        if self.model.is_some() {
            let first = settings.first.as_ref().filter(|_| self.run == 1);
            return first.unwrap_or(&settings.controller).clone();
        }
        stiffened(&settings.model_free, self.stiffness)
    }
}

/// Plans the run after `records`, or returns how the iteration has ended. `prior` are the nominal parameters.
pub(crate) fn next(records: &[RunRecord], settings: &IterationSettings, prior: &[f64], names: &Names) -> Next {
    let run = records.len() + 1;
    let model_free = |stiffness| Next::Run(RunPlan { run, model: None, damping: 1.0, stiffness });
    let Some(last) = records.last() else {
        return match settings.start {
            StartWith::ModelFree => model_free(1.0),
            StartWith::Prior => {
                let own = settings.first_model.as_deref().unwrap_or(prior);
                Next::Run(RunPlan::with_model(run, ModelParameters::All(own.to_vec()), 1.0))
            }
        };
    };
    if let Some(cause) = last.torque_causes().iter().find(|cause| cause.is_determined()) {
        return Next::Finished(IterationStatus::Refused { reason: wrong_torque(last, cause) });
    }
    let newest = model_of(last);
    if shortfalls(records, settings, names).is_empty() {
        return Next::Finished(IterationStatus::Converged);
    }
    // Two unchanged results are required, because the second of two such runs used the model of the first.
    let earlier = &records[..records.len() - 1];
    if stands_still(records, settings, names) && (!settings.reject || stands_still(earlier, settings, names)) {
        return Next::Finished(IterationStatus::Settled);
    }
    if !settings.reject {
        return match newest {
            _ if run > settings.max_runs => Next::Finished(IterationStatus::RunsUsedUp),
            Some(model) if last.done => Next::Run(RunPlan::with_model(run, model, 1.0)),
            _ => Next::Finished(IterationStatus::Refused { reason: failed(last) }),
        };
    }
    let free_failures = records.iter().filter(|record| record.controller.model.is_none() && !record.accepted).count();
    if free_failures >= settings.most_model_free {
        return Next::Finished(IterationStatus::Refused { reason: failed(last) });
    }
    if run > settings.max_runs {
        return Next::Finished(IterationStatus::RunsUsedUp);
    }
    // A model that was rejected is not used again.
    let untried = |model: &ModelParameters| {
        !records.iter().any(|record| !record.accepted && record.controller.model.as_ref() == Some(model))
    };
    let trusted = most_trusted(records, &settings.settled.verdict).and_then(model_of);
    if let Some(model) = trusted.into_iter().chain(newest.filter(|_| last.accepted)).find(untried) {
        return Next::Run(RunPlan::with_model(run, model, 1.0));
    }
    // After a rejection the next model is between the rejected and the last good model, if there is one.
    let since = records.iter().rposition(|record| record.accepted).map_or(0, |place| place + 1);
    let rejected = &records[since..];
    let good = records[..since].iter().rev().find_map(|record| record.controller.model.clone());
    let new = rejected.first().and_then(|record| record.controller.model.clone());
    let halvings = rejected.len();
    if let (Some(good), Some(new)) = (good, new)
        && halvings <= settings.most_halvings
        && rejected.iter().all(|record| record.controller.model.is_some())
    {
        let share = 0.5_f64.powi(halvings as i32);
        return Next::Run(RunPlan::with_model(run, ModelParameters::between(&good, &new, share), share));
    }
    if let Some(clipped) =
        rejected.iter().rev().find_map(|record| helpless(record, settings.settled.verdict.min_saturated_share, names))
    {
        return Next::Finished(IterationStatus::Refused { reason: clipped });
    }
    let before = records.iter().filter(|record| record.controller.model.is_none()).count();
    model_free(settings.stiffen.powi(before as i32))
}

/// Returns a further run, for an additional motion after all conditions are met; `None` if no run has a model.
pub(crate) fn further(records: &[RunRecord], thresholds: &VerdictSettings) -> Option<RunPlan> {
    let model = most_trusted(records, thresholds).and_then(model_of)?;
    Some(RunPlan::with_model(records.len() + 1, model, 1.0))
}

fn model_of(record: &RunRecord) -> Option<ModelParameters> {
    record.knowledge().and_then(RunEstimate::for_controller)
}

/// Reports that a run with a model left its trajectory while its drives were saturated.
fn helpless(record: &RunRecord, min_saturated_share: f64, names: &Names) -> Option<String> {
    let joints = &record.evidence.as_ref().filter(|_| record.done && record.controller.model.is_some())?.joints;
    let clipped = joints.iter().enumerate().filter_map(|(joint, shown)| Some((joint, shown.clipping?)));
    let (joint, Clipping { share, torque, .. }) = clipped.max_by(|a, b| a.1.share.total_cmp(&b.1.share))?;
    (share >= min_saturated_share).then(|| {
        format!(
            "{}: the drive of joint {} was saturated at {torque:.3} Nm in {:.0} % of the samples: use a slower motion, or add a torque limit to [design.limits]",
            failed(record),
            names.joints[joint],
            100.0 * share
        )
    })
}

/// The run with the best estimate. This is the newest good run, unless its error bars are much wider than those of an
/// earlier run. A rejected run is used if its error bars are clearly narrower. Poor tracking indicates a bad model in
/// the controller, not a bad estimate: a joint with large tracking errors can be excited better than a joint that
/// hardly moves.
fn most_trusted<'r>(records: &'r [RunRecord], thresholds: &VerdictSettings) -> Option<&'r RunRecord> {
    records.iter().filter(|record| model_of(record).is_some()).reduce(|best, record| {
        let most = if record.accepted {
            thresholds.max_width_ratio_of_good_run
        } else {
            thresholds.max_width_ratio_of_rejected_run
        };
        let (Some(old), Some(new)) = (best.knowledge(), record.knowledge()) else { return best };
        if new.wider_than(old) <= most { record } else { best }
    })
}

#[derive(Clone, Debug, PartialEq, Error)]
pub(crate) enum Rejection {
    /// The run stopped early: a limit, a fault of the robot or a stop by the user. The message states which; remove
    /// this cause and run again.
    #[error("{outcome}")]
    NotDone { outcome: String },
    /// The log of the run does not determine the parameters. The message states why; usually the motion or the
    /// recording is too short.
    #[error("{reason}")]
    NoEstimate { reason: String },
    /// The logged torque contradicts every real robot. Check signs, scales and order of the logged torques.
    #[error("no physically consistent model fits the log of this run: {reason}")]
    Inconsistent { reason: String },
    /// The robot did not follow the motion closely enough to use this run. Use stiffer gains or a slower motion.
    #[error("joint {joint} left its trajectory: error {error:.3} rad, limit {limit:.3} rad")]
    LeftTrajectory { joint: String, error: f64, limit: f64 },
    /// The controller with the new model follows the motion worse than that of an earlier run, so the new model is
    /// probably wrong. Look at the torque log of this run.
    #[error("the tracking error grew from {then:.3e} rad to {now:.3e} rad")]
    TracksWorse { now: f64, then: f64 },
}

/// Accepts or rejects a run, given the previous runs. `following` is the tracking error of each joint above which the
/// joint has left its trajectory.
pub(crate) fn verdict(
    record: &RunRecord,
    before: &[RunRecord],
    settings: &IterationSettings,
    following: &[f64],
    names: &Names,
) -> Result<(), Rejection> {
    if !record.done {
        return Err(Rejection::NotDone { outcome: record.outcome.clone() });
    }
    let Some(estimate) = &record.estimate else {
        let reason = record.reason.clone().unwrap_or_else(|| "it has no estimate of the parameters".to_owned());
        return Err(Rejection::NoEstimate { reason });
    };
    if let Some(reason) = &estimate.impossible {
        return Err(Rejection::Inconsistent { reason: reason.clone() });
    }
    let beyond = record.max_tracking_error_rad.iter().zip(following).enumerate();
    if settings.reject
        && let Some((joint, (&error, &limit))) = beyond.into_iter().find(|(_, (error, limit))| error > limit)
    {
        return Err(Rejection::LeftTrajectory { joint: names.joints[joint].clone(), error, limit });
    }
    // Tracking errors of different motions are not comparable.
    let is_comparable = |good: &&RunRecord| good.accepted && good.motion == record.motion;
    let Some(good) = before.iter().rev().find(is_comparable) else { return Ok(()) };
    let (now, then) = (record.tracking_error(), good.tracking_error());
    let worst = (settings.worse_factor * then).max(settings.settled.tracking_tolerance);
    // The controller without a model is the fallback, so a run with it is not rejected for its tracking.
    if settings.reject && record.controller.model.is_some() && now > worst {
        return Err(Rejection::TracksWorse { now, then });
    }
    Ok(())
}

/// A model from a wrong torque log must not be loaded into a controller.
fn wrong_torque(record: &RunRecord, cause: &TorqueCause) -> String {
    format!("run {}: {cause}; {}, then restart with --fresh (in Python resume=False)", record.run, cause.remedy())
}

fn failed(record: &RunRecord) -> String {
    let reason = record.reason.clone().unwrap_or_else(|| record.outcome.clone());
    format!("run {} under {}: {reason}", record.run, record.controller.name)
}

/// Multiplies the stiffness by `factor` and the damping by its square root, so that the damping ratio does not
/// change.
fn stiffened(settings: &ControllerSettings, factor: f64) -> ControllerSettings {
    let times = |gains: &PerJoint, by: f64| match gains {
        PerJoint::All(gain) => PerJoint::All(by * gain),
        PerJoint::Each(gains) => PerJoint::Each(gains.iter().map(|gain| by * gain).collect()),
    };
    match settings {
        ControllerSettings::JointPd(pd) => {
            ControllerSettings::JointPd(JointPdSettings { kp: times(&pd.kp, factor), kd: times(&pd.kd, factor.sqrt()) })
        }
        ControllerSettings::JointPid(pid) => ControllerSettings::JointPid(JointPidSettings {
            kp: times(&pid.kp, factor),
            ki: times(&pid.ki, factor),
            kd: times(&pid.kd, factor.sqrt()),
            ..pid.clone()
        }),
        other => other.clone(),
    }
}
