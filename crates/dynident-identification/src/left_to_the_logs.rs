//! Drive inertia that a study does not state, so that the logs decide about it.

use crate::settings::IdentificationSettings;
use dynident_dynamics::{ParametricModel, ParametricModelError};
use dynident_model::terms::{DriveInertia, TorqueTerm, sort_terms};

/// The robot with the drive inertia of all joints in `settings.drive_inertia`, before any test.
pub(crate) fn with_drives_left_to_the_logs(
    robot: &ParametricModel,
    settings: &IdentificationSettings,
) -> Result<ParametricModel, ParametricModelError> {
    with_drives(robot, &joints_left_to_the_logs(robot, settings))
}

/// Joints in `settings.drive_inertia` that have no drive inertia among the robot's terms yet.
pub(crate) fn joints_left_to_the_logs(robot: &ParametricModel, settings: &IdentificationSettings) -> Vec<usize> {
    let known = |joint: &usize| robot.terms().contains(&TorqueTerm::DriveInertia(DriveInertia { joint: *joint }));
    let named = settings.drive_inertia.iter().filter_map(|name| robot.model().joint_index(name));
    named.filter(|joint| !known(joint)).collect()
}

pub(crate) fn with_drives(robot: &ParametricModel, joints: &[usize]) -> Result<ParametricModel, ParametricModelError> {
    let drives = joints.iter().map(|&joint| TorqueTerm::DriveInertia(DriveInertia { joint }));
    let mut terms: Vec<TorqueTerm> = robot.terms().iter().cloned().chain(drives).collect();
    sort_terms(&mut terms);
    robot.with_terms(terms)
}
