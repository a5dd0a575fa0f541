//! Fits of simulated robots whose values are known.
#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

mod design;
mod laws;
mod recovery;
mod refused;
mod starts;
mod steps;

use dynident_model::load_robot;
use dynident_servo::{Drive, ServoRobot};

/// A planar arm with two position servos that differ in their friction.
fn arm() -> ServoRobot {
    let model = load_robot(dynident_testing::repository("robots/planar2r.urdf")).unwrap().model;
    let drive = |coulomb: f64| Drive {
        stiffness: 300.0,
        damping: 25.0,
        armature: 0.8,
        coulomb,
        load_friction: 0.05,
        stribeck: 0.3 * coulomb,
        stribeck_speed: 0.1,
        torque_limit: f64::INFINITY,
        profile_acceleration: f64::INFINITY,
        profile_speed: f64::INFINITY,
        delay_s: 0.02,
        read_delay_s: 0.0,
        zero: 0.0,
    };
    ServoRobot { drives: vec![drive(3.0), drive(1.5)], model, floor: None }
}
