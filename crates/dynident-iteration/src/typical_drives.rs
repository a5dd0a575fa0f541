//! What drives usually have, where nobody has said anything yet.

use dynident_dynamics::ParametricModel;
use dynident_model::terms::{JointProperty, TermAction};

/// Acceleration that a drive gives its own inertia at full effort, rad/s² (m/s²) of a usual arm.
const DRIVE_ACCELERATION: f64 = 300.0;
/// How much lighter than typical a drive may be: geared arms have up to 500 rad/s².
pub(crate) const TIMES_THE_LIGHTEST: f64 = 500.0 / DRIVE_ACCELERATION;
/// Dry friction, and viscous friction at full velocity, as shares of the effort.
pub(crate) const FRICTION: f64 = 0.05;
/// Velocity of a joint whose description has no limit, rad/s (m/s) of a usual arm.
const SPEED: f64 = 2.0;

/// The nominal parameters with typical ones of drives where the model has such terms and the description says nothing
/// of them: inertia that the joint's effort limit accelerates by 300 rad/s² (geared arms have 100 to 500: that of a
/// UR10's wrist is 0.2 kg m² at 56 Nm; of other machines it is as much in their own seconds), dry friction of 5 % of
/// it, and as much viscous friction at the velocity limit.
/// None if nothing was to be filled in.
pub(crate) fn with_typical_drives(robot: &ParametricModel) -> Option<Vec<f64>> {
    filled_in(robot, |_| true, 1.0)
}

/// The same with this share of the typical inertia at drives without a described one.
pub(crate) fn with_light_drives(robot: &ParametricModel, share: f64) -> Option<Vec<f64>> {
    with_typical_inertia(robot).and_then(|_| filled_in(robot, |_| true, share))
}

/// The same with inertia alone: what a controller may take for true until runs have shown better, for friction that is
/// not there would be pushed against.
pub(crate) fn with_typical_inertia(robot: &ParametricModel) -> Option<Vec<f64>> {
    filled_in(robot, |property| property == JointProperty::DriveInertia, 1.0)
}

fn filled_in(
    robot: &ParametricModel,
    is_wanted: impl Fn(JointProperty) -> bool,
    inertia_share: f64,
) -> Option<Vec<f64>> {
    let mut parameters = robot.nominal().to_vec();
    let bodies = robot.model().inertial_count();
    let own = robot.model().own_scale();
    let mut is_filled = false;
    for (place, term) in robot.terms().iter().enumerate() {
        let Some(joint) = term.own_joint().filter(|_| parameters[bodies + place] == 0.0) else { continue };
        let (limits, turns) = (&robot.model().joints()[joint].limits, robot.model().joints()[joint].turns());
        let Some(effort) = limits.effort else { continue };
        if term.property().is_some_and(|property| !is_wanted(property)) {
            continue;
        }
        let typical = match (term.property(), term.action()) {
            (Some(JointProperty::DriveInertia), _) => {
                inertia_share * effort / own.acceleration(turns, DRIVE_ACCELERATION)
            }
            (Some(JointProperty::Friction), _) => FRICTION * effort,
            (Some(JointProperty::Damping), _) => {
                FRICTION * effort / limits.velocity.unwrap_or(own.velocity(turns, SPEED))
            }
            // A spring has the value of the description.
            (
                Some(JointProperty::Stiffness) | None,
                TermAction::Inertia { .. }
                | TermAction::Damping { .. }
                | TermAction::Friction(_)
                | TermAction::Hysteresis
                | TermAction::Temperature
                | TermAction::Constant
                | TermAction::State(_),
            ) => continue,
        };
        parameters[bodies + place] = typical;
        is_filled = true;
    }
    is_filled.then_some(parameters)
}
