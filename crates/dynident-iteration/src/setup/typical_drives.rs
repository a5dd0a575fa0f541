use dynident_dynamics::ParametricModel;
use dynident_model::terms::{JointProperty, TermAction};

/// Acceleration of a drive's own inertia at its effort limit, rad/s² (m/s²) for an arm of 1.2 m.
const DRIVE_ACCELERATION: f64 = 300.0;
/// Ratio of the typical to the smallest inertia of a drive: in geared arms the effort limit accelerates the drive
/// inertia by at most 500 rad/s².
pub(crate) const TIMES_THE_LIGHTEST: f64 = 500.0 / DRIVE_ACCELERATION;
/// Dry friction, and viscous friction at full velocity, as shares of the effort limit.
pub(crate) const FRICTION: f64 = 0.05;
/// Assumed velocity limit of a joint that has none, rad/s (m/s) for an arm of 1.2 m.
const SPEED: f64 = 2.0;

/// Returns the nominal parameters with typical values for the drive terms that are zero in the robot description;
/// `None` if no value was replaced.
/// * Drive inertia: the effort limit accelerates it by 300 rad/s² (m/s²) on an arm of 1.2 m; on other robots by this
///   value in [characteristic units](dynident_model::CharacteristicScale). The accelerations of geared arms are 100 to
///   500 rad/s²; a UR10's wrist has 0.2 kg m² at 56 Nm.
/// * Dry friction: 5 % of the effort limit.
/// * Viscous friction: 5 % of the effort limit at the velocity limit.
pub fn with_typical_drives(robot: &ParametricModel) -> Option<Vec<f64>> {
    filled_in(robot, |_| true, 1.0)
}

/// Like [`with_typical_drives`], with this share of the typical inertia for drives whose inertia is not in the
/// description.
pub(crate) fn with_light_drives(robot: &ParametricModel, share: f64) -> Option<Vec<f64>> {
    with_typical_inertia(robot).and_then(|_| filled_in(robot, |_| true, share))
}

/// Like [`with_typical_drives`], with inertia only, for the model of a controller before the first estimate: with
/// typical friction, the controller could compensate friction that does not exist.
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
    let own = robot.model().characteristic_scale();
    let mut is_filled = false;
    for (place, term) in robot.terms().iter().enumerate() {
        let Some(joint) = term.own_joint().filter(|_| parameters[bodies + place] == 0.0) else { continue };
        let (limits, is_rotary) = (&robot.model().joints()[joint].limits, robot.model().joints()[joint].is_rotary());
        let Some(effort) = limits.effort else { continue };
        if term.property().is_some_and(|property| !is_wanted(property)) {
            continue;
        }
        let typical = match (term.property(), term.action()) {
            (Some(JointProperty::DriveInertia), _) => {
                inertia_share * effort / own.acceleration(is_rotary, DRIVE_ACCELERATION)
            }
            (Some(JointProperty::Friction), _) => FRICTION * effort,
            (Some(JointProperty::Damping), _) => {
                FRICTION * effort / limits.velocity.unwrap_or(own.velocity(is_rotary, SPEED))
            }
            // A spring keeps the value of the robot description.
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
