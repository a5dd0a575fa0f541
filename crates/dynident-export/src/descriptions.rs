//! Robot descriptions for simulators (MJCF and URDF), with notes on unsupported contents.

use crate::drive_torque::drive_inertia;
use crate::error::ExportError;
use crate::exported::Exported;
use crate::model_file::ModelTerm;
use crate::nearest_friction::{ComparedOver, NearestFriction};
use crate::robot_model::RobotModel;
use crate::rotation::quaternion;
use core::fmt::Write;
use dynident_model::terms::{JointProperty, TorqueTerm};
use dynident_model::{Joint, Mat3, Model, STANDARD_GRAVITY, Transform, Vec3, write_urdf};
use dynident_text::xml::{self, escaped};
use std::borrow::Cow;

/// Friction errors below this share of the friction are not reported: rounding errors, or about 0.1 % if a narrow
/// smoothed sign function replaces a sign function.
const MIN_REPORTED_ERROR_RATIO: f64 = 1e-3;

/// MuJoCo's MJCF: bodies with inertials, joints with limits, `armature`, `damping` and `frictionloss`, one motor per
/// joint. Without shapes.
pub(crate) fn mjcf(robot: &RobotModel, mut notes: Vec<String>) -> Result<Exported, ExportError> {
    let (model, bodies) = (robot.model(), robot.model().body_count());
    let friction = frictions(robot, "frictionloss", "damping", &mut notes);
    notes.extend(omitted_terms(robot, true));
    notes.push("MJCF has no velocity limits; shapes are left out.".to_owned());
    let rotors = drive_inertia(robot);
    let [gx, gy, gz] = model.gravity().0;
    let mut text = format!(
        "<mujoco model=\"{}\">\n{}  <compiler angle=\"radian\" autolimits=\"true\"/>\n  <option gravity=\"{gx:?} {gy:?} {gz:?}\"/>\n  \
         <worldbody>\n",
        escaped(model.name()),
        comment(&notes)
    );
    for joint in (0..bodies).filter(|&joint| model.tree_joints()[joint].parent.is_none()) {
        write_body(&mut text, robot, joint, &friction, &rotors, 2)?;
    }
    text += "  </worldbody>\n  <actuator>\n";
    for joint in model.joints() {
        let range = joint.limits.effort.filter(|effort| *effort > 0.0);
        let range = range.map_or(String::new(), |effort| format!(" ctrlrange=\"{:?} {effort:?}\"", -effort));
        let name = escaped(&joint.name);
        let _ = writeln!(text, "    <motor name=\"{name}\" joint=\"{name}\"{range}/>");
    }
    text += "  </actuator>\n";
    write_followers(&mut text, model);
    text += "</mujoco>\n";
    Ok(Exported { text, notes })
}

/// URDF: links with inertials, joints with limits, damping and friction. Without shapes.
pub(crate) fn urdf(robot: &RobotModel, mut notes: Vec<String>) -> Result<Exported, ExportError> {
    let model = robot.model();
    let friction = frictions(robot, "friction", "damping", &mut notes);
    notes.extend(omitted_terms(robot, false));
    for (term, value) in robot.terms().filter(|(term, _)| term.is_drive_inertia()) {
        notes.push(format!("URDF has no drive inertia: {} = {value:?} kg m² is left out.", term.symbol()));
    }
    if model.gravity() != STANDARD_GRAVITY {
        notes.push(format!("URDF has no gravity: it is {:?} m/s² in the base frame.", model.gravity().0));
    }
    let joints = model.tree_joints().iter().enumerate().map(|(index, joint)| {
        let friction = model.joint_of(index).map(|own| friction[own]);
        Joint {
            damping: friction.map(|friction| friction.viscous),
            friction: friction.map(|friction| friction.coulomb),
            ..joint.clone()
        }
    });
    let written = Model::new(model.name(), model.base().clone(), joints.collect(), model.bodies().to_vec())?;
    let text = write_urdf(&written.with_gravity(model.gravity())?);
    let (head, rest) = text.split_once('\n').unwrap_or(("", &text));
    Ok(Exported { text: format!("{head}\n{}{rest}", comment(&notes)), notes })
}

/// The friction of every joint that is nearest to the identified friction, with a note for each approximation.
pub(crate) fn frictions(
    robot: &RobotModel,
    coulomb: &str,
    viscous: &str,
    notes: &mut Vec<String>,
) -> Vec<NearestFriction> {
    let joints = robot.model().joints();
    let nearest: Vec<_> = (0..joints.len()).map(|joint| NearestFriction::of(robot, joint)).collect();
    for (joint, found) in joints.iter().zip(&nearest) {
        if found.most_error > MIN_REPORTED_ERROR_RATIO * (found.coulomb + found.viscous * found.most_speed) {
            let over = match found.over {
                ComparedOver::RecordedMotion => "over the recorded motion, velocities",
                ComparedOver::VelocityLimit => "for velocities",
            };
            notes.push(format!(
                "Joint {}: {coulomb} and {viscous} approximate its friction and offset {over} up to {:?} {}: off by {:.3} {unit} rms, {:.3} {unit} at most.",
                joint.name,
                found.most_speed,
                if joint.is_rotary() { "rad/s" } else { "m/s" },
                found.rms_error,
                found.most_error,
                unit = if joint.is_rotary() { "Nm" } else { "N" },
            ));
        }
    }
    nearest
}

/// Terms of the identified robot that a format with the terms `kept` does not contain. A term that differs only in
/// its sign function is treated as kept.
pub fn terms_left_out(robot: &RobotModel, kept: &[TorqueTerm]) -> Vec<ModelTerm> {
    ModelTerm::of(robot, |term| kept.iter().all(|one| one.symbol() != term.symbol()))
}

/// Notes on the terms of the identified robot that a format with the terms `kept` omits or replaces, with their
/// values. A term that differs only in its sign function is treated as kept.
pub fn notes_on_omitted(robot: &RobotModel, kept: &[TorqueTerm]) -> Vec<String> {
    let omitted = robot.terms().filter(|(term, _)| kept.iter().all(|one| one.symbol() != term.symbol()));
    omitted
        .map(|(term, value)| {
            let (symbol, unit, joint) = (term.symbol(), term.unit(), joint_name(robot, term));
            if term.own_joint().is_none() {
                let effect = if term.is_friction() { "friction" } else { "inertia" };
                format!(
                    "{effect} of a drive that is coupled to two joints, {symbol} = {value:?} {unit}, is left out."
                )
            } else if let Some(law) = term.state_function() {
                let law = law.description();
                format!("Torque {symbol} of joint {joint}, {value:?} {unit} times {law}, is left out: add it to the controller.")
            } else if term.is_drive_inertia() {
                format!("Drive inertia {symbol} = {value:?} {unit} of joint {joint} is left out.")
            } else if term.constant_torque(term.own_joint().unwrap_or(0)) != 0.0 {
                format!("Offset {symbol} = {value:?} {unit} of joint {joint} is left out.")
            } else {
                let kind = term.kind_name();
                format!("{symbol} = {value:?} {unit} ({kind}) of joint {joint} is replaced by the fitted friction.")
            }
        })
        .collect()
}

/// Notes on terms that a robot description cannot represent. Springs are included only if the format has no springs.
pub(crate) fn omitted_terms(robot: &RobotModel, holds_springs: bool) -> Vec<String> {
    let mut notes = Vec::new();
    for (term, value) in robot.terms() {
        let (symbol, unit) = (term.symbol(), term.unit());
        if term.own_joint().is_none() {
            let effect = if term.is_friction() { "friction" } else { "inertia" };
            notes.push(format!(
                "{effect} of a drive that is coupled to two joints, {symbol} = {value:?} {unit}, is left out."
            ));
        } else if let Some(law) = term.state_function() {
            if !(holds_springs && is_spring(term)) {
                let law = law.description();
                notes.push(format!("Torque {symbol} of joint {}, {value:?} {unit} times {law}, is left out: add it to the simulator's control.", joint_name(robot, term)));
            }
        } else if term.needs_load() {
            notes.push(format!("{symbol} = {value:?} {unit} ({}) is left out.", term.kind_name()));
        } else if let Some(distance) = term.kind().sliding_distance() {
            notes.push(format!(
                "{symbol} = {value:?} {unit} ({}) is replaced by the Coulomb friction that it reaches after a motion of {distance:?} rad (m).",
                term.kind_name(),
            ));
        }
    }
    notes
}

fn joint_name<'a>(robot: &'a RobotModel, term: &TorqueTerm) -> &'a str {
    term.own_joint().map_or("", |joint| &robot.model().joints()[joint].name)
}

fn is_spring(term: &TorqueTerm) -> bool {
    term.property() == Some(JointProperty::Stiffness)
}

/// Stiffness and reference of the spring at a joint of the tree.
pub(crate) fn spring(robot: &RobotModel, tree_joint: usize) -> Option<(f64, f64)> {
    let model = robot.model();
    let (joint, described) = (model.joint_of(tree_joint)?, model.tree_joints()[tree_joint].spring?);
    let is_it = |term: &TorqueTerm| is_spring(term) && term.own_joint() == Some(joint);
    robot.terms().find(|(term, _)| is_it(term)).map(|(_, stiffness)| (stiffness, described.reference))
}

fn write_body(
    text: &mut String,
    robot: &RobotModel,
    index: usize,
    friction: &[NearestFriction],
    rotors: &[f64],
    depth: usize,
) -> Result<(), ExportError> {
    let model = robot.model();
    let (joint, body) = (&model.tree_joints()[index], &model.bodies()[index]);
    let pad = "  ".repeat(depth);
    let _ = writeln!(text, "{pad}<body name=\"{}\"{}>", body_name(body.name()), placement(&joint.placement));
    let _ = writeln!(text, "{pad}  {}", inertial(model, index)?);
    let kind = if joint.is_rotary() { "hinge" } else { "slide" };
    let spring = spring(robot, index).map_or_else(String::new, |(stiffness, reference)| {
        format!(" stiffness=\"{stiffness:?}\" springref=\"{reference:?}\"")
    });
    let limits = joint.limits.lower.zip(joint.limits.upper).filter(|(lower, upper)| lower < upper);
    let range = limits.map_or(String::new(), |(lower, upper)| format!(" range=\"{lower:?} {upper:?}\""));
    let [x, y, z] = joint.axis.0;
    let own = model.joint_of(index);
    let found = own.map_or(NearestFriction::NONE, |own| friction[own]);
    let _ = writeln!(
        text,
        "{pad}  <joint name=\"{}\" type=\"{kind}\" axis=\"{x:?} {y:?} {z:?}\"{range}{spring} armature=\"{:?}\" damping=\"{:?}\" frictionloss=\"{:?}\"/>",
        escaped(&joint.name),
        own.map_or(0.0, |own| rotors[own * model.dof() + own]),
        found.viscous,
        found.coulomb
    );
    for link in &body.links[1..] {
        let _ = writeln!(text, "{pad}  <body name=\"{}\"{}/>", body_name(&link.name), placement(&link.placement));
    }
    for child in (index + 1..model.body_count()).filter(|&child| model.tree_joints()[child].parent == Some(index)) {
        write_body(text, robot, child, friction, rotors, depth + 1)?;
    }
    let _ = writeln!(text, "{pad}</body>");
    Ok(())
}

/// Writes mimic joints: as an equality of two joints, or of a tendon whose length is constant under the mimic law.
fn write_followers(text: &mut String, model: &Model) {
    let Some(coupling) = model.coupling() else { return };
    let (mut tendons, mut equalities) = (String::new(), String::new());
    for (index, joint) in model.followers() {
        let (name, offset) = (escaped(&joint.name), coupling.offset(index));
        let source = |dof: usize| escaped(&model.joints()[dof].name);
        match *coupling.row(index) {
            [(dof, multiplier)] => {
                let law = format!("polycoef=\"{offset:?} {multiplier:?} 0 0 0\"");
                let _ = writeln!(equalities, "    <joint joint1=\"{name}\" joint2=\"{}\" {law}/>", source(dof));
            }
            ref sources => {
                let _ = write!(tendons, "    <fixed name=\"{name}\">\n      <joint joint=\"{name}\" coef=\"1\"/>\n");
                for &(dof, multiplier) in sources {
                    let (followed, coefficient) = (source(dof), -multiplier);
                    let _ = writeln!(tendons, "      <joint joint=\"{followed}\" coef=\"{coefficient:?}\"/>");
                }
                tendons += "    </fixed>\n";
                let _ = writeln!(equalities, "    <tendon tendon1=\"{name}\" polycoef=\"{offset:?} 0 0 0 0\"/>");
            }
        }
    }
    if !tendons.is_empty() {
        let _ = write!(text, "  <tendon>\n{tendons}  </tendon>\n");
    }
    let _ = write!(text, "  <equality>\n{equalities}  </equality>\n");
}

/// Name of a link; changed if it is the reserved name of the fixed body in MuJoCo.
fn body_name(link: &str) -> Cow<'_, str> {
    if link == "world" { Cow::Borrowed("world_link") } else { escaped(link) }
}

/// Mass, centre of mass and inertia about the centre of mass of a body; simulators accept only physically consistent
/// bodies.
pub(crate) fn consistent_inertial(
    model: &Model,
    index: usize,
    reader: &'static str,
) -> Result<(f64, Vec3, Mat3), ExportError> {
    let parameters = &model.inertials()[index];
    let moments =
        parameters.principal_moments().filter(|[a, b, c]| parameters.mass_kg() > 0.0 && *a > 0.0 && a + b >= *c);
    let (Some(_), Some(com), Some(inertia)) = (moments, parameters.com_m(), parameters.inertia_at_com()) else {
        return Err(ExportError::NotPhysical { body: model.bodies()[index].name().to_owned(), reader });
    };
    Ok((parameters.mass_kg(), com, inertia))
}

fn inertial(model: &Model, index: usize) -> Result<String, ExportError> {
    let (mass, com, inertia) = consistent_inertial(model, index, "MuJoCo")?;
    let ([x, y, z], i) = (com.0, inertia.0);
    Ok(format!(
        "<inertial mass=\"{mass:?}\" pos=\"{x:?} {y:?} {z:?}\" fullinertia=\"{:?} {:?} {:?} {:?} {:?} {:?}\"/>",
        i[0][0], i[1][1], i[2][2], i[0][1], i[0][2], i[1][2]
    ))
}

fn placement(placement: &Transform) -> String {
    let ([x, y, z], [a, b, c, d]) = (placement.translation.0, quaternion(&placement.rotation));
    format!(" pos=\"{x:?} {y:?} {z:?}\" quat=\"{a:?} {b:?} {c:?} {d:?}\"")
}

pub(crate) fn comment(notes: &[String]) -> String {
    if notes.is_empty() {
        return String::new();
    }
    let lines: Vec<String> = notes.iter().map(|note| format!("    {}", xml::comment(note))).collect();
    format!("  <!--\n{}\n  -->\n", lines.join("\n"))
}
