//! The user's own URDF with the identified values.

use crate::study::StudyRobot;
use dynident_dynamics::ParametricModel;
use dynident_model::terms::JointProperty;
use dynident_model::{DescriptionFormat, InertialParameters, JointChange, LinkChange, link_changes, rewrite_urdf};

/// The user's URDF with the new values; joints that were locked keep theirs. Otherwise the reason why there is none.
pub(super) fn written_urdf(
    robot: &StudyRobot,
    model: &ParametricModel,
    inertials: &[InertialParameters],
    parameters: &[f64],
) -> Result<String, String> {
    if robot.robot.format != DescriptionFormat::Urdf {
        return Err("the robot's description is no URDF".to_owned());
    }
    let mut links = link_changes(model.model(), inertials).map_err(|error| error.to_string())?;
    note_locked(robot, &mut links);
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
