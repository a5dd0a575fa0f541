use crate::estimation::estimate::RunEstimate;
use crate::estimation::lengths::OtherLength;
use crate::evidence::run_evidence::{Clipping, JointEvidence};
use crate::policy::record::RunRecord;
use crate::setup::settings::{ConvergenceSettings, IterationSettings};
use crate::torque_check::TorqueCause;
use dynident_identification::examination::{LagChoice, TorqueLag};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A condition that the last run does not meet, with its figures; [`remedy`](Self::remedy) suggests a fix.
#[derive(Clone, Debug, PartialEq, Error, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "condition", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum UnmetCondition {
    /// Convergence is a comparison of two good runs. Remove the cause of rejected runs, or allow more runs
    /// (`max_runs`).
    #[error("{good} good runs, 2 are needed for a comparison")]
    TooFewRuns {
        /// Number of good runs.
        good: usize,
    },
    /// The last run cannot be used, for the reason in the message. Usually a first controller that holds the robot
    /// steadily corrects this.
    #[error("the last run was rejected: {reason}")]
    LastRunRejected {
        /// Reason why the run was rejected.
        reason: String,
    },
    /// The last run used a controller without the newest model, or only a part of the model's change. Allow more runs
    /// (`max_runs`).
    #[error("the last run did not use the controller with the newest model")]
    NoModel,
    /// An earlier version of Dynident made this run and did not store what the test of convergence needs. Start the
    /// iteration again in an empty folder.
    #[error("run {run} was made by an earlier version, which did not store the evidence of its log")]
    NoEvidence {
        /// Number of the run.
        run: usize,
    },
    /// The robot does not follow the motion as closely as required. Something is missing in the model (stiction,
    /// backlash, elasticity), or the gains are too low: raise them, or raise `settled.tracking_tolerance`.
    #[error("joint {joint} was {error_rad:.2e} rad from its trajectory, tolerance {tolerance_rad:.2e}{floor}", floor = floor_words(*.floor_rad))]
    Tracking {
        /// The joint.
        joint: String,
        /// Largest distance of the joint from the reference, rad (m).
        error_rad: f64,
        /// Tolerance, rad (m).
        tolerance_rad: f64,
        /// Error that noise, friction and delay explain, rad (m); `None` if unknown.
        floor_rad: Option<f64>,
    },
    /// The estimate still changes from run to run. Allow more runs (`max_runs`); if it continues, the parameter depends
    /// on temperature, or the model lacks a term.
    #[error("{parameter} changed by {bars:.1} error bars with the last run, the limit is {allowed:.1}")]
    ParameterMoves {
        /// Symbol of the base parameter.
        parameter: String,
        /// Change, in error bars.
        bars: f64,
        /// Largest accepted change in error bars.
        allowed: f64,
    },
    /// The motion excites this parameter too little. Use a longer or another motion (`motion = "redesign"`).
    #[error(
        "the error bar of {parameter} is {percent:.0} % of the largest parameter (by torque), the limit is {allowed_percent:.0} %"
    )]
    ParameterUncertain {
        /// Symbol of the base parameter.
        parameter: String,
        /// Torque of its error bar (one standard deviation), percent of the torque of the largest parameter.
        percent: f64,
        /// Largest accepted value, percent.
        allowed_percent: f64,
    },
    /// The drive delivers its largest torque, so that the logged torque does not follow the command. Use a slower
    /// motion, or a torque limit under `[design.limits]`.
    #[error("the torque of joint {joint} is {torque:.3} Nm in {percent:.1} % of the samples: {cause}", cause = clipping_words(*.stated))]
    Clipping {
        /// The joint.
        joint: String,
        /// Percentage of clipped samples.
        percent: f64,
        /// Clipped torque, Nm (N).
        torque: f64,
        /// Whether the torque is a given limit.
        stated: bool,
    },
    /// The recorder stores torque and position at different times, and the correction does not explain all of it.
    /// Record both at the same instant.
    #[error("unexplained lag: the torque of all joints is {lag_ms:.1} +- {half_width_ms:.1} ms (95 %) {after_or_before} the motion", lag_ms = 1e3 * .lag_s.abs(), half_width_ms = 1e3 * .half_width_95_s, after_or_before = if *.lag_s > 0.0 { "after" } else { "before" })]
    Lag {
        /// Remaining lag after compensation, s.
        lag_s: f64,
        /// Half-width of the 95 % interval of the lag, s.
        half_width_95_s: f64,
    },
    /// The correction of the delay is larger than accepted, so that the logged position is not the true one. Record
    /// both at the same instant, or raise `settled.most_lag_s`.
    #[error("torque and motion of the log are {lag_ms:.1} ms apart, the limit is {allowed_ms:.1} ms", lag_ms = 1e3 * .lag_s, allowed_ms = 1e3 * .allowed_s)]
    LongLag {
        /// The longest lag of a joint, s.
        lag_s: f64,
        /// Limit, s.
        allowed_s: f64,
    },
    /// A delay of the recorder would be constant. A changing one is friction or elasticity that the model lacks: write
    /// `friction = "auto"` under `[drive]`.
    #[error("the apparent torque lag of joint {joint} is {lag_ms:.1} ms in the last run and {before_ms:.1} ms in an earlier run, +- {half_width_ms:.1} ms (95 %)", lag_ms = 1e3 * .lag_s, before_ms = 1e3 * .before_s, half_width_ms = 1e3 * .half_width_95_s)]
    LagChanges {
        /// The joint.
        joint: String,
        /// Lag of the joint in the last run, s.
        lag_s: f64,
        /// Lag in the good run that differs most from it, s.
        before_s: f64,
        /// Half-width of the 95 % interval of the difference, s.
        half_width_95_s: f64,
    },
    /// The robot changed between the runs, for example its temperature, load or a sensor offset. Keep the conditions
    /// constant, or let the robot warm up.
    #[error(
        "{inside_percent:.0} % of joint {joint}'s torque is inside the 95 % band of the model of the earlier runs: error {rms_error_nm:.3} Nm, band +- {half_width_nm:.3} Nm"
    )]
    Prediction {
        /// The joint.
        joint: String,
        /// Percentage of samples inside the band.
        inside_percent: f64,
        /// Root mean square error of the prediction, Nm (N).
        rms_error_nm: f64,
        /// Mean half width of the band, Nm (N).
        half_width_nm: f64,
    },
    /// The model is tested on a motion that was not used for the fit, and this run was not made yet. Allow more runs,
    /// or set `held_out.every`.
    #[error("the newest model has not been validated on the held-out motion")]
    NotHeldOut,
    /// The test run on another motion failed, for the reason in the message. Choose a held-out motion that the robot
    /// can follow.
    #[error("the held-out run cannot validate the newest model: {reason}")]
    HeldOutFailed {
        /// Reason why the run failed.
        reason: String,
    },
    /// The model is valid only for the motion of the fit. Use a more exciting motion (`motion = "redesign"`), or other
    /// friction laws (`friction = "auto"`).
    #[error(
        "held-out motion: {inside_percent:.0} % of joint {joint}'s torque is inside the 95 % band of the newest model: error {rms_error_nm:.3} Nm, band +- {half_width_nm:.3} Nm"
    )]
    HeldOutPrediction {
        /// The joint.
        joint: String,
        /// Percentage of samples inside the band.
        inside_percent: f64,
        /// Root mean square error of the prediction, Nm (N).
        rms_error_nm: f64,
        /// Mean half width of the band, Nm (N).
        half_width_nm: f64,
    },
    /// The model lacks a part of the real torque. Write `friction = "auto"` under `[drive]`, or correct lengths and
    /// axes in the robot description.
    #[error(
        "{percent:.1} % of joint {joint}'s torque is unexplained beyond its noise, the limit is {allowed_percent:.1} %"
    )]
    Unexplained {
        /// The joint.
        joint: String,
        /// Unexplained torque in percent of the joint torque (root mean squares).
        percent: f64,
        /// Limit, percent.
        allowed_percent: f64,
    },
    /// A length in the robot description is probably wrong. Measure it on the robot and correct the description.
    #[error(
        "{other_length}: the residual of joint {joint} is then {with_nm:.3} Nm instead of {without_nm:.3} Nm", other_length = length_words(.0), joint = .0.explained_joint, with_nm = .0.left_with_nm, without_nm = .0.left_nm
    )]
    Length(OtherLength),
    /// The logged torque is not that of the drives. The message is one of the table *Commanded and logged torque*.
    #[error("{torque_cause}", torque_cause = .0)]
    Torque(TorqueCause),
}

fn length_words(other: &OtherLength) -> String {
    let OtherLength { joint, factor, .. } = other;
    match joint {
        Some(joint) => format!(
            "the torque indicates that joint {joint} is {factor:.2} times as far from the previous joint as in the robot description"
        ),
        None => format!("the torque indicates that all lengths are {factor:.2} times those of the robot description"),
    }
}

fn floor_words(floor_rad: Option<f64>) -> String {
    floor_rad.map_or_else(
        || "; the error that the loop can reach is unknown".to_owned(),
        |floor| format!(", and noise, friction and delay explain {floor:.2e}"),
    )
}

fn clipping_words(stated: bool) -> &'static str {
    if stated { "its limit" } else { "probably saturation of its drive" }
}

impl UnmetCondition {
    fn is_cause(&self) -> bool {
        matches!(self, Self::Lag { .. } | Self::LongLag { .. } | Self::LagChanges { .. } | Self::Length(_))
    }

    /// Suggests a fix.
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::TooFewRuns { .. } => "fix the cause of the rejected run, or allow more runs (max_runs)",
            Self::NoModel => "allow more runs (max_runs)",
            Self::LastRunRejected { .. } => {
                "see the reason; a first controller that holds the robot steadily usually fixes this"
            }
            Self::NoEvidence { .. } => "restart the iteration with this version",
            Self::Tracking { .. } => {
                "look for effects without a term in the model (stiction, backlash, elasticity, another controller than stated); or use stiffer gains or a larger settled.tracking_tolerance"
            }
            Self::ParameterMoves { .. } => {
                "allow more runs (max_runs); a parameter that keeps changing may depend on temperature or on a missing model term"
            }
            Self::ParameterUncertain { .. } => "use a motion that excites it: a longer one, or another design",
            Self::Clipping { .. } => {
                "use a slower motion, add a torque limit to [design.limits], or correct the effort limit"
            }
            Self::Lag { .. } | Self::LongLag { .. } => {
                "record positions and torques at the same instant, or correct the delay in the recorder; increase settled.most_lag_s to accept a known constant delay"
            }
            Self::LagChanges { .. } => {
                "look for missing friction terms (friction = \"auto\") or elasticity: at reversals both look like a lag"
            }
            Self::NotHeldOut => {
                "allow the held-out run: it follows when all other conditions are met, or after every N runs (held_out.every)"
            }
            Self::HeldOutFailed { .. } => {
                "see the reason; use a held-out motion that the robot can follow as well as the fitted motion"
            }
            Self::HeldOutPrediction { .. } => {
                "look for effects that the fitted motion does not excite: other friction terms (friction = \"auto\"), elasticity, temperature; or use a more exciting motion (motion = \"redesign\")"
            }
            Self::Prediction { .. } => "look for changes between the runs: temperature, load, stiction, sensor offsets",
            Self::Unexplained { .. } => {
                "add friction terms (friction = \"auto\"), correct lengths and axes in the robot description, or increase settled.most_unexplained_percent"
            }
            Self::Torque(cause) => cause.remedy(),
            Self::Length(_) => {
                "measure the length and correct the robot description; if the length is right, look for other effects that grow with it (elasticity, a tool, axes that are not parallel)"
            }
        }
    }
}

/// Names for messages, torque shares of the parameters, and limits that depend on the size of the robot.
pub(crate) struct Names {
    pub(crate) joints: Vec<String>,
    pub(crate) parameters: Vec<String>,
    /// Torque share of each parameter: torque of one unit of it along the last motion, relative to the joint torque.
    /// Empty if the last run has no torque.
    pub(crate) shares: Vec<f64>,
    /// Longest accepted lag, seconds.
    pub(crate) most_lag_s: f64,
    /// Whether held-out runs validate the model, instead of the next fitted runs.
    pub(crate) held_out: bool,
}

/// Returns the conditions that the last of `records` does not meet; empty if the iteration has converged.
pub(crate) fn shortfalls(records: &[RunRecord], settings: &IterationSettings, names: &Names) -> Vec<UnmetCondition> {
    let Some(last) = records.last() else { return vec![UnmetCondition::TooFewRuns { good: 0 }] };
    let wrong_torque = last.torque_causes().iter().cloned().map(UnmetCondition::Torque);
    // A wrong torque log explains all other findings, so they are not reported.
    if last.torque_causes().iter().any(TorqueCause::is_determined) {
        return wrong_torque.collect();
    }
    let mut found: Vec<UnmetCondition> = wrong_torque.collect();
    // If the torque is wrong for an unknown reason, no other cause is reliable.
    let may_claim = found.is_empty();
    found.extend(unmet(records, settings, names).into_iter().filter(|own| may_claim || !own.is_cause()));
    found
}

/// Unmet condition if a compensated lag exceeds the limit by more than its 95 % interval.
fn long_lag(lag: &LagChoice, allowed_s: f64) -> Option<UnmetCondition> {
    (lag.certain_s() > allowed_s).then(|| UnmetCondition::LongLag { lag_s: lag.longest_s(), allowed_s })
}

fn unmet(records: &[RunRecord], settings: &IterationSettings, names: &Names) -> Vec<UnmetCondition> {
    let good: Vec<&RunRecord> = records.iter().filter(|record| record.accepted).collect();
    let Some(last) = records.last() else { return Vec::new() };
    if !last.accepted {
        let reason = last.reason.clone().unwrap_or_else(|| last.outcome.clone());
        return vec![UnmetCondition::LastRunRejected { reason }];
    }
    let [.., before, _] = good[..] else { return vec![UnmetCondition::TooFewRuns { good: good.len() }] };
    let Some(evidence) = &last.evidence else { return vec![UnmetCondition::NoEvidence { run: last.run }] };
    let mut found = Vec::new();
    if last.controller.model.is_none() || last.controller.damping != 1.0 {
        found.push(UnmetCondition::NoModel);
    }
    let limits = &settings.settled;
    let joint = |place: usize| names.joints[place].clone();
    for (place, (&error_rad, shown)) in last.max_tracking_error_rad.iter().zip(&evidence.joints).enumerate() {
        let (tolerance_rad, floor_rad) = (limits.tracking_tolerance, shown.tracking_floor_rad);
        let explained = floor_rad.map_or(0.0, |floor| limits.floor_ratio * floor);
        if error_rad > tolerance_rad.max(explained) {
            found.push(UnmetCondition::Tracking { joint: joint(place), error_rad, tolerance_rad, floor_rad });
        }
    }
    if let (Some(old), Some(new)) = (before.knowledge(), last.knowledge()) {
        parameters(&mut found, old, new, settings, names);
    }
    let own = last.estimate.as_ref();
    if let Some(lag) = own.and_then(|own| unexplained_lag(&own.lag, &evidence.log_rates_hz)) {
        found.push(UnmetCondition::Lag { lag_s: lag.lag_s, half_width_95_s: lag.half_width_95_s });
    }
    found.extend(last.knowledge().and_then(|known| long_lag(&known.lag, names.most_lag_s)));
    for (place, shown) in evidence.joints.iter().enumerate() {
        if let Some((now, then)) = changed_lag(&good, place, limits.verdict.min_lag_change_ratio) {
            let half_width_95_s = now.half_width_95_s.hypot(then.half_width_95_s);
            let (lag_s, before_s) = (now.lag_s, then.lag_s);
            found.push(UnmetCondition::LagChanges { joint: joint(place), lag_s, before_s, half_width_95_s });
        }
        of_joint(&mut found, last, shown, place, limits, names);
    }
    found.extend(evidence.other_length.clone().map(UnmetCondition::Length));
    if names.held_out {
        held_out(&mut found, last, limits.verdict.min_inside_share, names);
    }
    found
}

/// Clipping, prediction and unexplained torque of one joint of the last run.
fn of_joint(
    found: &mut Vec<UnmetCondition>,
    last: &RunRecord,
    shown: &JointEvidence,
    place: usize,
    limits: &ConvergenceSettings,
    names: &Names,
) {
    let joint = || names.joints[place].clone();
    if let Some(Clipping { share, torque, stated }) =
        shown.clipping.filter(|clipping| clipping.share > limits.verdict.max_clipped_share)
    {
        let beyond = last.max_tracking_error_rad[place] > limits.tracking_tolerance;
        // If no limit is given, constant peak torque indicates saturation only if the joint does not follow its
        // trajectory and no larger torque was commanded.
        if stated || beyond && !last.has_commanded_torque(place) {
            found.push(UnmetCondition::Clipping { joint: joint(), percent: 100.0 * share, torque, stated });
        }
    }
    let of_run = shown.prediction.filter(|_| !names.held_out);
    if let Some(prediction) = of_run.filter(|prediction| prediction.inside < limits.verdict.min_inside_share) {
        found.push(UnmetCondition::Prediction {
            joint: joint(),
            inside_percent: 100.0 * prediction.inside,
            rms_error_nm: prediction.rms_error,
            half_width_nm: prediction.half_width,
        });
    }
    let sigma = last.estimate.as_ref().map_or(0.0, |estimate| {
        let (sigma, near_rest) = (estimate.joint_sigma[place], estimate.near_rest.get(place));
        // Stiction explains the residual near rest up to its maximum torque.
        near_rest.and_then(|found| found.as_ref()?.unexplained_nm(sigma)).unwrap_or(sigma)
    });
    let beyond_noise = (sigma * sigma - shown.row_noise * shown.row_noise).max(0.0).sqrt();
    let (percent, allowed_percent) = (100.0 * beyond_noise / shown.torque_rms, limits.most_unexplained_percent);
    if shown.torque_rms > 0.0 && percent > allowed_percent {
        found.push(UnmetCondition::Unexplained { joint: joint(), percent, allowed_percent });
    }
}

fn held_out(found: &mut Vec<UnmetCondition>, last: &RunRecord, min_inside_share: f64, names: &Names) {
    let Some(run) = &last.held_out else {
        found.push(UnmetCondition::NotHeldOut);
        return;
    };
    let Some(evidence) = &run.evidence else {
        let reason = run.reason.clone().unwrap_or_else(|| run.outcome.clone());
        found.push(UnmetCondition::HeldOutFailed { reason });
        return;
    };
    for (place, shown) in evidence.joints.iter().enumerate() {
        let Some(prediction) = shown.prediction else { continue };
        if prediction.inside < min_inside_share {
            found.push(UnmetCondition::HeldOutPrediction {
                joint: names.joints[place].clone(),
                inside_percent: 100.0 * prediction.inside,
                rms_error_nm: prediction.rms_error,
                half_width_nm: prediction.half_width,
            });
        }
    }
}

/// Lag of all joints that remains after compensation, if it is significant and large enough to matter. Torque that is
/// held from sample to sample is half a sample late. Differences between joints come from friction and are reported
/// as unexplained torque.
fn unexplained_lag(lag: &LagChoice, log_rates_hz: &[f64]) -> Option<TorqueLag> {
    let slowest_hz = log_rates_hz.iter().copied().filter(|hz| *hz > 0.0).fold(f64::INFINITY, f64::min);
    let rest = lag.common.map(|common| TorqueLag { lag_s: common.lag_s - common.taken_off_s, ..common })?;
    (rest.matters && rest.lag_s.abs() > 0.5 / slowest_hz + rest.half_width_95_s).then_some(rest)
}

/// Lags of a joint in the last good run and in the run that differs most from it, if a lag was compensated and the
/// two lags differ significantly.
fn changed_lag(good: &[&RunRecord], joint: usize, min_ratio: f64) -> Option<(TorqueLag, TorqueLag)> {
    let (last, before) = good.split_last()?;
    let taken_off = good.iter().filter_map(|record| record.estimate.as_ref()).chain(last.knowledge());
    if taken_off.into_iter().all(|estimate| estimate.lag.taken_off().is_none()) {
        return None;
    }
    let lag_of = |record: &RunRecord| record.estimate.as_ref()?.torque_lags.get(joint).copied().flatten();
    let now = lag_of(last)?;
    let bars = |then: &TorqueLag| (now.lag_s - then.lag_s).abs() / now.half_width_95_s.hypot(then.half_width_95_s);
    let then = before.iter().filter_map(|record| lag_of(record)).max_by(|a, b| bars(a).total_cmp(&bars(b)))?;
    (bars(&then) > min_ratio).then_some((now, then))
}

/// Reports the parameter that changed most, if it changed too much, and the parameter with the widest error bar, if
/// the error bar is too wide.
fn parameters(
    found: &mut Vec<UnmetCondition>,
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
        found.push(UnmetCondition::ParameterMoves { parameter, bars, allowed });
    }
    let widest = (0..count).map(|k| (k, share(k) * new.std[k].max(old.std[k]))).max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((k, bar)) = widest.filter(|(_, bar)| *bar > limits.most_uncertain * largest) {
        let (percent, allowed_percent) = (100.0 * bar / largest.max(f64::MIN_POSITIVE), 100.0 * limits.most_uncertain);
        found.push(UnmetCondition::ParameterUncertain { parameter: name(k), percent, allowed_percent });
    }
}

/// Whether a further run of the same motion would add little. The last two good runs used the undamped model-based
/// controller, no parameter changed or is uncertain, and tracking is within the tolerance or no longer improves.
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
        LagChoice { kind: LagKind::Common, lag_s: vec![lag_s; 6], common: Some(common), ..LagChoice::default() }
    }

    /// A correct TX40, whose log was 6.2 ms late: the estimate was 15.0 ms with a 95 % interval of 5.0 ms, and the
    /// iteration reported a lag above 10 ms.
    #[test]
    fn a_lag_is_long_only_beyond_its_interval() {
        assert_eq!(long_lag(&lag(-15.0e-3, 5.02e-3), 10.0e-3), None);
        let named = long_lag(&lag(-25.0e-3, 1.0e-3), 10.0e-3);
        assert_eq!(named, Some(UnmetCondition::LongLag { lag_s: 25.0e-3, allowed_s: 10.0e-3 }));
        assert_eq!(long_lag(&LagChoice::default(), 10.0e-3), None);
        // A lag that the study states has no interval.
        let stated = LagChoice { kind: LagKind::Stated, lag_s: vec![12.0e-3], ..LagChoice::default() };
        assert!(long_lag(&stated, 10.0e-3).is_some());
    }
}
