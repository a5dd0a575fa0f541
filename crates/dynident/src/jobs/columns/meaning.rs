//! Quantity, joint, unit and source of a column from its name.

use super::quantity::Quantity;
use super::units::ended;

#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::jobs) enum JointKey {
    /// Index of a joint of the robot.
    Joint(usize),
    /// A name in brackets that is not a joint of the robot: `effort[elbow]`, in lower case.
    Name(String),
    /// A number in the name: `q3`, `tau[0]`.
    Number(u64),
    /// No joint: the only column of its kind.
    Alone,
}

/// Source of a quantity; a higher value is preferred.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::jobs) enum Source {
    /// A commanded value.
    Commanded,
    /// Not stated in the name.
    Unstated,
    /// A measured value, according to the name.
    Measured,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::jobs) struct Meaning {
    /// `None` if only the name of the file could give it.
    pub(in crate::jobs) quantity: Option<Quantity>,
    pub(in crate::jobs) joint: JointKey,
    pub(in crate::jobs) source: Source,
    /// In the notation of a study.
    pub(in crate::jobs) unit: Option<&'static str>,
    /// The name without its joint, equal for the columns of all joints.
    pub(in crate::jobs) stem: String,
}

const POSITIONS: [&str; 10] =
    ["q", "pos", "position", "positions", "angle", "angles", "theta", "jointpos", "jointposition", "phi"];
const VELOCITIES: [&str; 11] =
    ["dq", "qd", "qdot", "vel", "velocity", "velocities", "speed", "speeds", "omega", "dtheta", "jointvel"];
const ACCELERATIONS: [&str; 7] = ["ddq", "qdd", "qddot", "acc", "accel", "acceleration", "accelerations"];
const TORQUES: [&str; 10] =
    ["tau", "torque", "torques", "effort", "efforts", "moment", "moments", "trq", "msrtrq", "jointtorque"];
const CURRENTS: [&str; 5] = ["current", "currents", "curr", "amps", "ampere"];
const COMMANDED: [&str; 11] =
    ["cmd", "command", "commanded", "desired", "des", "target", "ref", "reference", "setpoint", "goal", "d"];
const MEASURED: [&str; 6] = ["actual", "measured", "meas", "msr", "sensor", "sensed"];
/// Quantities that are neither measured nor commanded: estimates and others.
const OTHERS: [&str; 16] = [
    "ext", "external", "error", "err", "residual", "model", "gravity", "grav", "friction", "window", "tcp", "ee",
    "wrench", "limit", "std", "temp",
];

/// Interprets `name` for a robot with these joints.
pub(in crate::jobs) fn meaning(name: &str, joints: &[String]) -> Meaning {
    let lower = split_camel_case(name).to_lowercase();
    let (rest, joint) = without_joint(&lower, joints);
    // Only units of joint quantities: the suffix of a motor torque `tau_m` is not metres.
    let with_unit = |text: &str| ended(text).filter(|(_, _, quantity)| quantity.is_some());
    let (rest, unit) = match with_unit(&rest) {
        Some((rest, unit, quantity)) => (rest, Some((unit, quantity))),
        None => (rest, None),
    };
    let (rest, named) = if joint.is_none() { without_brackets(&rest) } else { (rest, None) };
    let words = words(&rest);
    let (number, words) = match words.iter().rposition(|word| word.bytes().all(|byte| byte.is_ascii_digit())) {
        Some(at) => (words[at].parse().ok(), [&words[..at], &words[at + 1..]].concat()),
        None => (None, words),
    };
    let has = |list: &[&str]| words.iter().any(|word| list.contains(&word.as_str()));
    let by_words = [
        // The longest derivative first, because `ddq` contains `q`.
        (&ACCELERATIONS[..], Quantity::Acceleration),
        (&VELOCITIES[..], Quantity::Velocity),
        (&CURRENTS[..], Quantity::Current),
        (&TORQUES[..], Quantity::Torque),
        (&POSITIONS[..], Quantity::Position),
    ];
    let by_word = by_words.into_iter().find(|(list, _)| has(list)).map(|(_, quantity)| quantity);
    // A torque in amperes is a current; any other unit is used only if the words give no quantity.
    let of_unit = unit.and_then(|(_, quantity)| quantity);
    let quantity = match (by_word, of_unit) {
        (Some(Quantity::Torque), Some(Quantity::Current)) => Some(Quantity::Current),
        // A suffix of one letter is not sufficient for a current.
        (None, Some(Quantity::Current)) if unit.is_some_and(|(unit, _)| unit == "A") => None,
        (by_word, of_unit) => by_word.or(of_unit),
    };
    let is_of_unit = |(_, of_unit): &(&str, Option<Quantity>)| *of_unit == quantity;
    let source = if has(&COMMANDED) {
        Source::Commanded
    } else if has(&MEASURED) {
        Source::Measured
    } else {
        Source::Unstated
    };
    Meaning {
        quantity: quantity.filter(|_| !has(&OTHERS)),
        joint: (joint.map(JointKey::Joint).or(named.map(JointKey::Name)))
            .or(number.map(JointKey::Number))
            .unwrap_or(JointKey::Alone),
        source,
        unit: unit.filter(is_of_unit).map(|(unit, _)| unit),
        stem: words.join("_"),
    }
}

/// Quantity and source from a file name, for columns that are named by joints alone.
pub(in crate::jobs) fn of_file(stem: &str) -> (Option<Quantity>, Source) {
    let found = meaning(stem, &[]);
    (found.quantity, found.source)
}

/// Splits camel case: `actualQ` becomes `actual_Q`.
fn split_camel_case(name: &str) -> String {
    let mut text = String::with_capacity(name.len() + 4);
    let mut before = ' ';
    for c in name.chars() {
        if before.is_lowercase() && c.is_uppercase() {
            text.push('_');
        }
        text.push(c);
        before = c;
    }
    text
}

/// Removes the longest joint name that is a separate word; returns the rest and the joint's index.
fn without_joint(lower: &str, joints: &[String]) -> (String, Option<usize>) {
    let mut found: Option<(usize, usize, usize)> = None;
    for (place, joint) in joints.iter().enumerate() {
        let joint = joint.to_lowercase();
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
        Some((at, length, place)) => (format!("{} {}", &lower[..at], &lower[at + length..]), Some(place)),
        None => (lower.to_owned(), None),
    }
}

fn without_brackets(lower: &str) -> (String, Option<String>) {
    let found = lower.strip_suffix(']').and_then(|name| name.rsplit_once('['));
    match found.filter(|(_, inside)| inside.chars().any(char::is_alphabetic)) {
        Some((before, inside)) => (before.to_owned(), Some(inside.to_owned())),
        None => (lower.to_owned(), None),
    }
}

fn words(text: &str) -> Vec<String> {
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
            ("axis 3 act angle [deg]", Some(Position), Number(3), Source::Unstated, Some("deg")),
            ("Joint 4 angle (deg)", Some(Position), Number(4), Source::Unstated, Some("deg")),
            ("joint_1", None, Joint(3), Source::Unstated, None),
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
