use super::explanation::{Explanation, Fitted, TorqueCandidate};
use super::{CheckWith, CommandSource, RowScale, TorqueCheck};
use crate::setup::leg::IterationTask;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Largest difference between the torque scales of joints that are reported as one common scale.
const MAX_COMMON_SCALE_DEVIATION: f64 = 0.02;

/// Why the logged torque of a run differs from the commanded torque.
#[derive(Clone, Debug, PartialEq, Error, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "cause", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum TorqueCause {
    /// Torque constant, gear ratio or unit of this joint is wrong in the log, or the gain of its drive is. Correct the
    /// scale.
    #[error("the logged torque of joint {joint} is {factor:.3} ± {half_width_95:.3} times the commanded torque")]
    Scale {
        /// The joint.
        joint: String,
        /// Ratio of logged to commanded torque.
        factor: f64,
        /// Half-width of the 95 % interval of the ratio.
        half_width_95: f64,
    },
    /// All torques have a wrong unit or scale in the log. Correct the scale.
    #[error("the logged torques of all joints are {factor:.3} times the commanded torques")]
    CommonScale {
        /// Ratio of logged to commanded torque.
        factor: f64,
    },
    /// The recorder or the drive uses the opposite direction for this joint. Reverse the sign of the logged torque (or
    /// of the commanded torque, if the message names the motion).
    #[error("{opposite_sign}", opposite_sign = sign_words(.joints, *.is_commanded))]
    Sign {
        /// Names of the joints.
        joints: Vec<String>,
        /// Whether the log contains the commanded torque, so that only the motion reveals the mistake.
        #[serde(default, skip_serializing_if = "core::ops::Not::not")]
        is_commanded: bool,
    },
    /// Two columns of the log, or two commands, are in the wrong order. Correct the order of the joints.
    #[error("{exchanged_joints}", exchanged_joints = exchanged_words(joint, of, *.is_commanded))]
    Exchanged {
        /// The joint.
        joint: String,
        /// The joint whose torque the column contains.
        of: String,
        /// Whether the log contains the commanded torque, so that only the motion reveals the mistake.
        #[serde(default, skip_serializing_if = "core::ops::Not::not")]
        is_commanded: bool,
    },
    /// The robot compensates gravity itself and logs only the rest. Log the complete torque of the drives.
    #[error("gravity is missing in the logged torque of {}", listed(.joints))]
    Gravity {
        /// Names of the joints.
        joints: Vec<String>,
    },
    /// The robot compensates friction itself and logs only the rest. Log the complete torque of the drives.
    #[error("friction is missing in the logged torque of {}", listed(.joints))]
    Friction {
        /// Names of the joints.
        joints: Vec<String>,
    },
    /// The drive delivers less torque than commanded, because it reached its limit. Use a slower motion, or correct the
    /// torque limit under `[design.limits]`.
    #[error("{constant_torque} although more is commanded: the drive is saturated", constant_torque = clipped_words(joint, *torque, *.is_commanded))]
    Clipped {
        /// The joint.
        joint: String,
        /// Torque limit, Nm (N).
        torque: f64,
        /// Whether the log contains the commanded torque, so that only the motion reveals the mistake.
        #[serde(default, skip_serializing_if = "core::ops::Not::not")]
        is_commanded: bool,
    },
    /// The recorder stores positions and torques of different instants. Log both at the same instant.
    #[error("positions and torques of the log are {lag_ms:.1} ms apart", lag_ms = 1e3 * .lag_s)]
    Delay {
        /// Delay of the torque relative to the positions, s.
        lag_s: f64,
    },
    /// The log uses another clock than the controller. Log the time of the controller.
    #[error("the clock of the log is {difference:.2} % {faster_or_slower} than that of the controller", difference = .percent.abs(), faster_or_slower = if *.percent < 0.0 { "faster" } else { "slower" })]
    Clock {
        /// Percentage by which the log's clock is slower than the controller's.
        percent: f64,
    },
    /// The masses that this joint's torque requires differ from those that the other joints require. Correct its torque
    /// constant or gear ratio, or check the gain of its drive.
    #[error("the torque of joint {joint} is {factor:.3} ± {half_width_95:.3} times what the torques of the other joints require{note}{or_joints}", note = log_words(*.is_commanded), or_joints = or_words(.or))]
    JointScale {
        /// The joint.
        joint: String,
        /// Joints whose scale would explain the difference nearly as well.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        or: Vec<String>,
        /// Ratio of the joint's torque to the torque that the other joints require.
        factor: f64,
        /// Half-width of the 95 % interval of the ratio.
        half_width_95: f64,
        /// Whether the logged torque is the commanded one.
        is_commanded: bool,
    },
    /// Several causes fit equally well, or none does. Compare both torques in the report, and log the torque that the
    /// drives deliver.
    #[error("the logged torque of joint {joint} differs from the commanded torque by {difference_percent:.1} %: cause not determined{}", candidate_words(.candidates))]
    Undetermined {
        /// The joint.
        joint: String,
        /// Root mean square of the difference as a percentage of the joint's torque.
        difference_percent: f64,
        /// The candidates that explain most of it, best first.
        candidates: Vec<TorqueCandidate>,
    },
}

impl TorqueCause {
    /// Suggests a fix.
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::Scale { .. } | Self::CommonScale { .. } => {
                "correct the scale of the logged torque (torque constant, gear ratio, unit), or the drive's torque gain"
            }
            Self::Sign { is_commanded: true, .. } => "reverse the sign of the commanded torque of these joints",
            Self::Sign { .. } => "reverse the sign of the logged torque",
            Self::Exchanged { is_commanded: true, .. } => "correct the order of the commanded torques",
            Self::Exchanged { .. } => "correct the order of the logged or of the commanded torques",
            Self::Gravity { .. } | Self::Friction { .. } => {
                "log the complete torque of the drives, including what the robot compensates itself"
            }
            Self::Clipped { .. } => "use a slower motion, or correct the torque limit of the drive in [design.limits]",
            Self::Delay { .. } => "log positions and torques of the same instant",
            Self::Clock { .. } => "log the controller's own time",
            Self::JointScale { is_commanded: true, .. } => {
                "check the torque gain of this drive: it delivers another torque than the log states"
            }
            Self::JointScale { .. } => {
                "correct the scale of this joint's logged torque (torque constant, gear ratio), or its drive's gain"
            }
            Self::Undetermined { .. } => {
                "compare the logged with the commanded torque in the report; log the torque that the drives deliver"
            }
        }
    }

    /// Whether the cause of the wrong torque is known; otherwise another motion of the robot may determine it.
    pub fn is_determined(&self) -> bool {
        !matches!(self, Self::Undetermined { .. })
    }
}

fn listed(joints: &[String]) -> String {
    match joints {
        [one] => format!("joint {one}"),
        several => format!("joints {}", several.join(", ")),
    }
}

fn sign_words(joints: &[String], is_commanded: bool) -> String {
    let joints = listed(joints);
    if is_commanded {
        format!("the motion of {joints} is opposite to the torque, although the log contains the commanded torque")
    } else {
        format!("the logged torque of {joints} has the opposite sign of the commanded torque")
    }
}

fn exchanged_words(joint: &str, of: &str, is_commanded: bool) -> String {
    if is_commanded {
        format!("joint {joint} moves by the torque that is commanded to joint {of}: their commands are exchanged")
    } else {
        format!("the logged torque of joint {joint} is the commanded torque of joint {of}: their columns are exchanged")
    }
}

fn clipped_words(joint: &str, torque: f64, is_commanded: bool) -> String {
    if is_commanded {
        format!(
            "joint {joint} moves as if its torque stayed at {torque:.3} Nm, although the log contains the commanded torque,"
        )
    } else {
        format!("the logged torque of joint {joint} stays at {torque:.3} Nm")
    }
}

fn log_words(is_commanded: bool) -> &'static str {
    if is_commanded { ", although the log contains the commanded torque" } else { "" }
}

fn or_words(or: &[String]) -> String {
    if or.is_empty() { String::new() } else { format!(" (or another scale of {})", listed(or)) }
}

fn candidate_words(candidates: &[TorqueCandidate]) -> String {
    let names: Vec<&str> = candidates.iter().map(|candidate| candidate.name()).collect();
    if names.is_empty() { String::new() } else { format!(" (candidates: {})", names.join(", ")) }
}

impl TorqueCandidate {
    fn name(self) -> &'static str {
        match self {
            Self::Scale => "another scale",
            Self::Sign => "a reversed sign",
            Self::Exchanged => "exchanged joints",
            Self::Gravity => "gravity missing",
            Self::Friction => "friction missing",
            Self::Clipped => "a torque limit",
        }
    }
}

/// Smallest share of the squared difference that a candidate in the list must explain.
const MIN_LISTED_SHARE: f64 = 0.5;

pub(super) fn causes(
    task: &IterationTask,
    check: &TorqueCheck,
    explanations: &[Explanation],
    named: &[Option<Fitted>],
    with: &CheckWith<'_>,
) -> Vec<TorqueCause> {
    let names = task.robot.joint_names();
    let of = |candidate: TorqueCandidate| -> Vec<usize> {
        let is_it = |found: &Option<Fitted>| found.is_some_and(|found| found.candidate == candidate);
        (0..named.len()).filter(|&joint| is_it(&named[joint])).collect()
    };
    let listed = |joints: &[usize]| joints.iter().map(|&joint| names[joint].clone()).collect::<Vec<_>>();
    let mut found = scale_causes(&of(TorqueCandidate::Scale), explanations, named, &names);
    for (candidate, cause) in [
        (
            TorqueCandidate::Sign,
            (|joints| TorqueCause::Sign { joints, is_commanded: false }) as fn(Vec<String>) -> TorqueCause,
        ),
        (TorqueCandidate::Gravity, |joints| TorqueCause::Gravity { joints }),
        (TorqueCandidate::Friction, |joints| TorqueCause::Friction { joints }),
    ] {
        let joints = of(candidate);
        if !joints.is_empty() {
            found.push(cause(listed(&joints)));
        }
    }
    for joint in of(TorqueCandidate::Exchanged) {
        let of = named[joint].map_or(joint, |found| found.value as usize);
        let (joint, of) = (names[joint].clone(), names[of].clone());
        found.push(TorqueCause::Exchanged { joint, of, is_commanded: false });
    }
    for joint in of(TorqueCandidate::Clipped) {
        let torque = named[joint].map_or(0.0, |found| found.value);
        found.push(TorqueCause::Clipped { joint: names[joint].clone(), torque, is_commanded: false });
    }
    // The timing is not reliable if the torque differs for another reason.
    let has_timing = !explanations.iter().any(|own| own.matters);
    for (joint, explanation) in explanations.iter().enumerate() {
        if explanation.matters && explanation.is_certain && named[joint].is_none() {
            let likely = explanation.candidates.iter().filter(|one| one.explained >= MIN_LISTED_SHARE);
            found.push(TorqueCause::Undetermined {
                joint: names[joint].clone(),
                difference_percent: explanation.difference_percent,
                candidates: likely.map(|one| one.candidate).collect(),
            });
        }
    }
    if has_timing {
        found.extend(timing(check, with));
    }
    // Once torque is fed forward, it is easier to determine which joint is wrong.
    let is_early = check.source == CommandSource::PathOnly && with.feeds_forward_later;
    if found.is_empty() && !is_early {
        found.extend(row_scale_causes(check, with.row_scales, &names));
    }
    found
}

fn scale_causes(
    scaled: &[usize],
    explanations: &[Explanation],
    named: &[Option<Fitted>],
    names: &[String],
) -> Vec<TorqueCause> {
    let scale = |joint: usize| named[joint].map_or(1.0, |found| found.value);
    let determined = explanations.iter().filter(|own| own.scale.is_some()).count();
    let mean = scaled.iter().map(|&joint| scale(joint)).sum::<f64>() / scaled.len().max(1) as f64;
    let is_common = scaled.len() > 1
        && scaled.len() == determined
        && scaled.iter().all(|&joint| (scale(joint) - mean).abs() < MAX_COMMON_SCALE_DEVIATION);
    if is_common {
        return vec![TorqueCause::CommonScale { factor: mean }];
    }
    let of_joint = |&joint: &usize| TorqueCause::Scale {
        joint: names[joint].clone(),
        factor: scale(joint),
        half_width_95: 1.96 * explanations[joint].scale_std.unwrap_or(0.0),
    };
    scaled.iter().map(of_joint).collect()
}

/// Reports timing mistakes. If the controller receives positions earlier than the log, it uses their true times, so
/// the log is late.
fn timing(check: &TorqueCheck, with: &CheckWith<'_>) -> Vec<TorqueCause> {
    let settings = with.settings;
    let mut found = Vec::new();
    let lag_s = check.torque_lag_s + check.feedback_delay_s[0].min(0.0);
    let lag_std_s = check.torque_lag_std_s.unwrap_or(f64::INFINITY);
    if lag_s.abs() - settings.sigmas * lag_std_s > with.most_lag_s {
        found.push(TorqueCause::Delay { lag_s });
    }
    let clock_std = check.clock_percent_std.unwrap_or(f64::INFINITY);
    let clock = check.clock_percent.abs();
    if clock > settings.clock_percent && clock > settings.sigmas * clock_std {
        found.push(TorqueCause::Clock { percent: check.clock_percent });
    }
    found
}

/// Joints whose rows contradict the rows of the other joints.
fn row_scale_causes(check: &TorqueCheck, row_scales: &[Option<RowScale>], names: &[String]) -> Vec<TorqueCause> {
    let of_joint = |(joint, scale): (usize, &Option<RowScale>)| {
        let RowScale { value, std, is_wrong, or } = scale.as_ref()?;
        is_wrong.then(|| TorqueCause::JointScale {
            joint: names[joint].clone(),
            or: or.iter().map(|&other| names[other].clone()).collect(),
            factor: *value,
            half_width_95: 1.96 * std,
            is_commanded: check.source == CommandSource::Controller,
        })
    };
    row_scales.iter().enumerate().filter_map(of_joint).collect()
}
