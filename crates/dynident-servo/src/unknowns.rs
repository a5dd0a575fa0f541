//! The unknowns of a fit, and the knowledge about them before the fit.

use crate::parameters::{Change, FreeParameter, ServoRobot};
use crate::quantity::{Axis, Quantity};
use crate::settings::ServoSettings;

/// Standard deviation of the logarithm of a value for which only the order of magnitude is known.
const WIDE: f64 = 2.0;

/// Standard deviation of the logarithm of a value that all joints share. Its first value is computed from the responses
/// of the joints and a guess of the drives' inertia. The prior must be wide so that this guess does not determine the
/// common factor of all torques, inertias and masses; the masses of the robot description determine the factor.
const FREE: f64 = 10.0;

/// Minimum reach of a robot, m: a prior of zero width would exclude every motion of the centre of mass.
const LEAST_REACH_M: f64 = 0.01;

/// The unknowns of a robot: values of the drives (common values and values of single joints), and of the bodies.
pub fn unknowns(robot: &ServoRobot, settings: &ServoSettings) -> Vec<FreeParameter> {
    let dof = robot.model.dof();
    let joints: Vec<usize> = (0..dof).collect();
    let mut list = Vec::new();
    let mut factor = |quantity: Quantity, common: f64, deviation: f64| {
        let mut add = |members: Vec<usize>, prior_sd: f64| {
            list.push(FreeParameter { quantity, members, change: Change::Factor, prior_sd });
        };
        if dof > 1 {
            add(joints.clone(), common);
        }
        let own = match dof {
            1 => common,
            _ if settings.alike => deviation,
            _ => WIDE,
        };
        for joint in 0..dof {
            add(vec![joint], own);
        }
    };
    factor(Quantity::Stiffness, FREE, settings.deviation);
    factor(Quantity::Damping, FREE, settings.deviation);
    // Slow motion does not determine the inertia of the drives; without a prior, its logarithm would not be bounded
    // below.
    factor(Quantity::Armature, WIDE, settings.deviation);
    factor(Quantity::Coulomb, FREE, settings.friction_deviation);
    if robot.drives.iter().all(|drive| drive.torque_limit.is_finite()) {
        factor(Quantity::TorqueLimit, WIDE, settings.torque_limit_deviation);
    }
    let has = |value: fn(&crate::drive::Drive) -> f64| robot.drives.iter().any(|drive| value(drive) > 0.0);
    // Each joint has its own deviation, because friction differs between equal servos.
    if settings.load_friction && has(|drive| drive.load_friction) {
        factor(Quantity::LoadFriction, WIDE, settings.friction_deviation);
    }
    if settings.load_friction && has(|drive| drive.stribeck) {
        factor(Quantity::Stribeck, WIDE, settings.friction_deviation);
    }
    let is_limited = |limit: fn(&crate::drive::Drive) -> f64| robot.drives.iter().all(|own| limit(own).is_finite());
    if is_limited(|drive| drive.profile_acceleration) {
        common(&mut list, &joints, Quantity::ProfileAcceleration, settings.profile);
    }
    if is_limited(|drive| drive.profile_speed) {
        common(&mut list, &joints, Quantity::ProfileSpeed, settings.profile);
    }
    sum(&mut list, joints.clone(), Quantity::Delay, settings.delay_s);
    for joint in 0..dof {
        // For a single joint, only the difference of command delay and read delay is identifiable.
        if dof > 1 {
            sum(&mut list, vec![joint], Quantity::ReadDelay, settings.read_delay_s);
        }
        if settings.zero > 0.0 {
            sum(&mut list, vec![joint], Quantity::Zero, settings.zero);
        }
    }
    body_unknowns(robot, settings, &mut list);
    list
}

fn common(list: &mut Vec<FreeParameter>, joints: &[usize], quantity: Quantity, prior_sd: f64) {
    list.push(FreeParameter { quantity, members: joints.to_vec(), change: Change::Factor, prior_sd });
}

fn sum(list: &mut Vec<FreeParameter>, members: Vec<usize>, quantity: Quantity, prior_sd: f64) {
    list.push(FreeParameter { quantity, members, change: Change::Sum, prior_sd });
}

fn body_unknowns(robot: &ServoRobot, settings: &ServoSettings, list: &mut Vec<FreeParameter>) {
    let model = &robot.model;
    // For a robot with a single joint, only the size of the bodies is available.
    let sizes = model.inertials().iter().filter_map(|body| Some(body.com_m()?.norm()));
    let joints: f64 = model.maps().iter().map(|map| map.translation.norm()).sum();
    let reach = (joints + sizes.fold(0.0, f64::max)).max(LEAST_REACH_M);
    for (body, inertial) in model.inertials().iter().enumerate() {
        if inertial.com_m().is_none() {
            continue;
        }
        list.push(FreeParameter {
            quantity: Quantity::Mass,
            members: vec![body],
            change: Change::Factor,
            prior_sd: settings.mass,
        });
        for axis in [Axis::X, Axis::Y, Axis::Z] {
            sum(list, vec![body], Quantity::Centre(axis), settings.centre * reach);
        }
    }
}
