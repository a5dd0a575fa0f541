//! SDF for Gazebo and Drake.

use crate::descriptions::{comment, consistent_inertial, frictions, omitted_terms, spring};
use crate::error::ExportError;
use crate::exported::Exported;
use crate::nearest_friction::NearestFriction;
use crate::robot_model::RobotModel;
use crate::rotation::z_y_x_angles;
use core::fmt::Write;
use dynident_model::{Body, Joint, JointKind, STANDARD_GRAVITY, Transform};
use dynident_text::xml::escaped;

/// A model in SDF 1.7, the first version with poses relative to other frames: links with inertials, joints with limits,
/// damping and friction, fixed links as frames, and the base fixed to the world. Without shapes.
pub(crate) fn sdf(robot: &RobotModel, mut notes: Vec<String>) -> Result<Exported, ExportError> {
    let model = robot.model();
    let friction = frictions(robot, "friction", "damping", &mut notes);
    notes.extend(omitted_terms(robot, true));
    for (term, value) in robot.terms().filter(|(term, _)| term.is_drive_inertia()) {
        notes.push(format!("SDF has no drive inertia: {} = {value:?} kg m² is left out.", term.symbol()));
    }
    if model.gravity() != STANDARD_GRAVITY {
        notes.push(format!(
            "SDF states gravity in the world, not in the model: set the gravity of the world to {:?} m/s² (in the base frame).",
            model.gravity().0
        ));
    }
    for (_, joint) in model.followers() {
        notes.push(format!("SDF before 1.11 has no mimic joints: joint {} is independent in this file.", joint.name));
    }
    let mut names = Names::default();
    let base = names.of(model.base().name());
    let links: Vec<String> = model.bodies().iter().map(|body| names.of(body.name())).collect();
    let joints: Vec<String> = model.tree_joints().iter().map(|joint| names.of(&joint.name)).collect();
    let mut text = String::new();
    let _ = write!(
        text,
        "  <model name=\"{}\">\n    <link name=\"{base}\"/>\n    <joint name=\"{}\" type=\"fixed\">\n      <parent>world</parent>\n      <child>{base}</child>\n    </joint>\n",
        name(model.name()),
        names.of("fixed_to_world")
    );
    write_frames(&mut text, model.base(), &base, &mut names);
    for (index, (joint, body)) in model.tree_joints().iter().zip(model.bodies()).enumerate() {
        let (mass, com, inertia) = consistent_inertial(model, index, "libsdformat")?;
        let (link, parent) = (&links[index], joint.parent.map_or(&base, |parent| &links[parent]));
        let [x, y, z] = com.0;
        let i = inertia.0;
        let _ = write!(
            text,
            "    <link name=\"{link}\">\n      <pose relative_to=\"{}\">0 0 0 0 0 0</pose>\n      <inertial>\n        <pose>{x:?} {y:?} {z:?} 0 0 0</pose>\n        <mass>{mass:?}</mass>\n        \
             <inertia>\n          <ixx>{:?}</ixx>\n          <ixy>{:?}</ixy>\n          <ixz>{:?}</ixz>\n          <iyy>{:?}</iyy>\n          <iyz>{:?}</iyz>\n          <izz>{:?}</izz>\n        </inertia>\n      </inertial>\n    </link>\n",
            joints[index], i[0][0], i[0][1], i[0][2], i[1][1], i[1][2], i[2][2]
        );
        let friction = model.joint_of(index).map_or(NearestFriction::NONE, |joint| friction[joint]);
        write_joint(&mut text, joint, &friction, spring(robot, index), [&joints[index], parent, link]);
        write_frames(&mut text, body, link, &mut names);
    }
    notes.extend(names.notes());
    let text = format!("<?xml version=\"1.0\"?>\n<sdf version=\"1.7\">\n{}{text}  </model>\n</sdf>\n", comment(&notes));
    Ok(Exported { text, notes })
}

fn write_joint(
    text: &mut String,
    joint: &Joint,
    friction: &NearestFriction,
    spring: Option<(f64, f64)>,
    names: [&String; 3],
) {
    let [name, parent, child] = names;
    let limits = &joint.limits;
    let stops = limits.lower.zip(limits.upper).filter(|(lower, upper)| lower < upper);
    let stops = stops.filter(|_| joint.kind != JointKind::Continuous);
    let kind = match (joint.kind, stops) {
        _ if !joint.is_rotary() => "prismatic",
        (JointKind::Continuous, None) => "continuous",
        // SDF treats a missing limit as unlimited.
        _ => "revolute",
    };
    let mut limit = String::new();
    let mut write_limit = |element: &str, value: f64| {
        let _ = writeln!(limit, "          <{element}>{value:?}</{element}>");
    };
    if let Some((lower, upper)) = stops {
        write_limit("lower", lower);
        write_limit("upper", upper);
    }
    // In robot descriptions zero means an unknown limit; in SDF a negative number, the default, does.
    for (element, value) in [("effort", limits.effort), ("velocity", limits.velocity)] {
        if let Some(value) = value.filter(|value| *value > 0.0) {
            write_limit(element, value);
        }
    }
    let springs = spring.map_or_else(String::new, |(stiffness, reference)| {
        format!(
            "          <spring_reference>{reference:?}</spring_reference>\n          <spring_stiffness>{stiffness:?}</spring_stiffness>\n"
        )
    });
    let [x, y, z] = joint.axis.0;
    let _ = write!(
        text,
        "    <joint name=\"{name}\" type=\"{kind}\">\n      {}\n      <parent>{parent}</parent>\n      <child>{child}</child>\n      <axis>\n        <xyz>{x:?} {y:?} {z:?}</xyz>\n        \
         <limit>\n{limit}        </limit>\n        <dynamics>\n          <damping>{:?}</damping>\n          <friction>{:?}</friction>\n{springs}        </dynamics>\n      </axis>\n    </joint>\n",
        pose(&joint.placement, parent),
        friction.viscous,
        friction.coulomb
    );
}

/// Writes the links that are fixed to a body's own link, which is called `link`.
fn write_frames(text: &mut String, body: &Body, link: &str, names: &mut Names) {
    for fixed in &body.links[1..] {
        let name = names.of(&fixed.name);
        let _ = writeln!(
            text,
            "    <frame name=\"{name}\" attached_to=\"{link}\">\n      {}\n    </frame>",
            pose(&fixed.placement, link)
        );
    }
}

fn pose(placement: &Transform, relative_to: &str) -> String {
    let ([x, y, z], [yaw, pitch, roll]) = (placement.translation.0, z_y_x_angles(&placement.rotation));
    format!("<pose relative_to=\"{relative_to}\">{x:?} {y:?} {z:?} {roll:?} {pitch:?} {yaw:?}</pose>")
}

/// Names in a model; links, joints and frames share one namespace.
#[derive(Default)]
struct Names {
    taken: Vec<(String, String)>,
}

impl Names {
    /// The name as XML text, with underscores appended until it is unique.
    fn of(&mut self, original: &str) -> String {
        let mut free = name(original);
        while self.taken.iter().any(|(_, taken)| *taken == free) {
            free.push('_');
        }
        self.taken.push((original.to_owned(), free.clone()));
        free
    }

    fn notes(&self) -> impl Iterator<Item = String> {
        let others = self.taken.iter().filter(|(original, name)| escaped(original) != *name);
        others.map(|(original, name)| {
            format!("The name {original} is duplicate or invalid in SDF: the part is called {name} here.")
        })
    }
}

/// A valid SDF name: not `world`, no leading `__`, no `::`.
fn name(original: &str) -> String {
    let text = escaped(original).replace("::", "_");
    if text.is_empty() || text == "world" || text.starts_with("__") { format!("robot_{text}") } else { text }
}
