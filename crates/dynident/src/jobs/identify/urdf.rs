//! The user's own URDF with the identified values.

use crate::result::ValueSource;
use crate::study::StudyRobot;
use dynident_dynamics::ParametricModel;
use dynident_model::terms::JointProperty;
use dynident_model::{
    DescriptionFormat, INERTIAL_NAMES, InertialParameters, JointChange, LinkChange, link_changes, rewrite_urdf,
};

/// The user's URDF with the new values; joints that were locked keep theirs. Otherwise the reason why there is none.
pub(super) fn written_urdf(
    robot: &StudyRobot,
    model: &ParametricModel,
    (inertials, parameters): (&[InertialParameters], &[f64]),
    sources: &[[ValueSource; 10]],
) -> Result<String, String> {
    if robot.robot.format != DescriptionFormat::Urdf {
        return Err("the robot's description is no URDF".to_owned());
    }
    let mut links = link_changes(model.model(), inertials).map_err(|error| error.to_string())?;
    note_locked(robot, &mut links);
    note_sources(model, parameters, sources, &mut links);
    let mut joints: Vec<JointChange> = Vec::new();
    let terms = model.terms().iter().zip(&parameters[10 * model.model().dof()..]);
    for (term, &value) in terms {
        let (Some(joint), Some(property)) = (term.own_joint(), term.property()) else { continue };
        let (damping, friction) = match property {
            JointProperty::Damping => (Some(value), None),
            JointProperty::Friction => (None, Some(value)),
        };
        let name = &model.model().joints()[joint].name;
        let place = joints.iter().position(|change| change.joint == *name).unwrap_or_else(|| {
            joints.push(JointChange { joint: name.clone(), damping: None, friction: None });
            joints.len() - 1
        });
        joints[place].damping = damping.or(joints[place].damping);
        joints[place].friction = friction.or(joints[place].friction);
    }
    rewrite_urdf(&robot.robot.text, &links, &joints).map_err(|error| error.to_string())
}

/// Says in a body's comment which of its values torque told, and what of its joint's drive no URDF holds.
fn note_sources(
    model: &ParametricModel,
    parameters: &[f64],
    sources: &[[ValueSource; 10]],
    changes: &mut [LinkChange],
) {
    for (index, (body, sources)) in model.model().bodies().iter().zip(sources).enumerate() {
        let of = |which: ValueSource| -> String {
            let names = (0..10).filter(|&k| sources[k] == which).map(|k| INERTIAL_NAMES[k]);
            let names: Vec<&str> = names.collect();
            if names.is_empty() { "none".to_owned() } else { names.join(" ") }
        };
        let mut text = format!(
            "about the link's frame, measured: {}; partly, in sums with others: {}; not measured, near the description: {}",
            of(ValueSource::Measured),
            of(ValueSource::Partly),
            of(ValueSource::Nominal)
        );
        let terms = model.terms().iter().zip(&parameters[10 * model.dof()..]);
        let lost = terms.filter(|(term, _)| term.own_joint() == Some(index) && term.property().is_none());
        let lost: Vec<String> =
            lost.map(|(term, value)| format!("{} = {value:.4} {}", term.symbol(), term.unit())).collect();
        if !lost.is_empty() {
            text += &format!("; of this joint's drive URDF does not hold {}", lost.join(", "));
        }
        let set = changes.iter_mut().find_map(|change| match change {
            LinkChange::Set { link, note, .. } if link == body.name() => Some(note),
            _ => None,
        });
        if let Some(note) = set {
            *note = Some(note.take().map_or(text.clone(), |note| format!("{note}; {text}")));
        }
    }
}

/// Says in a body's comment which of its links are not fixed but stood behind locked joints: its values hold while
/// those stay where they were.
fn note_locked(robot: &StudyRobot, changes: &mut [LinkChange]) {
    for body in robot.model().bodies() {
        let own = robot.robot.model.bodies().iter().find(|original| original.name() == body.name());
        let behind: Vec<&str> = body
            .links
            .iter()
            .map(|link| &link.name[..])
            .filter(|&name| own.is_some_and(|own| own.links.iter().all(|link| link.name != name)))
            .collect();
        let set = changes.iter_mut().find_map(|change| match change {
            LinkChange::Set { link, note, .. } if link == body.name() => Some(note),
            _ => None,
        });
        if let (Some(note), false) = (set, behind.is_empty()) {
            let locked = format!("holds with the joints locked behind which stand: {}", behind.join(", "));
            *note = Some(note.take().map_or(locked.clone(), |note| format!("{note}; {locked}")));
        }
    }
}
