//! Actuators of Isaac Lab for drives with a position controller.

use crate::exported::Exported;
use crate::languages::python_string;
use core::fmt::Write;

/// A drive as Isaac Lab describes it, in SI units at the joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Actuator {
    /// Name of the joint.
    pub joint: String,
    /// Torque per position error, Nm/rad (N/m).
    pub stiffness: f64,
    /// Torque per velocity error, Nm s/rad (N s/m).
    pub damping: f64,
    /// Inertia of the drive at the joint, kg m² (kg).
    pub armature: f64,
    /// Static and dynamic friction, Nm (N).
    pub friction: f64,
    /// Largest torque, Nm (N); `None` without limit.
    pub effort_limit: Option<f64>,
    /// Largest speed, rad/s (m/s); `None` keeps the value of the robot's file.
    pub velocity_limit: Option<f64>,
    /// Time from a command to its effect, s.
    pub delay_s: f64,
}

/// Effort limit that is written for a drive without a limit: PhysX's default for explicit actuators. With `None`,
/// Isaac Lab would use the limit of the robot's file.
const NO_LIMIT: f64 = 1e9;

const MEANING: [&str; 5] = [
    "SI units: rad, Nm (m, N at joints that slide). Use it as ArticulationCfg(actuators=implicit(), ..) or",
    "actuators=delayed(). Fields of Isaac Lab 2.2 and later, with Isaac Sim 5.0 or later: friction and dynamic_friction",
    "are efforts there. Isaac Sim 4.5 reads friction as a coefficient of the force through the joint: do not use it.",
    "The effort limit applies to the sum of stiffness and damping. Names are those of the robot description; if the USD",
    "has others, correct them in DRIVES.",
];

const FUNCTIONS: &str = r#"
def implicit():
    """Actuators whose spring and damper the physics engine solves, without delay."""
    return {
        f"drives_{number}": ImplicitActuatorCfg(effort_limit_sim=_values(joints, "effort_limit"), **_common(joints))
        for number, joints in enumerate(_groups(lambda drive: drive["velocity_limit"] is None))
    }


def delayed(physics_step_s=PHYSICS_STEP_S):
    """Actuators that compute the torque once in each physics step, with the delay rounded to whole steps."""
    def steps(drive):
        return round(drive["delay_s"] / physics_step_s)

    return {
        f"drives_{number}": DelayedPDActuatorCfg(
            min_delay=steps(DRIVES[joints[0]]),
            max_delay=steps(DRIVES[joints[0]]),
            effort_limit=_values(joints, "effort_limit"),
            **_common(joints),
        )
        for number, joints in enumerate(_groups(lambda drive: (steps(drive), drive["velocity_limit"] is None)))
    }


def _groups(key):
    """Lists of joints with equal `key`: a group has one delay, and velocity limits of all joints or none."""
    groups = {}
    for joint, drive in DRIVES.items():
        groups.setdefault(key(drive), []).append(joint)
    return list(groups.values())


def _values(joints, name):
    values = {re.escape(joint): DRIVES[joint][name] for joint in joints}
    return None if None in values.values() else values


def _common(joints):
    return {
        "joint_names_expr": [re.escape(joint) for joint in joints],
        "stiffness": _values(joints, "stiffness"),
        "damping": _values(joints, "damping"),
        "armature": _values(joints, "armature"),
        "friction": _values(joints, "friction"),
        "dynamic_friction": _values(joints, "friction"),
        "velocity_limit_sim": _values(joints, "velocity_limit"),
    }
"#;

/// A Python module with the functions `implicit` and `delayed`, which return the actuators of an articulation.
/// `physics_step_s` is the physics step to which delays are rounded by default, and `notes` become comments.
///
/// # Source
/// Isaac Lab, `isaaclab.actuators`: `ActuatorBaseCfg`, `ImplicitActuatorCfg`, `DelayedPDActuatorCfg`; PhysX,
/// `PxJointFrictionParams`.
pub fn isaac_lab(robot: &str, actuators: &[Actuator], physics_step_s: f64, notes: Vec<String>) -> Exported {
    let mut text = String::new();
    let title = format!(
        "Actuators of {robot} ({} joints) for Isaac Lab, written by dynident {}.",
        actuators.len(),
        env!("CARGO_PKG_VERSION")
    );
    for line in core::iter::once(&title[..]).chain(MEANING).chain(notes.iter().map(String::as_str)) {
        let _ = writeln!(text, "# {}", dynident_text::comment(line));
    }
    text.push_str("import re\n\nfrom isaaclab.actuators import DelayedPDActuatorCfg, ImplicitActuatorCfg\n\n");
    let _ = write!(text, "# Physics step of the simulation, s.\nPHYSICS_STEP_S = {physics_step_s:?}\n\nDRIVES = {{\n");
    for actuator in actuators {
        let number = |value: Option<f64>| value.map_or_else(|| "None".to_owned(), |value| format!("{value:?}"));
        let _ = writeln!(
            text,
            "    {}: {{\"stiffness\": {:?}, \"damping\": {:?}, \"armature\": {:?}, \"friction\": {:?}, \
             \"effort_limit\": {:?}, \"velocity_limit\": {}, \"delay_s\": {:?}}},",
            python_string(&actuator.joint),
            actuator.stiffness,
            actuator.damping,
            actuator.armature,
            actuator.friction,
            actuator.effort_limit.unwrap_or(NO_LIMIT),
            number(actuator.velocity_limit),
            actuator.delay_s,
        );
    }
    text.push_str("}\n\n");
    text.push_str(FUNCTIONS);
    Exported { text, notes }
}
