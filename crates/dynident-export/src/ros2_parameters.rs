//! Parameters of a ROS 2 node, in addition to `robot_description`.

use crate::descriptions::frictions;
use crate::error::ExportError;
use crate::exported::Exported;
use crate::model_file::{ModelConstant, ModelTerm, upper_triangle};
use crate::robot_model::RobotModel;
use core::fmt::Write;
use dynident_model::InertialParameters;
use dynident_text::quoted;

/// YAML of parameters. For each joint: mass, centre of mass and inertia of its body, drive inertia, fitted Coulomb
/// and viscous friction, and all torque terms. Also gravity and couplings. Arrays contain only numbers, and names
/// only letters, digits and `_`, because ROS splits names at dots.
pub(crate) fn ros2_parameters(robot: &RobotModel, mut notes: Vec<String>) -> Result<Exported, ExportError> {
    let model = robot.model();
    notes.push("Placements and axes of joints are those of robot_description.".to_owned());
    let friction = frictions(robot, "coulomb", "viscous", &mut notes);
    let names: Vec<&str> = model.joints().iter().map(|joint| joint.name.as_str()).collect();
    let keys = parameter_names(&names);
    for (name, key) in names.iter().zip(&keys).filter(|(name, key)| *name != key) {
        notes.push(format!("Joint {name} is under dynamics.{key}."));
    }
    for (_, joint) in model.followers() {
        notes.push(format!("Joint {} follows others: its body is omitted here; see the format json.", joint.name));
    }
    let mut text = String::new();
    for note in &notes {
        let _ = writeln!(text, "# {}", dynident_text::comment(note));
    }
    let joints: Vec<String> = names.iter().map(|name| quoted(name)).collect();
    let _ = write!(
        text,
        "/**:\n  ros__parameters:\n    robot: {}\n    joints: [{}]\n    # In the frame of the base.\n    gravity_m_s2: {}\n    dynamics:\n",
        quoted(model.name()),
        joints.join(", "),
        array(&model.gravity().0)
    );
    for (index, (joint, key)) in model.joints().iter().zip(&keys).enumerate() {
        let body = &model.bodies()[model.body_of(index)];
        let inertial = &model.inertials()[model.body_of(index)];
        let (com, inertia) = about_centre(inertial, body.name())?;
        let terms = ModelTerm::of(robot, |term| term.own_joint() == Some(index));
        let (rotor, moment, damping, force) = if joint.is_rotary() {
            ("drive_inertia_kgm2", "coulomb_nm", "viscous_nm_s_per_rad", "torque")
        } else {
            ("drive_inertia_kg", "coulomb_n", "viscous_n_s_per_m", "force")
        };
        let drives = terms.iter().filter(|term| term.kind == "drive-inertia");
        let _ = write!(
            text,
            "      {key}:\n        # In the frame of this link; inertia about the centre of mass: xx, xy, xz, yy, yz, zz.\n        link: {}\n        mass_kg: {}\n        com_m: {}\n        inertia_at_com_kgm2: {}\n        {rotor}: {}\n        # {force} = coulomb sign(dq) + viscous dq\n        {moment}: {}\n        {damping}: {}\n",
            quoted(body.name()),
            number(inertial.mass_kg()),
            array(&com),
            array(&inertia),
            number(drives.map(|term| term.value).sum()),
            number(friction[index].coulomb),
            number(friction[index].viscous),
        );
        write_terms(&mut text, "terms", &terms, 8);
    }
    write_terms(&mut text, "couplings", &ModelTerm::of(robot, |term| term.own_joint().is_none()), 4);
    Ok(Exported { text, notes })
}

/// Writes terms with their symbols as keys; omits `key` if there are none, because a parameter cannot be an empty
/// map.
fn write_terms(text: &mut String, key: &str, terms: &[ModelTerm], depth: usize) {
    if terms.is_empty() {
        return;
    }
    let pad = " ".repeat(depth);
    let _ = writeln!(text, "{pad}{key}:");
    let symbols: Vec<&str> = terms.iter().map(|term| term.symbol.as_str()).collect();
    for (term, name) in terms.iter().zip(parameter_names(&symbols)) {
        let _ = write!(
            text,
            "{pad}  {name}:\n{pad}    kind: {}\n{pad}    value: {}\n{pad}    unit: {}\n",
            quoted(&term.kind),
            number(term.value),
            quoted(&term.unit)
        );
        if let [first, second] = &term.joints[..] {
            let _ = writeln!(text, "{pad}    joints: [{}, {}]", quoted(first), quoted(second));
        }
        for (constant, value) in &term.constants {
            let value = match value {
                ModelConstant::Number(value) => number(*value),
                ModelConstant::Numbers(values) => array(values),
                ModelConstant::List(values) => array(values),
                ModelConstant::Word(word) => quoted(word),
            };
            let _ = writeln!(text, "{pad}    {constant}: {value}");
        }
    }
}

/// Centre of mass, and inertia about it. For a body without mass the centre is the origin, because a parameter cannot
/// be null.
fn about_centre(inertial: &InertialParameters, body: &str) -> Result<([f64; 3], [f64; 6]), ExportError> {
    match (inertial.com_m(), inertial.inertia_at_com()) {
        (Some(com), Some(inertia)) => Ok((com.0, upper_triangle(&inertia.0))),
        _ if inertial.first_moment().0 == [0.0; 3] => Ok(([0.0; 3], upper_triangle(&inertial.inertia_at_origin().0))),
        _ => Err(ExportError::NotPhysical { body: body.to_owned(), reader: "a list of centres of mass" }),
    }
}

/// Words that YAML 1.1 would not read as text.
const RESERVED_WORDS: [&str; 9] = ["y", "n", "yes", "no", "on", "off", "true", "false", "null"];

/// Maximum key length; YAML allows 1024 characters before the colon.
const MAX_KEY_LENGTH: usize = 200;

/// Unique parameter names of letters, digits and `_`, not starting with a digit, and not reserved in YAML.
fn parameter_names(names: &[&str]) -> Vec<String> {
    let mut taken: Vec<String> = Vec::new();
    for name in names {
        let safe = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
        let mut key: String = name.chars().take(MAX_KEY_LENGTH).map(safe).collect();
        if !key.starts_with(|c: char| c.is_ascii_alphabetic()) || RESERVED_WORDS.contains(&&*key.to_ascii_lowercase()) {
            key.insert_str(0, "joint_");
        }
        let mut free = key.clone();
        let mut number = 2;
        // The changed name can be the original name of another joint.
        while taken.contains(&free) || names.contains(&free.as_str()) && free != *name {
            free = format!("{key}_{number}");
            number += 1;
        }
        taken.push(free);
    }
    taken
}

/// A number that YAML 1.1 and 1.2 parse as floating point: with a decimal point, and with a sign of the exponent.
fn number(value: f64) -> String {
    let text = format!("{value:?}");
    let Some((digits, exponent)) = text.split_once('e') else { return text };
    let point = if digits.contains('.') { "" } else { ".0" };
    let sign = if exponent.starts_with('-') { "" } else { "+" };
    format!("{digits}{point}e{sign}{exponent}")
}

fn array(values: &[f64]) -> String {
    format!("[{}]", values.iter().map(|value| number(*value)).collect::<Vec<_>>().join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_safe_and_different() {
        assert_eq!(parameter_names(&["a.b", "a_b", "a-b", "7"]), ["a_b_2", "a_b", "a_b_3", "joint_7"]);
        assert_eq!(parameter_names(&["", "関節", "x"]), ["joint_", "joint___", "x"]);
        assert_eq!(parameter_names(&["No", "y"]), ["joint_No", "joint_y"]);
    }

    #[test]
    fn numbers_are_numbers_of_yaml() {
        let written = [0.0, -2.5, 1e-7, 1.5e-7, -3e300].map(number);
        assert_eq!(written, ["0.0", "-2.5", "1.0e-7", "1.5e-7", "-3.0e+300"]);
    }
}
