//! What an iteration still falls short of: converged is only what meets everything.

use crate::estimate::RunEstimate;
use crate::evidence::{Clipping, JointEvidence};
use crate::lengths::OtherLength;
use crate::record::RunRecord;
use crate::settings::{IterationSettings, SettledSettings};
use crate::torque_check::TorqueCause;
use dynident_identification::examination::{LagChoice, TorqueLag};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Samples at the drive's limit that a run may have, as a share: a limit that is touched at a reversal moves nothing.
const MOST_CLIPPED: f64 = 2e-3;

/// The share of the torque that a 95 % band has to hold, in a run that was not fitted to. Residuals that are correlated
/// over seconds let the share vary by some percent; a prediction that is off by its own noise throughout has 83 %.
const LEAST_INSIDE: f64 = 0.85;

/// Lags of two runs differ clearly beyond so many times the 95 % interval of their difference: with six joints in some
/// runs chance alone goes beyond once.
const CLEARLY_OTHER: f64 = 1.5;

/// What is not met after the last run, with its numbers; [`remedy`](Self::remedy) says what would help.
#[derive(Clone, Debug, PartialEq, Error, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "condition", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Shortfall {
    /// One good run cannot be compared with another.
    #[error("{good} good runs: nothing to compare the last one with")]
    TooFewRuns {
        /// How many there are.
        good: usize,
    },
    /// The last run does not count as good.
    #[error("the last run does not count: {reason}")]
    LastRunRejected {
        /// Why.
        reason: String,
    },
    /// The last run was under another controller than the model-based one with the whole of the newest model.
    #[error("the last run was not under the controller with the newest model")]
    NoModel,
    /// A run of an earlier version, without what the verdict rests on.
    #[error("run {run} was made by an earlier version, which did not keep what its log shows")]
    NoEvidence {
        /// The run.
        run: usize,
    },
    /// A joint was farther from its trajectory than asked, and than can be explained.
    #[error("joint {joint} was {error_rad:.2e} rad from its trajectory, asked is {tolerance_rad:.2e}{}", floor_words(*.floor_rad))]
    Tracking {
        /// The joint.
        joint: String,
        /// Its largest distance, rad (m).
        error_rad: f64,
        /// What was asked for.
        tolerance_rad: f64,
        /// What noise, friction and delay explain; none where that cannot be told.
        floor_rad: Option<f64>,
    },
    /// A parameter that the last run moved.
    #[error("{parameter} moved by {bars:.1} error bars with the last run, {allowed:.1} are allowed")]
    ParameterMoves {
        /// The base parameter.
        parameter: String,
        /// By how many error bars.
        bars: f64,
        /// How many count as standing still.
        allowed: f64,
    },
    /// A parameter that is hardly known.
    #[error(
        "the error bar of {parameter} makes {percent:.0} % of the torque of the largest parameter, {allowed_percent:.0} % are allowed"
    )]
    ParameterUncertain {
        /// The base parameter.
        parameter: String,
        /// The torque of its error bar (one standard deviation) as a share of what the largest parameter makes.
        percent: f64,
        /// The widest that is allowed.
        allowed_percent: f64,
    },
    /// Torque at the drive's limit.
    #[error("torque of joint {joint} stands at {torque:.3} Nm in {percent:.1} % of the samples: {}", clipping_words(*.stated))]
    Clipping {
        /// The joint.
        joint: String,
        /// Share of its samples.
        percent: f64,
        /// The torque, Nm (N).
        torque: f64,
        /// Whether it is a stated limit.
        stated: bool,
    },
    /// Torque and positions of the last log belong to different instants, by another lag than the one that was taken
    /// off.
    #[error("torque comes {:.1} +- {:.1} ms {} the motion at all joints (95 %), unexplained", 1e3 * .lag_s.abs(), 1e3 * .half_width_95_s, if *.lag_s > 0.0 { "after" } else { "before" })]
    Lag {
        /// What is left of the lag, s.
        lag_s: f64,
        /// Half the width of its 95 % interval.
        half_width_95_s: f64,
    },
    /// A compensated lag that is longer than allowed by more than its 95 % interval: the robot is not where the log
    /// shows it.
    #[error("torque and motion of the log are {:.1} ms apart, {:.1} ms are allowed", 1e3 * .lag_s, 1e3 * .allowed_s)]
    LongLag {
        /// The longest lag of a joint, s.
        lag_s: f64,
        /// What is allowed.
        allowed_s: f64,
    },
    /// A lag was taken off, but runs differ in it: a recorder's would be the same in all of them.
    #[error("what looks like a lag of joint {joint}'s torque is {:.1} ms in the last run and {:.1} ms in one before, +- {:.1} ms (95 %)", 1e3 * .lag_s, 1e3 * .before_s, 1e3 * .half_width_95_s)]
    LagChanges {
        /// The joint.
        joint: String,
        /// The lag of the last run, s.
        lag_s: f64,
        /// That of the good run that differs most.
        before_s: f64,
        /// Half the width of the 95 % interval of their difference.
        half_width_95_s: f64,
    },
    /// The model of the runs before does not predict the last one.
    #[error(
        "the model of the runs before holds {inside_percent:.0} % of joint {joint}'s torque in its 95 % band, off by {rms_error_nm:.3} Nm where the band is {half_width_nm:.3}"
    )]
    Prediction {
        /// The joint.
        joint: String,
        /// Share inside the band.
        inside_percent: f64,
        /// Root mean square error of the prediction, Nm (N).
        rms_error_nm: f64,
        /// Mean half width of the band.
        half_width_nm: f64,
    },
    /// No run of the held-out motion has judged the newest model yet.
    #[error("the newest model has not been judged by a run of the held-out motion")]
    NotHeldOut,
    /// The held-out motion was not run to its end, or its log tells nothing.
    #[error("the held-out run says nothing of the newest model: {reason}")]
    HeldOutFailed {
        /// Why.
        reason: String,
    },
    /// The newest model does not predict a motion that it was not fitted to.
    #[error(
        "on the held-out motion the newest model holds {inside_percent:.0} % of joint {joint}'s torque in its 95 % band, off by {rms_error_nm:.3} Nm where the band is {half_width_nm:.3}"
    )]
    HeldOutPrediction {
        /// The joint.
        joint: String,
        /// Share inside the band.
        inside_percent: f64,
        /// Root mean square error of the prediction, Nm (N).
        rms_error_nm: f64,
        /// Mean half width of the band.
        half_width_nm: f64,
    },
    /// Torque that no parameter of the model explains.
    #[error(
        "{percent:.1} % of joint {joint}'s torque is left unexplained beyond its noise, {allowed_percent:.1} % are allowed"
    )]
    Unexplained {
        /// The joint.
        joint: String,
        /// Share of its torque, of root mean squares.
        percent: f64,
        /// What is allowed.
        allowed_percent: f64,
    },
    /// Torque that another length of a link explains clearly better than the description's: another arm.
    #[error(
        "{}: {:.3} Nm of joint {}'s torque are then left in place of {:.3}", length_words(.0), .0.left_with_nm, .0.explained_joint, .0.left_nm
    )]
    Length(OtherLength),
    /// The logged torque is not the torque that the controller commanded.
    #[error("{0}")]
    Torque(TorqueCause),
}

fn length_words(other: &OtherLength) -> String {
    let OtherLength { joint, factor, .. } = other;
    match joint {
        Some(joint) => format!("joint {joint} is {factor:.2} times as far from the one before as described"),
        None => format!("all lengths are {factor:.2} times as described"),
    }
}

fn floor_words(floor_rad: Option<f64>) -> String {
    floor_rad.map_or_else(
        || "; what the loop could reach is not known".to_owned(),
        |floor| format!(", and noise, friction and delay explain {floor:.2e}"),
    )
}

fn clipping_words(stated: bool) -> &'static str {
    if stated { "its limit" } else { "as if its drive gave no more" }
}

impl Shortfall {
    /// Whether it names why the model does not fit, rather than that it does not.
    fn claims_a_cause(&self) -> bool {
        matches!(self, Self::Lag { .. } | Self::LongLag { .. } | Self::LagChanges { .. } | Self::Length(_))
    }

    /// What would help.
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::TooFewRuns { .. } => "more good runs: mend what refused one, or allow more (max_runs)",
            Self::NoModel => "allow more runs (max_runs)",
            Self::LastRunRejected { .. } => {
                "see the reason; a first controller that holds the robot is the commonest cure"
            }
            Self::NoEvidence { .. } => "begin anew with this version",
            Self::Tracking { .. } => {
                "look for what the model has no term for (sticking, backlash, elasticity, a controller that is not the stated one); or give stiffer gains or a larger settled.tracking_tolerance"
            }
            Self::ParameterMoves { .. } => {
                "allow more runs (max_runs); a parameter that keeps moving changes with temperature, or hangs on a term that the model has not"
            }
            Self::ParameterUncertain { .. } => "a motion that excites it: a longer one, or another design",
            Self::Clipping { .. } => "a slower motion, a limit of torque in [design.limits], or the right effort limit",
            Self::Lag { .. } | Self::LongLag { .. } => {
                "take positions and torques at the same instant, or correct the delay where the log is made; a constant delay that is meant to be there may be allowed with settled.most_lag_s"
            }
            Self::LagChanges { .. } => {
                "look for friction that the model has no term for, or elasticity: at reversals both look like a lag (friction = \"auto\")"
            }
            Self::NotHeldOut => {
                "allow the run: it comes when all else is met, or after every so many runs (held_out.every)"
            }
            Self::HeldOutFailed { .. } => {
                "see the reason: a held-out motion that the robot can follow as well as its own"
            }
            Self::HeldOutPrediction { .. } => {
                "what the fitted motion never showed: other friction terms (friction = \"auto\"), a motion that excites more (motion = \"redesign\"), elasticity, temperature"
            }
            Self::Prediction { .. } => {
                "look for what changed between the runs: temperature, load, sticking friction, sensor zeros"
            }
            Self::Unexplained { .. } => {
                "other friction terms (friction = \"auto\"), the right lengths and axes in the description, or a larger settled.most_unexplained_percent"
            }
            Self::Torque(cause) => cause.remedy(),
            Self::Length(_) => {
                "the description of this very arm: measure the length; where it is right, what else grows with that distance (elasticity, a tool, axes that are not parallel)"
            }
        }
    }
}

/// Names that sentences take, how much parameters count, and what depends on the robot's size.
pub(crate) struct Names {
    pub(crate) joints: Vec<String>,
    pub(crate) parameters: Vec<String>,
    /// Of each parameter, the torque that one of its unit makes along the last motion, as a share of the joints' own;
    /// empty where the last run shows no torque.
    pub(crate) shares: Vec<f64>,
    /// The longest lag with which an iteration converges, seconds.
    pub(crate) most_lag_s: f64,
    /// Whether runs of another motion judge the model, in place of those that are fitted next.
    pub(crate) held_out: bool,
}

/// What is not met after the last of `records`; nothing if the iteration has converged.
pub(crate) fn shortfalls(records: &[RunRecord], settings: &IterationSettings, names: &Names) -> Vec<Shortfall> {
    let Some(last) = records.last() else { return vec![Shortfall::TooFewRuns { good: 0 }] };
    let wrong_torque = last.torque_causes().iter().cloned().map(Shortfall::Torque);
    // All else that a wrong torque log shows is a consequence.
    if last.torque_causes().iter().any(TorqueCause::is_determined) {
        return wrong_torque.collect();
    }
    let mut found: Vec<Shortfall> = wrong_torque.collect();
    // Beside a torque that is another one for an unknown reason, no other cause can be claimed.
    let may_claim = found.is_empty();
    found.extend(unmet(records, settings, names).into_iter().filter(|own| may_claim || !own.claims_a_cause()));
    found
}

/// The unmet condition of a compensated lag that is longer than allowed by more than its 95 % interval.
fn long_lag(lag: &LagChoice, allowed_s: f64) -> Option<Shortfall> {
    (lag.certain_s() > allowed_s).then(|| Shortfall::LongLag { lag_s: lag.longest_s(), allowed_s })
}

/// What is not met besides the scale of the torque.
fn unmet(records: &[RunRecord], settings: &IterationSettings, names: &Names) -> Vec<Shortfall> {
    let good: Vec<&RunRecord> = records.iter().filter(|record| record.accepted).collect();
    let Some(last) = records.last() else { return Vec::new() };
    if !last.accepted {
        let reason = last.reason.clone().unwrap_or_else(|| last.outcome.clone());
        return vec![Shortfall::LastRunRejected { reason }];
    }
    let [.., before, _] = good[..] else { return vec![Shortfall::TooFewRuns { good: good.len() }] };
    let Some(evidence) = &last.evidence else { return vec![Shortfall::NoEvidence { run: last.run }] };
    let mut found = Vec::new();
    if last.controller.model.is_none() || last.controller.damping != 1.0 {
        found.push(Shortfall::NoModel);
    }
    let limits = &settings.settled;
    let joint = |place: usize| names.joints[place].clone();
    for (place, (&error_rad, shown)) in last.max_tracking_error_rad.iter().zip(&evidence.joints).enumerate() {
        let (tolerance_rad, floor_rad) = (limits.tracking_tolerance, shown.tracking_floor_rad);
        let explained = floor_rad.map_or(0.0, |floor| limits.floor_ratio * floor);
        if error_rad > tolerance_rad.max(explained) {
            found.push(Shortfall::Tracking { joint: joint(place), error_rad, tolerance_rad, floor_rad });
        }
    }
    if let (Some(old), Some(new)) = (before.knowledge(), last.knowledge()) {
        parameters(&mut found, old, new, settings, names);
    }
    let own = last.estimate.as_ref();
    if let Some(lag) = own.and_then(|own| unexplained_lag(&own.lag, &evidence.log_rates_hz)) {
        found.push(Shortfall::Lag { lag_s: lag.lag_s, half_width_95_s: lag.half_width_95_s });
    }
    found.extend(last.knowledge().and_then(|known| long_lag(&known.lag, names.most_lag_s)));
    for (place, shown) in evidence.joints.iter().enumerate() {
        if let Some((now, then)) = changed_lag(&good, place) {
            let half_width_95_s = now.half_width_95_s.hypot(then.half_width_95_s);
            let (lag_s, before_s) = (now.lag_s, then.lag_s);
            found.push(Shortfall::LagChanges { joint: joint(place), lag_s, before_s, half_width_95_s });
        }
        of_joint(&mut found, last, shown, place, limits, names);
    }
    found.extend(evidence.other_length.clone().map(Shortfall::Length));
    if names.held_out {
        held_out(&mut found, last, names);
    }
    found
}

/// Clipping, prediction and unexplained torque of one joint of the last run.
fn of_joint(
    found: &mut Vec<Shortfall>,
    last: &RunRecord,
    shown: &JointEvidence,
    place: usize,
    limits: &SettledSettings,
    names: &Names,
) {
    let joint = || names.joints[place].clone();
    if let Some(Clipping { share, torque, stated }) = shown.clipping.filter(|clipping| clipping.share > MOST_CLIPPED) {
        let beyond = last.max_tracking_error_rad[place] > limits.tracking_tolerance;
        // Without a stated limit a flat top is a matter of the drive only where the joint does not follow, and no
        // more was commanded.
        if stated || beyond && !last.has_commanded_torque(place) {
            found.push(Shortfall::Clipping { joint: joint(), percent: 100.0 * share, torque, stated });
        }
    }
    let of_run = shown.prediction.filter(|_| !names.held_out);
    if let Some(prediction) = of_run.filter(|prediction| prediction.inside < LEAST_INSIDE) {
        found.push(Shortfall::Prediction {
            joint: joint(),
            inside_percent: 100.0 * prediction.inside,
            rms_error_nm: prediction.rms_error,
            half_width_nm: prediction.half_width,
        });
    }
    let sigma = last.estimate.as_ref().map_or(0.0, |estimate| {
        let (sigma, near_rest) = (estimate.joint_sigma[place], estimate.near_rest.get(place));
        // What is left near rest is the friction's that holds the joint, up to what that can be.
        near_rest.and_then(|found| found.as_ref()?.unexplained_nm(sigma)).unwrap_or(sigma)
    });
    let beyond_noise = (sigma * sigma - shown.row_noise * shown.row_noise).max(0.0).sqrt();
    let (percent, allowed_percent) = (100.0 * beyond_noise / shown.torque_rms, limits.most_unexplained_percent);
    if shown.torque_rms > 0.0 && percent > allowed_percent {
        found.push(Shortfall::Unexplained { joint: joint(), percent, allowed_percent });
    }
}

/// What the held-out run after the last one speaks against.
fn held_out(found: &mut Vec<Shortfall>, last: &RunRecord, names: &Names) {
    let Some(run) = &last.held_out else {
        found.push(Shortfall::NotHeldOut);
        return;
    };
    let Some(evidence) = &run.evidence else {
        let reason = run.reason.clone().unwrap_or_else(|| run.outcome.clone());
        found.push(Shortfall::HeldOutFailed { reason });
        return;
    };
    for (place, shown) in evidence.joints.iter().enumerate() {
        let Some(prediction) = shown.prediction else { continue };
        if prediction.inside < LEAST_INSIDE {
            found.push(Shortfall::HeldOutPrediction {
                joint: names.joints[place].clone(),
                inside_percent: 100.0 * prediction.inside,
                rms_error_nm: prediction.rms_error,
                half_width_nm: prediction.half_width,
            });
        }
    }
}

/// What is left of the lag that all joints share, where it is beyond its bar and moves torque. A torque that is held
/// from sample to sample is half a sample late by itself. What joints do not share is friction's, and is judged as
/// unexplained torque.
fn unexplained_lag(lag: &LagChoice, log_rates_hz: &[f64]) -> Option<TorqueLag> {
    let slowest_hz = log_rates_hz.iter().copied().filter(|hz| *hz > 0.0).fold(f64::INFINITY, f64::min);
    let rest = lag.common.map(|common| TorqueLag { lag_s: common.lag_s - common.taken_off_s, ..common })?;
    (rest.matters && rest.lag_s.abs() > 0.5 / slowest_hz + rest.half_width_95_s).then_some(rest)
}

/// The lags of a joint in the last of some good runs and in the one that it differs most from, each by itself, where
/// one was taken off and they differ clearly.
fn changed_lag(good: &[&RunRecord], joint: usize) -> Option<(TorqueLag, TorqueLag)> {
    let (last, before) = good.split_last()?;
    let taken_off = good.iter().filter_map(|record| record.estimate.as_ref()).chain(last.knowledge());
    if taken_off.into_iter().all(|estimate| estimate.lag.taken_off().is_none()) {
        return None;
    }
    let lag_of = |record: &RunRecord| record.estimate.as_ref()?.torque_lags.get(joint).copied().flatten();
    let now = lag_of(last)?;
    let bars = |then: &TorqueLag| (now.lag_s - then.lag_s).abs() / now.half_width_95_s.hypot(then.half_width_95_s);
    let then = before.iter().filter_map(|record| lag_of(record)).max_by(|a, b| bars(a).total_cmp(&bars(b)))?;
    (bars(&then) > CLEARLY_OTHER).then_some((now, then))
}

/// The parameter that moved most, if one moved too far, and the one that is least known, if it is hardly known.
fn parameters(
    found: &mut Vec<Shortfall>,
    old: &RunEstimate,
    new: &RunEstimate,
    settings: &IterationSettings,
    names: &Names,
) {
    let limits = &settings.settled;
    let share = |k: usize| names.shares.get(k).copied().unwrap_or(0.0);
    let largest = new.values.iter().enumerate().fold(0.0_f64, |most, (k, value)| most.max(value.abs() * share(k)));
    let count = new.values.len().min(old.values.len());
    let name =
        |place: usize| names.parameters.get(place).cloned().unwrap_or_else(|| format!("parameter {}", place + 1));
    let moved = |k: usize| {
        let beyond = share(k) * (new.values[k] - old.values[k]).abs() - limits.parameter_tolerance * largest;
        let bar = share(k) * new.std[k].hypot(old.std[k]);
        if beyond <= 0.0 { 0.0 } else { beyond / bar.max(f64::MIN_POSITIVE) }
    };
    let most = (0..count).map(|k| (k, moved(k))).max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((k, bars)) = most.filter(|(_, bars)| *bars > limits.parameter_sigmas) {
        let (parameter, allowed) = (name(k), limits.parameter_sigmas);
        found.push(Shortfall::ParameterMoves { parameter, bars, allowed });
    }
    let widest = (0..count).map(|k| (k, share(k) * new.std[k].max(old.std[k]))).max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((k, bar)) = widest.filter(|(_, bar)| *bar > limits.most_uncertain * largest) {
        let (percent, allowed_percent) = (100.0 * bar / largest.max(f64::MIN_POSITIVE), 100.0 * limits.most_uncertain);
        found.push(Shortfall::ParameterUncertain { parameter: name(k), percent, allowed_percent });
    }
}

/// Whether a further run of the same motion would tell little: the last two good runs have one model-based controller,
/// no parameter moved beyond its bars or is hardly known, and tracking is inside the tolerance or no longer falls.
pub(crate) fn stands_still(records: &[RunRecord], settings: &IterationSettings, names: &Names) -> bool {
    let [.., before, last] = records else { return false };
    if !(before.accepted && last.accepted && last.controller.model.is_some() && last.controller.damping == 1.0) {
        return false;
    }
    let (Some(old), Some(new)) = (before.knowledge(), last.knowledge()) else { return false };
    let mut moving = Vec::new();
    parameters(&mut moving, old, new, settings, names);
    let limits = &settings.settled;
    let (now, then) = (last.tracking_error(), before.tracking_error());
    moving.is_empty() && (now <= limits.tracking_tolerance || limits.tracking_ratio * now >= then)
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_identification::examination::LagKind;

    fn lag(lag_s: f64, half_width_95_s: f64) -> LagChoice {
        let std_s = 0.5 * half_width_95_s;
        let common = TorqueLag { lag_s, std_s, half_width_95_s, matters: false, taken_off_s: lag_s };
        LagChoice { kind: LagKind::Common, lag_s: vec![lag_s; 6], common: Some(common), scatter: None }
    }

    /// A correct TX40, whose log was 6.2 ms late: the estimate was 15.0 ms with a 95 % interval of 5.0 ms, and the
    /// iteration named a lag above 10 ms.
    #[test]
    fn a_lag_is_long_only_beyond_its_interval() {
        assert_eq!(long_lag(&lag(-15.0e-3, 5.02e-3), 10.0e-3), None);
        let named = long_lag(&lag(-25.0e-3, 1.0e-3), 10.0e-3);
        assert_eq!(named, Some(Shortfall::LongLag { lag_s: 25.0e-3, allowed_s: 10.0e-3 }));
        assert_eq!(long_lag(&LagChoice::default(), 10.0e-3), None);
        // A lag that the study states has no interval.
        let stated = LagChoice { kind: LagKind::Stated, lag_s: vec![12.0e-3], ..LagChoice::default() };
        assert!(long_lag(&stated, 10.0e-3).is_some());
    }
}
