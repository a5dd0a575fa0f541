//! Derivatives of simulated positions against central differences.

use crate::drive::Drive;
use crate::floor::{Floor, FloorPoint};
use crate::parameters::{FreeParameter, ServoRobot, VariedRobot};
use crate::quantity::Quantity;
use crate::rollout::Rollout;
use crate::run::Run;
use crate::settings::ServoSettings;
use crate::step_state::Stepping;
use crate::unknowns::unknowns;
use dynident_model::{Vec3, load_robot};

const STEP_S: f64 = 0.005;
/// Effect of a coordinate's unit on positions, rad, below which rounding decides the central difference.
const LEAST_DERIVATIVE: f64 = 1e-4;

fn robot(friction: f64) -> ServoRobot {
    let model = load_robot(dynident_testing::repository("robots/ur10.urdf")).unwrap().model;
    let drive = Drive {
        stiffness: 4000.0,
        damping: 300.0,
        armature: 2.0,
        coulomb: 20.0 * friction,
        load_friction: 0.1 * friction,
        stribeck: 10.0 * friction,
        stribeck_speed: 0.1,
        torque_limit: f64::INFINITY,
        profile_acceleration: f64::INFINITY,
        profile_speed: f64::INFINITY,
        delay_s: 0.013,
        read_delay_s: 0.002,
        zero: 0.01,
    };
    ServoRobot { drives: vec![drive; model.dof()], model, floor: None }
}

fn run(joints: usize) -> Run {
    let times_s: Vec<f64> = (0..60).map(|k| 0.02 * f64::from(k)).collect();
    let at = |joint: usize, t: f64| {
        let joint = joint as f64;
        0.2 * joint - 0.6 + 0.3 * ((3.0 + joint) * t).sin() + if t > 0.6 { 0.1 } else { 0.0 }
    };
    let commands: Vec<Vec<f64>> = (0..joints).map(|joint| times_s.iter().map(|&t| at(joint, t)).collect()).collect();
    Run { name: "run".into(), positions: commands.clone(), commands, times_s, payloads: Vec::new(), gains: Vec::new() }
}

fn parameters(robot: &ServoRobot) -> Vec<FreeParameter> {
    unknowns(robot, &ServoSettings { alike: true, ..ServoSettings::default() })
}

/// Positions by sample and joint, and derivatives by one coordinate.
fn simulate(robot: &ServoRobot, parameters: &[FreeParameter], z: &[f64], run: &Run) -> Vec<(f64, Vec<f64>)> {
    let varied = VariedRobot::new(robot, parameters, z).unwrap();
    let mut out = Vec::new();
    let ended = Rollout::new(&varied, run, Stepping::accurate(STEP_S), true)
        .unwrap()
        .simulate(|predicted| out.push((predicted.position, predicted.derivatives.to_vec())));
    assert!(ended);
    out
}

/// Largest difference for each parameter, relative to the largest derivative by it; samples whose steps change their
/// modes within the difference are left out if `switches`, at most one in a hundred.
fn largest_difference(robot: &ServoRobot, run: &Run, switches: bool) -> f64 {
    let parameters = parameters(robot);
    let z = vec![0.0; parameters.len()];
    let exact = simulate(robot, &parameters, &z, run);
    let mut largest: f64 = 0.0;
    let (mut outside, mut count) = (0, 0);

    for k in 0..parameters.len() {
        // Smooth motion permits the longer difference, which has less rounding error.
        let delta = if switches { 1e-6 } else { 1e-5 };
        let moved = |sign: f64| {
            let mut z = z.clone();
            z[k] += sign * delta;
            simulate(robot, &parameters, &z, run)
        };
        let (above, below) = (moved(1.0), moved(-1.0));
        let size = exact.iter().map(|(_, d)| d[k].abs()).fold(LEAST_DERIVATIVE, f64::max);
        for ((above, below), (_, derivatives)) in above.iter().zip(&below).zip(&exact) {
            let difference = ((above.0 - below.0) / (2.0 * delta) - derivatives[k]).abs() / size;
            count += 1;
            if switches && difference > 1e-4 {
                outside += 1;
            } else {
                largest = largest.max(difference);
            }
        }
    }
    assert!(outside * 100 <= count, "{outside} of {count} differ");
    largest
}

#[test]
fn derivatives_of_smooth_motion_equal_central_differences() {
    let robot = robot(0.0);
    let run = Run { gains: vec![1.0, 0.5, 2.0, 1.0, 0.7, 1.0], ..run(6) };
    let largest = largest_difference(&robot, &run, false);
    assert!(largest < 1e-6, "{largest:e}");
}

#[test]
fn derivatives_hold_where_joints_stop_and_break_away() {
    let robot = robot(1.0);
    let largest = largest_difference(&robot, &run(6), true);
    assert!(largest < 1e-4, "{largest:e}");
}

#[test]
fn derivatives_hold_at_the_torque_limit_and_on_the_floor() {
    let mut robot = robot(0.0);
    for drive in &mut robot.drives {
        drive.torque_limit = 150.0;
    }
    let point = FloorPoint { body: 5, at_m: Vec3([0.0, 0.1, 0.05]) };
    robot.floor = Some(Floor { height_m: 0.75, stiffness: 20_000.0, points: vec![point] });
    let largest = largest_difference(&robot, &run(6), true);
    assert!(largest < 1e-4, "{largest:e}");
}

/// The derivatives of a profile are central differences over the same change of its limits; bodies and drives are
/// differentiated exactly.
#[test]
fn derivatives_by_the_limits_of_a_profile_equal_differences() {
    let mut robot = robot(0.0);
    for drive in &mut robot.drives {
        (drive.profile_acceleration, drive.profile_speed) = (4.0, 0.5);
    }
    let (run, parameters) = (run(6), parameters(&robot));
    let z = vec![0.0; parameters.len()];
    let exact = simulate(&robot, &parameters, &z, &run);
    for quantity in [Quantity::ProfileAcceleration, Quantity::ProfileSpeed] {
        let k = parameters.iter().position(|own| own.quantity == quantity).unwrap();
        let moved = |sign: f64| {
            let mut z = z.clone();
            z[k] += sign * 0.01;
            simulate(&robot, &parameters, &z, &run)
        };
        let (above, below) = (moved(1.0), moved(-1.0));
        let size = exact.iter().map(|(_, d)| d[k].abs()).fold(0.0, f64::max);
        assert!(size > 0.01, "{quantity:?} {size}");
        for ((above, below), (_, derivatives)) in above.iter().zip(&below).zip(&exact) {
            let difference = ((above.0 - below.0) / 0.02 - derivatives[k]).abs() / size;
            assert!(difference < 1e-3, "{quantity:?} {difference}");
        }
    }
}
