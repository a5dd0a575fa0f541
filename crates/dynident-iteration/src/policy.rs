//! What the next run is: a pure function of the records so far.

use crate::convergence::{Names, shortfalls, stands_still};
use crate::estimate::RunEstimate;
use crate::evidence::Clipping;
use crate::model_parameters::ModelParameters;
use crate::record::RunRecord;
use crate::settings::{IterationSettings, StartWith};
use crate::status::IterationStatus;
use crate::torque_check::TorqueCause;
use dynident_simulation::PerJoint;
use dynident_simulation::controllers::{ControllerSettings, JointPdSettings, JointPidSettings};
use thiserror::Error;

/// A good run's estimate with error bars this many times wider than an earlier one's does not take its place.
const FAR_WIDER: f64 = 3.0;

/// A rejected run's estimate takes the place of a good one's where its error bars are this many times as wide.
const CLEARLY_NARROWER: f64 = 0.5;

/// A run that left its trajectory tells that no controller helps where so large a share of the samples of a joint
/// stands at the drive's limit.
const HELPLESS: f64 = 0.05;

/// What comes next.
#[derive(Clone, Debug, PartialEq)]
pub enum Next {
    /// A run.
    Run(RunPlan),
    /// Nothing.
    Finished(IterationStatus),
}

/// A run to be made.
#[derive(Clone, Debug, PartialEq)]
pub struct RunPlan {
    /// Its number, from 1.
    pub run: usize,
    /// The model of its controller; none for the controller without a model.
    pub model: Option<ModelParameters>,
    /// Share of the step from the last good parameters to the new ones.
    pub damping: f64,
    /// Factor of the gains of the controller without a model.
    pub stiffness: f64,
}

impl RunPlan {
    fn with_model(run: usize, model: ModelParameters, damping: f64) -> Self {
        Self { run, model: Some(model), damping, stiffness: 1.0 }
    }

    /// The controller's settings.
    pub fn controller(&self, settings: &IterationSettings) -> ControllerSettings {
        if self.model.is_some() {
            let first = settings.first.as_ref().filter(|_| self.run == 1);
            return first.unwrap_or(&settings.controller).clone();
        }
        stiffened(&settings.model_free, self.stiffness)
    }
}

/// The run after `records`, or how the iteration has ended. `prior` is what the robot is believed to be before any run.
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
    // Once more before it is said: the second of two runs that stand still was made with the model of the first.
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
    // A model that was tried and rejected is not tried again.
    let untried = |model: &ModelParameters| {
        !records.iter().any(|record| !record.accepted && record.controller.model.as_ref() == Some(model))
    };
    let trusted = most_trusted(records).and_then(model_of);
    if let Some(model) = trusted.into_iter().chain(newest.filter(|_| last.accepted)).find(untried) {
        return Next::Run(RunPlan::with_model(run, model, 1.0));
    }
    // Rejected: back towards the last good model, as long as there is one to go back to.
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
    if let Some(clipped) = rejected.iter().rev().find_map(|record| helpless(record, names)) {
        return Next::Finished(IterationStatus::Refused { reason: clipped });
    }
    let before = records.iter().filter(|record| record.controller.model.is_none()).count();
    model_free(settings.stiffen.powi(before as i32))
}

/// A further run after all is met, under what is known: for its motion alone. None where no run has a model to load.
pub(crate) fn further(records: &[RunRecord]) -> Option<RunPlan> {
    let model = most_trusted(records).and_then(model_of)?;
    Some(RunPlan::with_model(records.len() + 1, model, 1.0))
}

/// What a controller gets from a run.
fn model_of(record: &RunRecord) -> Option<ModelParameters> {
    record.knowledge().and_then(RunEstimate::for_controller)
}

/// What a run with a model that left its trajectory with its drives at their limits says of them.
fn helpless(record: &RunRecord, names: &Names) -> Option<String> {
    let joints = &record.evidence.as_ref().filter(|_| record.done && record.controller.model.is_some())?.joints;
    let clipped = joints.iter().enumerate().filter_map(|(joint, shown)| Some((joint, shown.clipping?)));
    let (joint, Clipping { share, torque, .. }) = clipped.max_by(|a, b| a.1.share.total_cmp(&b.1.share))?;
    (share >= HELPLESS).then(|| {
        format!(
            "{}: torque of joint {} stood at {torque:.3} Nm in {:.0} % of the samples, and no controller can ask its drive for more: give a slower motion, or a limit of torque in [design.limits]",
            failed(record),
            names.joints[joint],
            100.0 * share
        )
    })
}

/// The run whose estimate is worth most: the newest good one, unless its error bars are far wider than those of an
/// earlier run; and a rejected one where its error bars are clearly narrower. Bad tracking says that the model which
/// the run was made with is bad, not that the run determines little: a joint that is thrown about may determine more
/// than one that hardly moves.
fn most_trusted(records: &[RunRecord]) -> Option<&RunRecord> {
    records.iter().filter(|record| model_of(record).is_some()).reduce(|best, record| {
        let most = if record.accepted { FAR_WIDER } else { CLEARLY_NARROWER };
        let (Some(old), Some(new)) = (best.knowledge(), record.knowledge()) else { return best };
        if new.wider_than(old) <= most { record } else { best }
    })
}

/// Why a run does not count as good.
#[derive(Clone, Debug, PartialEq, Error)]
pub(crate) enum Rejection {
    /// It did not get to its end.
    #[error("{outcome}")]
    NotDone { outcome: String },
    /// It gave no estimate.
    #[error("{reason}")]
    NoEstimate { reason: String },
    /// No robot can have its parameters.
    #[error("no physically consistent set fits it: {reason}")]
    Inconsistent { reason: String },
    /// A joint left its trajectory, rad (m).
    #[error("joint {joint} left its trajectory: {error:.3} rad away, {limit:.3} still count as following")]
    LeftTrajectory { joint: String, error: f64, limit: f64 },
    /// It followed the reference worse than the last good run did, rad (m).
    #[error("it tracks worse: {now:.3e} rad after {then:.3e} rad")]
    TracksWorse { now: f64, then: f64 },
}

/// Whether a run counts as good beside those before it, and why not. `following` is the largest tracking error of each
/// joint that still counts as following.
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
        let reason = record.reason.clone().unwrap_or_else(|| "it says nothing of the parameters".to_owned());
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
    // Along another motion another error is to be expected.
    let alike = |good: &&RunRecord| good.accepted && good.motion == record.motion;
    let Some(good) = before.iter().rev().find(alike) else { return Ok(()) };
    let (now, then) = (record.tracking_error(), good.tracking_error());
    let worst = (settings.worse_factor * then).max(settings.settled.tracking_tolerance);
    // A controller without a model is what a bad one falls back to: its tracking is no reason to reject it.
    if settings.reject && record.controller.model.is_some() && now > worst {
        return Err(Rejection::TracksWorse { now, then });
    }
    Ok(())
}

/// A model that is identified from a wrong torque log must not be loaded into a controller.
fn wrong_torque(record: &RunRecord, cause: &TorqueCause) -> String {
    format!("run {}: {cause}; {}, then begin anew (--fresh)", record.run, cause.remedy())
}

fn failed(record: &RunRecord) -> String {
    let reason = record.reason.clone().unwrap_or_else(|| record.outcome.clone());
    format!("run {} under {}: {reason}", record.run, record.controller.name)
}

/// Stiffness grows as `factor`, damping as its root, so that the damping ratio stays.
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
