//! Python with Pinocchio: a program that builds the model of the bodies; the torque of the drives comes from the
//! graph.

use super::Source;
use super::python::{ArraySyntax, python_string, write_function, write_helpers};
use crate::drive_torque::drive_inertia;
use crate::nearest_friction::NearestFriction;
use core::fmt::Write;
use dynident_model::Model;

/// A module with `build`, `torque` and the functions of the drives.
pub(crate) fn pinocchio_module(source: &Source<'_>) -> String {
    let (dof, model) = (source.dof(), source.robot.model());
    let mut text = source.comment("#");
    let _ = write!(
        text,
        "\n# Pinocchio 3 or later. All turning joints are revolute, so that q is the vector of joint positions.\n\
         import numpy as np\nimport pinocchio as pin\n\nDOF = {dof}\n\
         # Name, parent (-1 is the base), whether the joint turns, rotation and position of its frame in that of the parent, axis,\n\
         # mass, centre of mass, inertia about it, lowest and highest position, velocity, torque, drive inertia, damping, friction.\n\
         JOINTS = [\n"
    );
    for joint in 0..model.tree_joints().len() {
        let _ = writeln!(text, "    {},", joint_entry(source, joint));
    }
    let [x, y, z] = model.gravity().0;
    let _ = write!(
        text,
        "]\nGRAVITY = [{x:?}, {y:?}, {z:?}]\n{}# Inertia of drives that move two joints.\nSHARED_INERTIA = np.array({})\n\n\n{BUILD}",
        expansion(model),
        shared_inertia(source)
    );
    write_helpers(&mut text, source, "np");
    let mut sum = String::new();
    for function in &source.equations.functions {
        if ["friction", "declared", "load_friction"].contains(&function.name) {
            write_function(&mut text, source, function, &ArraySyntax { library: "np" });
            let _ = write!(sum, " + {}({})", function.name, function.arguments());
        }
    }
    let _ = write!(
        text,
        "\n\nMODEL = build()\nDATA = MODEL.createData()\n\n\n\
         def torque(q, dq, ddq):\n    \
         \"\"\"Torque of a motion: bodies and drive inertia by Pinocchio, all other torques of the drives by the functions above.\"\"\"\n    \
         q, dq, ddq = (_joints(vector) for vector in (q, dq, ddq))\n    \
         tree = pin.rnea(MODEL, DATA, EXPANSION @ q + OFFSET, EXPANSION @ dq, EXPANSION @ ddq)\n    \
         return EXPANSION.T @ tree + SHARED_INERTIA @ ddq{sum}\n"
    );
    text
}

const BUILD: &str = "def build():
    \"\"\"Model with drive inertia (armature), and with the damping and dry friction that are nearest to the friction of each joint.\"\"\"
    model = pin.Model()
    known = []
    for name, parent, turns, rotation, position, axis, mass, com, inertia, lower, upper, speed, effort, *_ in JOINTS:
        kind = pin.JointModelRevoluteUnaligned if turns else pin.JointModelPrismaticUnaligned
        placement = pin.SE3(np.array(rotation), np.array(position))
        limits = [np.array([limit]) for limit in (effort, speed, lower, upper)]
        joint = model.addJoint(known[parent] if parent >= 0 else 0, kind(np.array(axis)), placement, name, *limits)
        model.appendBodyToJoint(joint, pin.Inertia(mass, np.array(com), np.array(inertia)), pin.SE3.Identity())
        known.append(joint)
    model.gravity.linear = np.array(GRAVITY)
    armature, damping, friction = (np.array(values) for values in zip(*(joint[-3:] for joint in JOINTS)))
    model.armature = armature
    model.damping = damping
    if hasattr(model, \"upperDryFrictionLimit\"):
        model.lowerDryFrictionLimit, model.upperDryFrictionLimit = -friction, friction
    else:
        model.friction = friction
    return model
";

/// Text of a limit; infinite if unknown.
fn limit(value: Option<f64>, sign: &str) -> String {
    value.filter(|value| value.is_finite()).map_or_else(|| format!("{sign}np.inf"), |value| format!("{value:?}"))
}

fn joint_entry(source: &Source<'_>, index: usize) -> String {
    let (robot, model) = (source.robot, source.robot.model());
    let (joint, inertial) = (&model.tree_joints()[index], &model.inertials()[index]);
    let own = model.joint_of(index);
    let friction = own.map_or(NearestFriction::NONE, |own| NearestFriction::of(robot, own));
    let armature = own.map_or(0.0, |own| drive_inertia(robot)[own * model.dof() + own]);
    let com = inertial.com_m().map_or([0.0; 3], |com| com.0);
    let inertia = inertial.inertia_at_com().map_or([[0.0; 3]; 3], |inertia| inertia.0);
    format!(
        "({}, {}, {}, {:?}, {:?}, {:?}, {:?}, {com:?}, {inertia:?}, {}, {}, {}, {}, {armature:?}, {:?}, {:?})",
        python_string(&joint.name),
        joint.parent.map_or(-1, |parent| parent as i64),
        if joint.is_rotary() { "True" } else { "False" },
        joint.placement.rotation.0,
        joint.placement.translation.0,
        joint.axis.0,
        inertial.mass_kg(),
        limit(joint.limits.lower, "-"),
        limit(joint.limits.upper, ""),
        limit(joint.limits.velocity, ""),
        limit(joint.limits.effort, ""),
        friction.viscous,
        friction.coulomb,
    )
}

/// Positions of the joints of the tree from those of the independent joints, `EXPANSION q + OFFSET`.
fn expansion(model: &Model) -> String {
    let (count, dof) = (model.tree_joints().len(), model.dof());
    let Some(coupling) = model.coupling() else {
        return "EXPANSION, OFFSET = np.eye(DOF), np.zeros(DOF)\n".to_owned();
    };
    let mut matrix = vec![vec![0.0; dof]; count];
    for (joint, row) in matrix.iter_mut().enumerate() {
        for &(source, multiplier) in coupling.row(joint) {
            row[source] = multiplier;
        }
    }
    let offsets: Vec<f64> = (0..count).map(|joint| coupling.offset(joint)).collect();
    format!("# Dependent joints follow the others.\nEXPANSION, OFFSET = np.array({matrix:?}), np.array({offsets:?})\n")
}

/// Entries of drive inertia outside the diagonal of the mass matrix.
fn shared_inertia(source: &Source<'_>) -> String {
    let (dof, all) = (source.dof(), drive_inertia(source.robot));
    let entry = |row: usize, column: usize| if row == column { 0.0 } else { all[row * dof + column] };
    let rows: Vec<Vec<f64>> = (0..dof).map(|row| (0..dof).map(|column| entry(row, column)).collect()).collect();
    format!("{rows:?}")
}
