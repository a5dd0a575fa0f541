//! Quantity, joint, unit and source of a column from its name.

use super::quantity::Quantity;
use super::units::{ended, unit_for};
use core::ops::Range;

#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::jobs) enum JointKey {
    /// Index of a joint of the robot.
    Joint(usize),
    /// A name that is not a joint of the robot, in lower case: `elbow` of `effort[elbow]` or `elbow.pos`.
    Name(String),
    /// A number in the name: `q3`, `tau[0]`.
    Number(u64),
    /// No joint in the name: the only column of its kind.
    Alone,
}

/// Source of a quantity; a higher value is preferred.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::jobs) enum Source {
    /// Computed from a model or estimated, according to the name.
    Computed,
    /// A commanded value.
    Commanded,
    /// A filtered copy of a recorded value, according to the name.
    Filtered,
    /// The name contains no source.
    Unstated,
    /// A measured value, according to the name.
    Measured,
}

impl Source {
    /// Whether the quantity was recorded from the robot: measured, or without a source in the name.
    pub(in crate::jobs) fn is_recorded(self) -> bool {
        self > Self::Commanded
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::jobs) struct Meaning {
    /// Quantity; `None` if only the name of the file could give it.
    pub(in crate::jobs) quantity: Option<Quantity>,
    pub(in crate::jobs) joint: JointKey,
    pub(in crate::jobs) source: Source,
    /// Unit, in the notation of a study.
    pub(in crate::jobs) unit: Option<&'static str>,
    /// Whether the column contains a part or an error of a quantity, a limit or a status.
    pub(in crate::jobs) is_part: bool,
    /// The name without its joint; it is equal for the columns of all joints.
    pub(in crate::jobs) stem: String,
}

const POSITIONS: [&str; 12] =
    ["q", "qs", "qpos", "pos", "position", "positions", "angle", "angles", "theta", "jointpos", "jointposition", "phi"];
const VELOCITIES: [&str; 15] = [
    "dq",
    "qvel",
    "dqs",
    "qd",
    "vels",
    "vitesse",
    "qdot",
    "vel",
    "velocity",
    "velocities",
    "speed",
    "speeds",
    "omega",
    "dtheta",
    "jointvel",
];
const ACCELERATIONS: [&str; 7] = ["ddq", "qdd", "qddot", "acc", "accel", "acceleration", "accelerations"];
const TORQUES: [&str; 14] = [
    "tau",
    "qfrc",
    "taus",
    "eff",
    "couple",
    "torque",
    "torques",
    "effort",
    "efforts",
    "moment",
    "moments",
    "trq",
    "msrtrq",
    "jointtorque",
];
const CURRENTS: [&str; 5] = ["current", "currents", "curr", "amps", "ampere"];
const COMMANDED: [&str; 26] = [
    "cmd",
    "ctrl",
    "cmds",
    "command",
    "commands",
    "commanded",
    "desired",
    "des",
    "target",
    "targets",
    "ref",
    "reference",
    "set",
    "setpoint",
    "sp",
    "soll",
    "demand",
    "demanded",
    "planned",
    "lead",
    "leader",
    "goal",
    "goals",
    "action",
    "interp",
    "d",
];
/// Names without a quantity that are positions: a command or an encoder alone, and the words of a LeRobot data set.
const POSITIONS_ALONE: [&str; 13] = [
    "cmd", "cmds", "command", "commands", "target", "targets", "goal", "goals", "action", "ctrl", "enc", "encoder",
    "encoders",
];
/// Beginning of the columns of the commands in a SAGE recording.
const SAGE_COMMANDS: &str = "control.";
const MEASURED: [&str; 19] = [
    "actual", "act", "measured", "meas", "msr", "sensor", "sensed", "ist", "fb", "fbk", "feedback", "executed", "real",
    "present", "encoder", "encoders", "enc", "follow", "follower",
];
const FILTERED: [&str; 7] = ["filtered", "filt", "flt", "smoothed", "smooth", "lowpass", "lpf"];
const COMPUTED: [&str; 20] = [
    "computed",
    "calculated",
    "calc",
    "comp",
    "estimated",
    "estimate",
    "est",
    "predicted",
    "prediction",
    "pred",
    "simulated",
    "sim",
    "rnea",
    "hat",
    "nominal",
    "ff",
    "feedforward",
    "theoretical",
    "expected",
    "reconstructed",
];
/// Quantities that are not the total position or torque of a joint: errors, parts of a torque, and others.
const OTHERS: [&str; 34] = [
    "cos",
    "sin",
    "passive",
    "bias",
    "constraint",
    "ext",
    "external",
    "error",
    "err",
    "residual",
    "model",
    "gravity",
    "grav",
    "gravitational",
    "coriolis",
    "centrifugal",
    "inertia",
    "inertial",
    "friction",
    "fric",
    "window",
    "tcp",
    "ee",
    "wrench",
    "limit",
    "std",
    "temp",
    "dynamics",
    "damping",
    "enable",
    "enabled",
    "status",
    "mode",
    "constant",
];
/// Suffixes for parts of a torque, as in `tau_g`; in other names these letters can be joints or axes.
const PARTS_OF_TORQUE: [&str; 1] = ["g"];

/// Interprets `name` for a robot with these joints.
pub(in crate::jobs) fn meaning(name: &str, joints: &[String]) -> Meaning {
    // The name as written, `jointGripper.pos`, or split at capital letters, `elbowPosition`.
    #[allow(clippy::single_match_else, reason = "both cases have the same form")]
    let (rest, joint) = match without_joint(name, joints) {
        (rest, Some(joint)) => (split_camel_case(&rest).to_lowercase(), Some(joint)),
        _ => {
            let split: Vec<String> = joints.iter().map(|joint| split_camel_case(joint)).collect();
            let (rest, joint) = without_joint(&split_camel_case(name), &split);
            (rest.to_lowercase(), joint)
        }
    };
    // Only units of joint quantities are recognised: the suffix of a motor torque `tau_m` does not mean metres.
    let is_length = |before: &str, unit: &str| {
        let is_position = |word: &String| !is_quantity(word) || POSITIONS.contains(&word.as_str());
        (unit == "mm" || unit == "m" && joint.is_some()) && words(before).iter().all(is_position)
    };
    let with_unit = |text: &str| {
        let (before, unit, quantity) = ended(text)?;
        let quantity = quantity.or_else(|| is_length(&before, unit).then_some(Quantity::Position))?;
        Some((before, unit, Some(quantity)))
    };
    let (rest, unit) = match with_unit(&rest) {
        Some((rest, unit, quantity)) => (rest, Some((unit, quantity))),
        None => (rest, None),
    };
    let (rest, named) = if joint.is_none() { without_brackets(&rest) } else { (rest, None) };
    let (rest, named) = match named.as_deref().and_then(|named| named.rsplit_once('.')) {
        // In `action[elbow.pos]` and `observation.state[joint_1.torque]` the quantity is a part of the entry's name.
        Some((own, quantity)) if is_quantity(quantity) => (format!("{rest} {quantity}"), Some(own.to_owned())),
        _ => (rest, named),
    };
    let words: Vec<String> = words(&rest).into_iter().flat_map(split_compound).collect();
    let (number, words) = match words.iter().rposition(|word| word.bytes().all(|byte| byte.is_ascii_digit())) {
        Some(at) => (words[at].parse().ok(), [&words[..at], &words[at + 1..]].concat()),
        None => (None, words),
    };
    let has = |list: &[&str]| words.iter().any(|word| list.contains(&word.as_str()));
    let by_words = [
        // The longest derivative comes first, because `ddq` contains `q`.
        (&ACCELERATIONS[..], Quantity::Acceleration),
        (&VELOCITIES[..], Quantity::Velocity),
        (&CURRENTS[..], Quantity::Current),
        (&TORQUES[..], Quantity::Torque),
        (&POSITIONS[..], Quantity::Position),
    ];
    let place = |list: &[&str]| words.iter().position(|word| list.contains(&word.as_str()));
    // The word "current" before a position, velocity or torque means "present".
    let is_present = place(&["current"]).is_some_and(|at| {
        [&VELOCITIES[..], &TORQUES, &POSITIONS].into_iter().any(|list| place(list).is_some_and(|word| word > at))
    });
    let by_words = by_words.into_iter().filter(|(_, quantity)| !is_present || *quantity != Quantity::Current);
    let by_word = by_words.into_iter().find(|(list, _)| has(list)).map(|(_, quantity)| quantity);
    let is_entry = joint.is_some() || named.is_some() || number.is_some();
    let of_entries = match &words[..] {
        [word] if POSITIONS_ALONE.contains(&&word[..]) => Some(Quantity::Position),
        [joint, word] if joint == "joint" && POSITIONS_ALONE.contains(&&word[..]) => Some(Quantity::Position),
        [first, second] if first == "observation" && second == "state" => Some(Quantity::Position),
        [.., first, second] if first == "joint" && ["state", "states"].contains(&&second[..]) => {
            Some(Quantity::Position)
        }
        _ => None,
    };
    let by_word = by_word.or_else(|| of_entries.filter(|_| is_entry && unit.is_none()));
    // A torque in amperes is a current. Any other unit is used only if the words contain no quantity.
    let of_unit = unit.and_then(|(_, quantity)| quantity);
    let quantity = match (by_word, of_unit) {
        (Some(Quantity::Torque), Some(Quantity::Current)) => Some(Quantity::Current),
        // A suffix of one letter is not sufficient evidence for a current.
        (None, Some(Quantity::Current)) if unit.is_some_and(|(unit, _)| unit == "A") => None,
        (by_word, of_unit) => by_word.or(of_unit),
    };
    let unit = unit.zip(quantity).and_then(|((unit, of_unit), quantity)| unit_for(unit, of_unit, quantity));
    let is_part = has(&OTHERS) || quantity == Some(Quantity::Torque) && has(&PARTS_OF_TORQUE);
    let is_unnamed = joint.is_none() && named.is_none() && number.is_none() && quantity.is_some();
    let own = if is_unnamed { other_words(&words) } else { 0..0 };
    let stem = [&words[..own.start], &words[own.end..]].concat().join("_");
    let named = named.or_else(|| (!own.is_empty()).then(|| words[own].join("_")));
    let source = if has(&COMPUTED) {
        Source::Computed
    } else if has(&COMMANDED) || name.starts_with(SAGE_COMMANDS) {
        Source::Commanded
    } else if has(&FILTERED) {
        Source::Filtered
    } else if has(&MEASURED) || is_present {
        Source::Measured
    } else {
        Source::Unstated
    };
    Meaning {
        quantity: quantity.filter(|_| !is_part),
        joint: (joint.map(JointKey::Joint).or(named.map(JointKey::Name)))
            .or(number.map(JointKey::Number))
            .unwrap_or(JointKey::Alone),
        source,
        unit,
        is_part,
        stem,
    }
}

/// Splits a word that combines a quantity and its source: `qdes`, `taufb`, `sollposition`.
fn split_compound(word: String) -> Vec<String> {
    let is_source = |part: &str| part.len() > 1 && (COMMANDED.contains(&part) || MEASURED.contains(&part));
    if is_quantity(&word) || is_source(&word) {
        return vec![word];
    }
    let is_compound = |(first, second): &(&str, &str)| {
        is_quantity(first) && is_source(second) || is_source(first) && is_quantity(second)
    };
    let parts = word.char_indices().skip(1).map(|(at, _)| word.split_at(at)).find(is_compound);
    parts.map_or_else(|| vec![word.clone()], |(first, second)| vec![first.to_owned(), second.to_owned()])
}

pub(in crate::jobs) fn is_quantity(word: &str) -> bool {
    let lists: [&[&str]; 5] = [&POSITIONS, &VELOCITIES, &ACCELERATIONS, &TORQUES, &CURRENTS];
    lists.iter().any(|list| list.contains(&word))
}

/// Positions of the words that are neither a quantity nor a source, if they are consecutive: `shoulder_pan` in
/// `shoulder_pan.pos`.
fn other_words(words: &[String]) -> Range<usize> {
    let lists: [&[&str]; 9] =
        [&POSITIONS, &VELOCITIES, &ACCELERATIONS, &TORQUES, &CURRENTS, &COMMANDED, &MEASURED, &COMPUTED, &FILTERED];
    let is_other = |word: &String| !lists.iter().any(|list| list.contains(&word.as_str()));
    match (words.iter().position(is_other), words.iter().rposition(is_other)) {
        (Some(first), Some(last)) if words[first..=last].iter().all(is_other) => first..last + 1,
        _ => 0..0,
    }
}

/// Quantity and source from a file name, for columns whose names consist of joint names only.
pub(in crate::jobs) fn of_file(stem: &str) -> (Option<Quantity>, Source) {
    let found = meaning(stem, &[]);
    (found.quantity, found.source)
}

/// Splits camel case: `actualQ` becomes `actual_Q`.
fn split_camel_case(name: &str) -> String {
    let mut text = String::with_capacity(name.len() + 4);
    let (mut earlier, mut before) = (' ', ' ');
    for c in name.chars() {
        // Not in the units `mNm`, `kNm` and `mA`.
        let is_unit = c == 'N' && ['m', 'k'].contains(&before) || c == 'A' && before == 'm';
        let is_prefix = is_unit && !earlier.is_alphabetic();
        if before.is_lowercase() && c.is_uppercase() && !is_prefix {
            text.push('_');
        }
        text.push(c);
        (earlier, before) = (before, c);
    }
    text
}

/// Removes the longest joint name that is a separate word, in upper or lower case; returns the rest and the joint's
/// index.
fn without_joint(name: &str, joints: &[String]) -> (String, Option<usize>) {
    // Only ASCII letters change, so that positions in both texts are equal.
    let lower = name.to_ascii_lowercase();
    let mut found: Option<(usize, usize, usize)> = None;
    for (place, joint) in joints.iter().enumerate() {
        let joint = joint.to_ascii_lowercase();
        if joint.is_empty() {
            continue;
        }
        let is_separate_word = |at: &usize| {
            let is_part = |c: Option<char>| c.is_some_and(char::is_alphanumeric);
            !is_part(lower[..*at].chars().next_back()) && !is_part(lower[*at + joint.len()..].chars().next())
        };
        let at = lower.match_indices(&joint).map(|(at, _)| at).find(is_separate_word);
        if let Some(at) = at
            && found.is_none_or(|(_, length, _)| length < joint.len())
        {
            found = Some((at, joint.len(), place));
        }
    }
    match found {
        Some((at, length, place)) => (format!("{} {}", &name[..at], &name[at + length..]), Some(place)),
        None => (name.to_owned(), None),
    }
}

fn without_brackets(lower: &str) -> (String, Option<String>) {
    let found = lower.strip_suffix(']').and_then(|name| name.rsplit_once('['));
    match found.filter(|(_, inside)| inside.chars().any(char::is_alphabetic)) {
        Some((before, inside)) => (before.to_owned(), Some(inside.to_owned())),
        None => (lower.to_owned(), None),
    }
}

pub(in crate::jobs) fn words(text: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut before: Option<bool> = None;
    for c in text.chars() {
        let kind = c.is_alphanumeric().then(|| c.is_ascii_digit());
        match (before, kind) {
            (Some(a), Some(b)) if a == b => {
                if let Some(word) = words.last_mut() {
                    word.push(c);
                }
            }
            (_, Some(_)) => words.push(c.to_string()),
            (_, None) => {}
        }
        before = kind;
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use JointKey::{Alone, Joint, Name, Number};
    use Quantity::{Acceleration, Current, Position, Torque, Velocity};

    #[test]
    fn names_of_real_recordings_are_understood() {
        let joints = ["arm_1_joint", "arm_11_joint", "shoulder_pan_joint", "Joint_1"].map(str::to_owned);
        let cases = [
            ("q1_rad", Some(Position), Number(1), Source::Unstated, Some("rad")),
            ("qd1_rad_s", Some(Velocity), Number(1), Source::Unstated, Some("rad/s")),
            ("qdd7_rad_s2", Some(Acceleration), Number(7), Source::Unstated, Some("rad/s^2")),
            ("tau3_Nm", Some(Torque), Number(3), Source::Unstated, Some("N m")),
            ("tau_cmd1_Nm", Some(Torque), Number(1), Source::Commanded, Some("N m")),
            ("tau_ext_0", None, Number(0), Source::Unstated, None),
            ("q_6", Some(Position), Number(6), Source::Unstated, None),
            ("- arm_1_joint_effort", Some(Torque), Joint(0), Source::Unstated, None),
            ("- arm_11_joint_position", Some(Position), Joint(1), Source::Unstated, None),
            ("/joint_states.position[shoulder_pan_joint]", Some(Position), Joint(2), Source::Unstated, None),
            ("/joint_states.effort[shoulder_pan_joint]", Some(Torque), Joint(2), Source::Unstated, None),
            ("/joint_states.effort[Other]", Some(Torque), Name("other".to_owned()), Source::Unstated, None),
            ("actual_q_0", Some(Position), Number(0), Source::Measured, None),
            ("actual_qd_0", Some(Velocity), Number(0), Source::Measured, None),
            ("target_q_0", Some(Position), Number(0), Source::Commanded, None),
            ("actual_current_5", Some(Current), Number(5), Source::Measured, None),
            ("actual_current_window_5", None, Number(5), Source::Measured, None),
            ("actual_momentum", None, Alone, Source::Measured, None),
            ("target_moment_2", Some(Torque), Number(2), Source::Commanded, None),
            ("tau_J[3]", Some(Torque), Number(3), Source::Unstated, None),
            ("tau_J_d[3]", Some(Torque), Number(3), Source::Commanded, None),
            ("q_d[3]", Some(Position), Number(3), Source::Commanded, None),
            ("msrJointTorque2", Some(Torque), Number(2), Source::Measured, None),
            ("position_deg[4]", Some(Position), Number(4), Source::Unstated, Some("deg")),
            ("J2 torque [Nm]", Some(Torque), Number(2), Source::Unstated, Some("N m")),
            ("axis 3 act angle [deg]", Some(Position), Number(3), Source::Measured, Some("deg")),
            ("tau2(mNm)", Some(Torque), Number(2), Source::Unstated, Some("mN m")),
            ("tau2_mNm", Some(Torque), Number(2), Source::Unstated, Some("mN m")),
            ("current2 [mA]", Some(Current), Number(2), Source::Unstated, Some("mA")),
            ("tau2 [Ncm]", Some(Torque), Number(2), Source::Unstated, Some("N cm")),
            ("tau2 [N*m]", Some(Torque), Number(2), Source::Unstated, Some("N m")),
            ("Couple axe 2 (N·m)", Some(Torque), Number(2), Source::Unstated, Some("N m")),
            ("shoulder_pan_joint_mm", Some(Position), Joint(2), Source::Unstated, Some("mm")),
            ("shoulder_pan_joint_tau_m", Some(Torque), Joint(2), Source::Unstated, None),
            ("tau_3_m", Some(Torque), Number(3), Source::Unstated, None),
            ("SetPos1", Some(Position), Number(1), Source::Commanded, None),
            ("ActTorque1", Some(Torque), Number(1), Source::Measured, None),
            ("qdes1", Some(Position), Number(1), Source::Commanded, None),
            ("taufb1", Some(Torque), Number(1), Source::Measured, None),
            ("Sollmoment_A3", Some(Torque), Number(3), Source::Commanded, None),
            ("planned_q4", Some(Position), Number(4), Source::Commanded, None),
            ("q_filtered_1", Some(Position), Number(1), Source::Filtered, None),
            ("current_position_1", Some(Position), Number(1), Source::Measured, None),
            ("current_torque_1", Some(Torque), Number(1), Source::Measured, None),
            ("torque_current_1", Some(Current), Number(1), Source::Unstated, None),
            ("joint_states[4]", Some(Position), Number(4), Source::Unstated, None),
            ("wrist_2_joint_eff", Some(Torque), Number(2), Source::Unstated, None),
            ("Joint 4 angle (deg)", Some(Position), Number(4), Source::Unstated, Some("deg")),
            ("joint_1", None, Joint(3), Source::Unstated, None),
            ("wrist_flex.pos", Some(Position), Name("wrist_flex".to_owned()), Source::Unstated, None),
            ("shoulder_pan_joint.vel_deg", Some(Velocity), Joint(2), Source::Unstated, Some("deg/s")),
            ("tau_est_4", Some(Torque), Number(4), Source::Computed, None),
            ("tau_g_4", None, Number(4), Source::Unstated, None),
            ("cmd_2", Some(Position), Number(2), Source::Commanded, None),
            ("goal_position_3", Some(Position), Number(3), Source::Commanded, None),
            ("target[Other]", Some(Position), Name("other".to_owned()), Source::Commanded, None),
            ("enc_Joint_1", Some(Position), Joint(3), Source::Measured, None),
            ("encoder_2_rad", Some(Position), Number(2), Source::Measured, Some("rad")),
            ("cmd_2 [A]", None, Number(2), Source::Commanded, None),
            ("action[elbow.pos]", Some(Position), Name("elbow".to_owned()), Source::Commanded, None),
            ("action[2]", Some(Position), Number(2), Source::Commanded, None),
            ("observation.state[elbow.pos]", Some(Position), Name("elbow".to_owned()), Source::Unstated, None),
            ("observation.state[joint_1.torque]", Some(Torque), Joint(3), Source::Unstated, None),
            ("observation.state[joint_2.torque]", Some(Torque), Name("joint_2".to_owned()), Source::Unstated, None),
            ("observation.state[joint_2.vel]", Some(Velocity), Name("joint_2".to_owned()), Source::Unstated, None),
            ("observation.state[1]", Some(Position), Number(1), Source::Unstated, None),
            ("control.positions[Elbow]", Some(Position), Name("elbow".to_owned()), Source::Commanded, None),
            ("state_motor.positions[Elbow]", Some(Position), Name("elbow".to_owned()), Source::Unstated, None),
            ("target", None, Alone, Source::Commanded, None),
            ("joint_cmd_shoulder_pan_joint", Some(Position), Joint(2), Source::Commanded, None),
            ("joint_cmd_2", Some(Position), Number(2), Source::Commanded, None),
            ("qpos[2]", Some(Position), Number(2), Source::Unstated, None),
            ("ctrl[2]", Some(Position), Number(2), Source::Commanded, None),
            ("qfrc_actuator[2]", Some(Torque), Number(2), Source::Unstated, None),
            ("qfrc_bias[2]", None, Number(2), Source::Unstated, None),
            ("joint_pos_cos[2]", None, Number(2), Source::Unstated, None),
            ("position_deg_2", Some(Position), Number(2), Source::Unstated, Some("deg")),
            ("torque_nm_2", Some(Torque), Number(2), Source::Unstated, Some("N m")),
            ("tau_a_2", Some(Torque), Number(2), Source::Unstated, None),
        ];
        for (name, quantity, joint, source, unit) in cases {
            let found = meaning(name, &joints);
            assert_eq!(
                (found.quantity, &found.joint, found.source, found.unit),
                (quantity, &joint, source, unit),
                "{name}"
            );
        }
        assert_eq!(of_file("curr_data").0, Some(Current));
        assert_eq!(of_file("pos_read_data").0, Some(Position));
        assert_eq!(of_file("measurements").0, None);
        assert_eq!(meaning("tau_1", &joints).stem, meaning("tau_2", &joints).stem);
        assert_ne!(meaning("tau_ext_1", &joints).stem, meaning("tau_1", &joints).stem);
    }
}
