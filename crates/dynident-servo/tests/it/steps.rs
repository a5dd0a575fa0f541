//! Errors by the time steps of the simulation, against the same motion with steps of 0.1 ms.

use dynident_model::load_robot;
use dynident_servo::{
    Drive, Quantity, Run, ServoRobot, ServoSettings, robot_at, search, simulate, start_drives, unknowns, values,
};

const COUNT: f64 = core::f64::consts::TAU / 4096.0;
const FINE_S: f64 = 0.0001;

/// An SO-101 whose servos differ in their friction, also in that under load.
fn truth() -> ServoRobot {
    let model = load_robot(dynident_testing::repository("robots/so101.xml")).unwrap().model;
    let drive = |joint: usize| {
        let part = [1.0, 0.9, 0.6, 1.3, 1.5, 0.7][joint];
        Drive {
            stiffness: 13.5 + 0.4 * part,
            damping: 0.24,
            armature: 0.022,
            coulomb: 0.12 * part,
            load_friction: 0.15 / part,
            stribeck: 0.03,
            stribeck_speed: 0.1,
            torque_limit: 3.35,
            profile_acceleration: f64::INFINITY,
            profile_speed: f64::INFINITY,
            // Commands change within a time step.
            delay_s: 0.0239,
            read_delay_s: -0.0004 * joint as f64,
            zero: 0.0,
        }
    };
    let drives = (0..model.dof()).map(drive).collect();
    ServoRobot { model, drives, floor: None }
}

/// Sines, slow reversals, and steps with rests that saturate the servos, in counts.
fn run(robot: &ServoRobot, seed: f64) -> Run {
    let times_s: Vec<f64> = (0..1250).map(|k| 0.02 * f64::from(k)).collect();
    let command = |joint: f64, t: f64| {
        let place = ((t + 0.7 * joint) / 6.0 + seed).floor();
        let centre = 0.3 * (2.3 * place + joint).sin();
        let inside = t + 0.7 * joint + 6.0 * seed - 6.0 * place;
        match (place as i64 + joint as i64) % 3 {
            0 => centre + 0.25 * ((1.5 + 0.7 * inside) * inside).sin(),
            1 => centre + 0.6 * (inside / 1.5).floor().rem_euclid(2.0),
            _ => centre + 0.3 * (0.9 * inside).sin(),
        }
    };
    let of_joint = |joint: usize| times_s.iter().map(|&t| command(joint as f64, t)).collect::<Vec<f64>>();
    let commands: Vec<Vec<f64>> = (0..robot.drives.len()).map(of_joint).collect();
    let positions = commands.clone();
    let run = Run { name: "run".into(), times_s, commands, positions, payloads: Vec::new(), gains: Vec::new() };
    let positions = simulate(robot, &run, FINE_S).unwrap().unwrap();
    let counted = positions.into_iter().map(|q| q.iter().map(|q| (q / COUNT).round() * COUNT).collect());
    Run { positions: counted.collect(), ..run }
}

/// The limited torque of a step in which the command jumps is the mean of both parts.
#[test]
fn steps_at_the_torque_limit_need_no_short_time_steps() {
    let robot = truth();
    let run = run(&robot, 0.0);
    let [fine, coarse] = [FINE_S, 0.0025].map(|step_s| simulate(&robot, &run, step_s).unwrap().unwrap());
    for (joint, (fine, coarse)) in fine.iter().zip(&coarse).enumerate() {
        let squares: f64 = fine.iter().zip(coarse).map(|(fine, coarse)| (fine - coarse).powi(2)).sum();
        let error = (squares / fine.len() as f64).sqrt();
        assert!(error < 0.3 * COUNT, "joint {joint}: {:.3} mrad", 1e3 * error);
    }
}

/// With servos of one type, friction under load still differs between joints, and the search ends at the best minimum.
#[test]
fn values_of_equal_servos_are_within_their_bars() {
    let truth = truth();
    let settings = ServoSettings { alike: true, ..ServoSettings::default() };
    let runs = [0.0, 0.37].map(|seed| run(&truth, seed));
    let mut drives = start_drives(&truth.model, &runs, &truth.drives, true);
    for drive in &mut drives {
        drive.torque_limit = 3.35;
    }
    let nominal = ServoRobot { drives, ..truth.clone() };
    let parameters = unknowns(&nominal, &settings);
    let found = search(&nominal, &parameters, &vec![0.0; parameters.len()], &runs, &settings).unwrap();
    assert!(found.settled && found.errors.iter().all(|error| *error < 0.5 * COUNT), "{:?}", found.errors);
    let robot = robot_at(&nominal, &parameters, &found.coordinates).unwrap();
    let (list, scale) = values(&nominal, &parameters, &found).unwrap();
    let total: f64 = truth.model.inertials().iter().map(dynident_model::InertialParameters::mass_kg).sum();
    let factor = scale.mass_kg / total;
    let mean_read = truth.drives.iter().map(|drive| drive.read_delay_s).sum::<f64>() / truth.drives.len() as f64;
    let (mut inside, mut count, mut outside) = (0, 0, Vec::new());
    for value in &list {
        let drive = &truth.drives[value.index.min(truth.drives.len() - 1)];
        let expected = match value.quantity {
            Quantity::Stiffness => factor * drive.stiffness,
            Quantity::Damping => factor * drive.damping,
            Quantity::Armature => factor * drive.armature,
            Quantity::Coulomb => factor * drive.coulomb,
            Quantity::Stribeck => factor * drive.stribeck,
            Quantity::LoadFriction => drive.load_friction,
            // One value of all joints.
            Quantity::Delay if value.index == 0 => drive.delay_s - mean_read,
            Quantity::ReadDelay => drive.read_delay_s - mean_read,
            Quantity::Mass => factor * truth.model.inertials()[value.index].mass_kg(),
            _ => continue,
        };
        count += 1;
        if (value.value - expected).abs() <= 1.96 * value.std_at_scale {
            inside += 1;
        } else {
            outside.push((value.quantity, value.index, value.value, expected, value.std_at_scale));
        }
    }
    assert!(inside * 100 >= 90 * count, "{inside} of {count}: {outside:?} {robot:?}");
}
