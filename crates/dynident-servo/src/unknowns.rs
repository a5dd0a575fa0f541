//! The unknowns of a fit and what is known of them before.

use crate::parameters::{Change, FreeParameter, ServoRobot};
use crate::quantity::{Axis, Quantity};
use crate::settings::ServoSettings;

/// Standard deviation of the logarithm of a value of which nothing but the order of magnitude is known.
const WIDE: f64 = 2.0;

/// Standard deviation of the logarithm of a value that all joints share. Its centre comes from the responses of the
/// joints, which contain the drives' inertia only by a guess, and it must not decide the common factor of all torques,
/// inertias and masses: the masses of the robot description do.
const FREE: f64 = 10.0;

/// Least reach of a robot, m: a prior without width would exclude every motion.
const LEAST_REACH_M: f64 = 0.01;

/// The unknowns of a robot: values of the drives, common and for each joint, and bodies.
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
    // Slow motion contains no inertia; without a prior its logarithm would have no lower end.
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
        // The delay of a single joint is that from its command to its measurement.
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
    // The bodies' own size is all that a single joint has.
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
