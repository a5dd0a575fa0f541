//! Values of a simulated arm are found within their error bars.

use crate::arm;
use dynident_model::{InertialParameters, Mat3, Vec3};
use dynident_servo::{
    Quantity, Run, Search, ServoRobot, ServoSettings, errors, robot_at, search, simulate, start_drives, unknowns,
};

const COUNT: f64 = core::f64::consts::TAU / 4096.0;

/// Commands of two joints: sums of sines, and steps with rests.
fn commands(seed: f64) -> Run {
    let times_s: Vec<f64> = (0..1500).map(|k| 0.02 * f64::from(k)).collect();
    let motion = |joint: f64, t: f64| {
        let sines = 0.4 * ((0.9 + 0.3 * joint + 0.1 * seed) * t).sin() + 0.2 * ((2.7 + 0.5 * joint) * t + seed).sin();
        let steps = 0.3 * ((0.21 * t + 0.3 * joint + 0.17 * seed).fract() * 4.0).floor();
        if t < 18.0 { sines } else { steps - 0.4 }
    };
    let commands: Vec<Vec<f64>> = [0.0, 1.0].map(|joint| times_s.iter().map(|&t| motion(joint, t)).collect()).into();
    Run {
        name: format!("run {seed}"),
        positions: commands.clone(),
        commands,
        times_s,
        payloads: Vec::new(),
        gains: Vec::new(),
    }
}

/// The run with the counts of an encoder.
fn measured(robot: &ServoRobot, mut run: Run, step_s: f64) -> Run {
    let positions = simulate(robot, &run, step_s).unwrap().unwrap();
    run.positions = positions.into_iter().map(|q| q.iter().map(|q| (q / COUNT).round() * COUNT).collect()).collect();
    run
}

fn fitted(runs: &[Run], settings: &ServoSettings) -> (ServoRobot, Search, Vec<dynident_servo::FreeParameter>) {
    fitted_from(arm(), runs, settings)
}

/// The fit from the responses of the joints, with the profiles and torque limits of `stated`.
fn fitted_from(
    stated: ServoRobot,
    runs: &[Run],
    settings: &ServoSettings,
) -> (ServoRobot, Search, Vec<dynident_servo::FreeParameter>) {
    let mut drives = start_drives(&stated.model, runs, &stated.drives, settings.alike);
    for (drive, stated) in drives.iter_mut().zip(&stated.drives) {
        drive.torque_limit = stated.torque_limit;
    }
    let nominal = ServoRobot { drives, ..stated };
    let parameters = unknowns(&nominal, settings);
    let found = search(&nominal, &parameters, &vec![0.0; parameters.len()], runs, settings).unwrap();
    (robot_at(&nominal, &parameters, &found.coordinates).unwrap(), found, parameters)
}

#[test]
fn a_quantised_motion_is_explained_to_the_count_and_predicts_another() {
    let truth = arm();
    let settings = ServoSettings { load_friction: true, ..ServoSettings::default() };
    let runs: Vec<Run> = [0.0, 1.0].map(|seed| measured(&truth, commands(seed), settings.step_s)).into();
    let (robot, found, _) = fitted(&runs, &settings);
    assert!(found.settled);
    // The error of rounding to counts is 0.29 counts.
    for error in &found.errors {
        assert!(*error < 0.5 * COUNT, "{:?} {:?}", found.errors, robot.drives);
    }
    let other = measured(&truth, commands(2.0), settings.step_s);
    let predicted = simulate(&robot, &other, settings.step_s).unwrap().unwrap();
    assert!(errors(&other, &predicted).iter().all(|error| *error < 0.6 * COUNT));
    for (found, drive) in robot.drives.iter().zip(&truth.drives) {
        let delay = found.delay_s - found.read_delay_s;
        assert!((delay - drive.delay_s).abs() < 0.001, "{delay}");
        // Positions determine ratios.
        let ratio = (found.damping / found.stiffness) / (drive.damping / drive.stiffness);
        assert!((ratio - 1.0).abs() < 0.03, "{ratio}");
    }
}

#[test]
fn the_scale_is_open_without_a_payload_and_found_with_one() {
    let truth = arm();
    let settings = ServoSettings::default();
    let free: Vec<Run> = [0.0, 1.0].map(|seed| measured(&truth, commands(seed), settings.step_s)).into();
    let (_, found, parameters) = fitted(&free, &settings);
    // The logarithm of the first joint's stiffness is the sum of the common coordinate and its own.
    let is_its = |parameter: &dynident_servo::FreeParameter| {
        parameter.quantity == Quantity::Stiffness && parameter.members.contains(&0)
    };
    let columns: Vec<usize> = (0..parameters.len()).filter(|&column| is_its(&parameters[column])).collect();
    let deviation = |search: &Search| {
        let pairs = columns.iter().flat_map(|&a| columns.iter().map(move |&b| (a, b)));
        pairs.map(|pair| search.covariance[pair]).sum::<f64>().sqrt()
    };
    assert!(deviation(&found) > 0.1, "a scale that positions do not contain");
    let mut loaded = commands(3.0);
    let load = InertialParameters::from_centre_of_mass(4.0, Vec3([0.5, 0.0, 0.0]), &Mat3::IDENTITY.scale(0.01));
    loaded.payloads.push((1, load));
    let mut runs = free;
    runs.push(measured(&truth, loaded, settings.step_s));
    let (robot, found, _) = fitted(&runs, &settings);
    for (found, drive) in robot.drives.iter().zip(&truth.drives) {
        let ratio = found.stiffness / drive.stiffness;
        assert!((ratio - 1.0).abs() < 0.03, "{ratio}");
    }
    assert!(deviation(&found) < 0.03, "{}", deviation(&found));
}

/// The firmware of some logs has half of the gain, and a payload measures the scale.
#[test]
fn logs_with_another_gain_belong_to_the_same_drives() {
    let truth = arm();
    let settings = ServoSettings::default();
    let with = |seed: f64, gain: f64, mass: f64| {
        let load = InertialParameters::from_centre_of_mass(mass, Vec3([0.5, 0.0, 0.0]), &Mat3::IDENTITY.scale(0.01));
        let run = Run { gains: vec![gain; 2], payloads: vec![(1, load)], ..commands(seed) };
        measured(&truth, run, settings.step_s)
    };
    let runs = [with(0.0, 1.0, 1.0), with(1.0, 0.5, 1.0), with(3.0, 0.5, 4.0)];
    let (robot, found, _) = fitted(&runs, &settings);
    for error in &found.errors {
        assert!(*error < 0.5 * COUNT, "{:?} {:?}", found.errors, robot.drives);
    }
    for (found, drive) in robot.drives.iter().zip(&truth.drives) {
        for (found, true_value) in [(found.stiffness, drive.stiffness), (found.damping, drive.damping)] {
            assert!((found / true_value - 1.0).abs() < 0.03, "{found} {true_value}");
        }
    }
}

/// Servos that follow steps with a profile, one with a smaller torque limit.
#[test]
fn profiles_and_torque_limits_are_found() {
    let mut truth = arm();
    for drive in &mut truth.drives {
        drive.profile_acceleration = 12.0;
        drive.torque_limit = 60.0;
    }
    truth.drives[1].torque_limit = 15.0;
    let settings = ServoSettings { alike: true, ..ServoSettings::default() };
    let runs: Vec<Run> = [0.0, 1.0].map(|seed| measured(&truth, commands(seed), settings.step_s)).into();
    let mut stated = arm();
    for drive in &mut stated.drives {
        (drive.profile_acceleration, drive.torque_limit) = (11.0, 40.0);
    }
    let (robot, found, parameters) = fitted_from(stated.clone(), &runs, &settings);
    let [first, second] = [0, 1].map(|joint| robot.drives[joint]);
    // A ratio, because positions do not contain the scale of torques. The first joint does not reach its limit.
    let ratio = second.torque_limit / second.stiffness;
    assert!((ratio / (15.0 / 300.0) - 1.0).abs() < 0.03, "{second:?}");
    let place = parameters.iter().position(|own| own.quantity == Quantity::ProfileAcceleration).unwrap();
    let bar = found.covariance[(place, place)].sqrt() * 12.0;
    let error = (first.profile_acceleration - 12.0).abs();
    assert!(error < 0.2 && error < 3.0 * bar && bar < 0.3, "{} ± {bar}", first.profile_acceleration);
    for error in &found.errors {
        assert!(*error < 0.6 * COUNT, "{:?} {:?}", found.errors, robot.drives);
    }
    // The same without a profile.
    let mut without = stated;
    without.drives.iter_mut().for_each(|drive| drive.profile_acceleration = f64::INFINITY);
    let (_, worse, _) = fitted_from(without, &runs, &settings);
    assert!(worse.errors[0] > 3.0 * found.errors[0], "{:?} and {:?}", worse.errors, found.errors);
}

/// A push of 0.1 rad for two seconds, which no drive explains.
#[test]
fn a_push_hardly_changes_the_fit() {
    let truth = arm();
    let settings = ServoSettings { load_friction: true, ..ServoSettings::default() };
    let mut runs: Vec<Run> = [0.0, 1.0].map(|seed| measured(&truth, commands(seed), settings.step_s)).into();
    let (clean, ..) = fitted(&runs, &settings);
    for sample in 500..600 {
        runs[0].positions[0][sample] += 0.1;
    }
    let (robust, found, _) = fitted(&runs, &settings);
    let (normal, ..) = fitted(&runs, &ServoSettings { period_freedom: 1e6, ..settings.clone() });
    // Damping over stiffness: without the scale of torques.
    let ratio = |robot: &ServoRobot| robot.drives[0].damping / robot.drives[0].stiffness;
    let change = |robot: &ServoRobot| (ratio(robot) / ratio(&clean) - 1.0).abs();
    assert!(
        change(&robust) < 0.02 && change(&robust) < 0.3 * change(&normal),
        "{} {}",
        change(&robust),
        change(&normal)
    );
    let intervals: Vec<_> = found.unexplained.iter().filter(|own| own.run == 0 && own.joint == 0).collect();
    assert!(intervals.len() == 1 && intervals[0].interval_s == [10.0, 12.0], "{:?}", found.unexplained);
}

/// A light distal link: its response alone is a bad guess of the inertia of its drive.
#[test]
fn a_light_link_is_fitted_without_equal_servos() {
    let arm = arm();
    let light = InertialParameters::from_centre_of_mass(0.01, Vec3([0.02, 0.0, 0.0]), &Mat3::IDENTITY.scale(1e-6));
    let model = arm.model.with_inertials(&[arm.model.inertials()[0], light]).unwrap();
    let truth = ServoRobot { model, ..arm };
    let settings = ServoSettings { alike: false, ..ServoSettings::default() };
    let runs = [measured(&truth, commands(0.0), settings.step_s)];
    let (robot, found, _) = fitted_from(truth, &runs, &settings);
    assert!(found.errors.iter().all(|error| *error < COUNT), "{:?} {:?}", found.errors, robot.drives);
    let reads: f64 = robot.drives.iter().map(|drive| drive.read_delay_s).sum();
    assert!(reads.abs() < 1e-12, "read delays are zero in the mean");
}
