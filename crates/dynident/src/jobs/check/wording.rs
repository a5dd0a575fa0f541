//! A mistake in words: its kind, a sentence that names joints, what else it could be, and what speaks for it.

use super::changes::{StudyFormat, significant};
use core::f64::consts::PI;
use core::fmt::Write;
use dynident_identification::diagnosis::{Channels, Mistake, Reading};

/// Factors that are no unit's.
const GAINS: core::ops::RangeInclusive<f64> = 0.4..=2.5;

/// The kind of finding that a mistake is.
pub(super) fn kind(mistake: &Mistake) -> &'static str {
    match mistake {
        Mistake::Sign { .. } => "sign",
        Mistake::Order { .. } => "order",
        Mistake::Offset { .. } => "offset",
        Mistake::PositionUnit { .. } | Mistake::TorqueUnit { .. } | Mistake::TimeUnit { .. } => "unit",
        Mistake::Coupled { .. } => "coupling",
        Mistake::Lag { .. } => "lag",
        Mistake::Convention { .. } | Mistake::Length { .. } => "description",
        Mistake::Gravity { .. } | Mistake::Compensated => "mounting",
    }
}

pub(super) fn channels_text(channels: Channels) -> &'static str {
    match channels {
        Channels::Position => "the position",
        Channels::Torque => "the torque",
        Channels::Both => "position and torque",
    }
}

fn of_joints(all: &[usize], joints: &[String]) -> String {
    if all.len() > 1 && all.len() == joints.len() {
        return "all joints".to_owned();
    }
    let names: Vec<String> = all.iter().map(|&joint| format!("joint `{}`", joints[joint])).collect();
    names.join(", ")
}

/// A mistake in a sentence that names the joints.
pub(super) fn sentence(mistake: &Mistake, joints: &[String]) -> String {
    match mistake {
        Mistake::Sign { joints: which, channels } => {
            let verb = if *channels == Channels::Both { "have" } else { "has" };
            format!("{} of {} {verb} the opposite sign", channels_text(*channels), of_joints(which, joints))
        }
        Mistake::Order { order, channels } => {
            let moved: Vec<usize> = (0..order.len()).filter(|&joint| order[joint] != joint).collect();
            if let [a, b] = moved[..] {
                return format!(
                    "{} of joints `{}` and `{}` are exchanged",
                    channels_text(*channels),
                    joints[a],
                    joints[b]
                );
            }
            let names: Vec<String> = order.iter().map(|&joint| format!("`{}`", joints[joint])).collect();
            format!(
                "the columns of {} stand in another order: where the study has {} they are of {}",
                channels_text(*channels),
                joints.join(", "),
                names.join(", ")
            )
        }
        Mistake::Offset { joint, offset_rad } => format!(
            "the zero of joint `{}` lies {:.1} degrees away from the description's",
            joints[*joint],
            offset_rad * 180.0 / PI
        ),
        Mistake::PositionUnit { joints: which, factor } if which.len() == joints.len() => {
            format!("the positions are in another unit or of the motor side: times {factor:.6} they are rad")
        }
        Mistake::PositionUnit { joints: which, factor } => format!(
            "the position of {} is in another unit than the others, or of the motor side: times {factor:.6} it is rad (m)",
            of_joints(which, joints)
        ),
        Mistake::TorqueUnit { joint, factor } if GAINS.contains(factor) => format!(
            "the torque of joint `{}` has another gain (motor constant, gear ratio) than the study says: times {factor:.3} it is \
             Nm (N)",
            joints[*joint]
        ),
        Mistake::TorqueUnit { joint, factor } => format!(
            "the torque of joint `{}` is in another unit than the others, or of the motor side: times {factor:.3} it is Nm (N)",
            joints[*joint]
        ),
        Mistake::Coupled { joint, with, sign, channels } => format!(
            "{} of joint `{}` {} of a motor that turns with joint `{}` as well: its column is `{}` {} `{}`",
            channels_text(*channels),
            joints[*joint],
            if *channels == Channels::Both { "are those" } else { "is that" },
            joints[*with],
            joints[*joint],
            if *sign > 0.0 { "+" } else { "-" },
            joints[*with]
        ),
        Mistake::TimeUnit { factor } if is_power_of_a_thousand(*factor) => {
            format!("time is in another unit: times {factor:e} it is in seconds")
        }
        Mistake::TimeUnit { factor } => {
            format!("the recorder had another rate: times {factor:.3} the stamps are seconds")
        }
        Mistake::Lag { joints: which, channels, lag_s } => format!(
            "{} of {} is logged {:.3} s {} than {}: two clocks, or a buffer",
            channels_text(*channels),
            of_joints(which, joints),
            lag_s.abs(),
            if *lag_s > 0.0 { "later" } else { "earlier" },
            if *channels == Channels::Torque { "the motion" } else { "all else" }
        ),
        Mistake::Convention { convention } => format!(
            "the Denavit-Hartenberg table is in the other convention: write `convention = \"{}\"` in its file",
            convention.name()
        ),
        Mistake::Length { joint, factor } if *factor < 0.0 => format!(
            "the description has joint `{}` on the other side of the joint before it: `xyz` of its origin has to be times {factor:.3}",
            joints[*joint]
        ),
        Mistake::Length { joint, factor } => format!(
            "the description has joint `{}` too {} the joint before it: `xyz` of its origin has to be times {factor:.3}",
            joints[*joint],
            if *factor > 1.0 { "near to" } else { "far from" }
        ),
        Mistake::Compensated => {
            "the torque is without gravity: the controller took off that of the description's bodies; log \
                                 the torque with gravity, or add to the columns what the controller takes off"
                .to_owned()
        }
        Mistake::Gravity { gravity_m_s2: [0.0, 0.0, 0.0] } => {
            "the torque is without gravity: the controller took it off, or nothing pulls at this robot".to_owned()
        }
        Mistake::Gravity { gravity_m_s2: [x, y, z] } => {
            format!("the base is mounted otherwise: gravity is [{x:.2}, {y:.2}, {z:.2}] m/s² in its frame")
        }
    }
}

/// Another explanation, with what it would have one write.
pub(super) fn alternative(mistake: &Mistake, joints: &[String], format: Option<&StudyFormat<'_>>) -> String {
    let changes = format.map_or_else(Vec::new, |format| format.changes(mistake));
    if changes.is_empty() {
        return sentence(mistake, joints);
    }
    let write: Vec<String> = changes.iter().map(|change| format!("[{}] {}", change.table, change.line)).collect();
    format!("{} ({})", sentence(mistake, joints), write.join(", "))
}

/// Logarithm of how much less of a joint's torque is left that says something.
const TELLS: f64 = 0.2;

/// Times a factor that another one has to be to be told from it in words.
const SAME_FACTOR: f64 = 1.1;

/// What speaks for a mistake: the joint whose torque it explains most, limits that then hold.
pub(super) fn evidence(mistake: &Mistake, before: &Reading, after: &Reading, joints: &[String]) -> String {
    let gain_of = |of: fn(&Reading) -> &[f64], joint: usize| {
        let share = |reading| of(reading).get(joint).map_or(1.0, |share: &f64| share.max(1e-6));
        (share(before) / share(after)).ln()
    };
    let gain = |joint: &usize| gain_of(|reading| &reading.left, *joint);
    let named: Vec<usize> = match mistake {
        Mistake::Sign { joints, .. } | Mistake::PositionUnit { joints, .. } | Mistake::Lag { joints, .. } => {
            joints.clone()
        }
        Mistake::Offset { joint, .. }
        | Mistake::TorqueUnit { joint, .. }
        | Mistake::Coupled { joint, .. }
        | Mistake::Length { joint, .. } => vec![*joint],
        Mistake::Order { .. }
        | Mistake::TimeUnit { .. }
        | Mistake::Convention { .. }
        | Mistake::Compensated
        | Mistake::Gravity { .. } => (0..joints.len()).collect(),
    };
    // The named joint's own torque where that tells; else the one that tells most.
    let own = named.iter().copied().max_by(|a, b| gain(a).total_cmp(&gain(b))).filter(|joint| gain(joint) > TELLS);
    let most = (0..joints.len()).max_by(|a, b| gain(a).total_cmp(&gain(b))).unwrap_or(0);
    let joint = own.unwrap_or(most);
    // Where any bodies explain both alike, it is the description's that speak.
    let by_bodies = |joint: &usize| gain_of(|reading| &reading.nominal, *joint);
    let of_bodies = (0..joints.len()).max_by(|a, b| by_bodies(a).total_cmp(&by_bodies(b)));
    let are_described = before.nominal.len() == joints.len() && after.nominal.len() == joints.len();
    let of_bodies = of_bodies.filter(|joint| are_described && gain(&most) <= TELLS && by_bodies(joint) > TELLS);
    let mut text = match of_bodies {
        Some(joint) => format!(
            "the description's bodies, friction aside, leave {:.1} % of the torque of `{}` as the study is written and {:.1} % so corrected; bodies that could be explain both alike",
            100.0 * before.nominal[joint],
            joints[joint],
            100.0 * after.nominal[joint]
        ),
        None => format!(
            "the best robot that can exist leaves {:.1} % of the torque of `{}` as the study is written and {:.1} % so corrected",
            100.0 * before.left[joint],
            joints[joint],
            100.0 * after.left[joint]
        ),
    };
    if before.beyond.len() > after.beyond.len() {
        let worst = &before.beyond[0];
        let _ = write!(
            text,
            "; as written, the {} of `{}` reaches {:.4} where its limit is {:.4}",
            worst.quantity, joints[worst.joint], worst.value, worst.limit
        );
    }
    if !before.plausible_rate && after.plausible_rate {
        text += "; as written, no recorder has such a rate";
    }
    text + &other_factors(mistake, after)
}

/// Which other factors of positions a reading cannot tell from its own; empty where there are none.
pub(super) fn other_factors(mistake: &Mistake, reading: &Reading) -> String {
    let alike = reading.factors_alike.filter(|[least, greatest]| *greatest > SAME_FACTOR * least);
    match (mistake, alike) {
        (Mistake::PositionUnit { .. }, Some(alike)) => {
            let [least, greatest] = alike.map(significant);
            format!(
                "; these logs cannot tell it from any between {least} and {greatest}: take gear ratios, or counts of encoders, from the data sheet"
            )
        }
        _ => String::new(),
    }
}

fn is_power_of_a_thousand(factor: f64) -> bool {
    let power = factor.log10() / 3.0;
    (power - power.round()).abs() < 1e-9
}
