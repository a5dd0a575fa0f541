//! Contact detection: false-alarm rate as allowed, and short detection times.

use dynident_dynamics::{Workspace, inverse_dynamics};
use dynident_model::sample::Random;
use dynident_model::{InertialParameters, Mat3, Model, Vec3, load_robot};
use dynident_online::{ContactMonitor, ContactSettings, OnlineError, Residuals, TimeScale};
use dynident_testing::repository;

const RATE_HZ: f64 = 125.0;
/// Torque noise of the UR10's joints, Nm.
const STD: [f64; 6] = [0.8, 0.8, 0.5, 0.2, 0.2, 0.15];

/// Gaussian noise with a correlation of a few samples, like filtered residuals.
struct Noise {
    random: Random,
    now: [f64; 6],
}

impl Noise {
    fn new(seed: u64) -> Self {
        Self { random: Random::new(seed), now: [0.0; 6] }
    }

    fn next(&mut self) -> [f64; 6] {
        const KEPT: f64 = 0.7;
        for (joint, now) in self.now.iter_mut().enumerate() {
            let white: f64 = (0..12).map(|_| self.random.uniform(-0.5, 0.5)).sum();
            *now = KEPT * *now + STD[joint] * (1.0 - KEPT * KEPT).sqrt() * white;
        }
        self.now
    }
}

fn calibration(seed: u64, seconds: f64) -> Residuals {
    let mut noise = Noise::new(seed);
    let mut residuals = Residuals { joints: vec![Vec::new(); 6] };
    for _ in 0..(seconds * RATE_HZ) as usize {
        for (joint, value) in residuals.joints.iter_mut().zip(noise.next()) {
            joint.push(value);
        }
    }
    residuals
}

#[test]
fn false_alarm_rate_is_as_allowed() {
    // One per minute for an hour: sixty are expected, with a standard deviation of eight.
    let settings = ContactSettings { false_alarms_per_hour: 60.0, ..ContactSettings::new(RATE_HZ) };
    let mut monitor = ContactMonitor::new(settings, &calibration(1, 600.0)).unwrap();
    let mut noise = Noise::new(2);
    let (mut alarms, mut quiet) = (0, 0);
    for _ in 0..(3600.0 * RATE_HZ) as usize {
        // Consecutive detections are one alarm.
        match monitor.add(&noise.next()).unwrap() {
            Some(_) if quiet > 250 => {
                alarms += 1;
                quiet = 0;
            }
            Some(_) => quiet = 0,
            None => quiet += 1,
        }
    }
    // Rice's formula applies to high levels, and the factor for heavy tails reduces alarms.
    assert!((5..=90).contains(&alarms), "{alarms}");
}

/// The UR10 with a point mass at its hand.
fn carrying(model: &Model, mass_kg: f64) -> Model {
    let all = model.parameter_vector();
    let mut bodies: Vec<InertialParameters> =
        all.as_chunks::<10>().0.iter().map(|one| InertialParameters(*one)).collect();
    let point = InertialParameters::from_centre_of_mass(mass_kg, Vec3([0.0, 0.0, 0.1]), &Mat3([[0.0; 3]; 3]));
    let hand = bodies.last_mut().unwrap();
    for (own, added) in hand.0.iter_mut().zip(point.0) {
        *own += added;
    }
    model.with_inertials(&bodies).unwrap()
}

/// A slow motion of the outstretched arm.
fn state(time_s: f64) -> [Vec<f64>; 3] {
    let mut motion = [vec![0.0; 6], vec![0.0; 6], vec![0.0; 6]];
    let rest = [0.0, -0.6, 0.5, 0.2, 0.4, 0.0];
    for joint in 0..6 {
        let (size, omega) = (0.3, 0.5 + 0.2 * joint as f64);
        motion[0][joint] = rest[joint] + size * (omega * time_s).sin();
        motion[1][joint] = size * omega * (omega * time_s).cos();
        motion[2][joint] = -size * omega * omega * (omega * time_s).sin();
    }
    motion
}

/// An identified UR10: all inertial parameters have errors of 2 %.
fn identified(model: &Model) -> Model {
    let mut random = Random::new(7);
    let all = model.parameter_vector();
    let bodies = all
        .as_chunks::<10>()
        .0
        .iter()
        .map(|one| InertialParameters(one.map(|value| value * (1.0 + random.uniform(-0.02, 0.02)))));
    model.with_inertials(&bodies.collect::<Vec<_>>()).unwrap()
}

/// Model errors of ten minutes of work, for each sample.
fn unexplained(robot: &Model, model: &Model) -> Vec<[f64; 6]> {
    let (mut own, mut other) = (Workspace::new(robot), Workspace::new(model));
    let at = |sample: usize| {
        let [q, dq, ddq] = state(sample as f64 / RATE_HZ);
        let felt = inverse_dynamics(robot, &mut own, &q, &dq, &ddq);
        let predicted = inverse_dynamics(model, &mut other, &q, &dq, &ddq);
        core::array::from_fn(|joint| felt[joint] - predicted[joint])
    };
    (0..(600.0 * RATE_HZ) as usize).map(at).collect()
}

/// A monitor calibrated with ten minutes of undisturbed work, and the model errors.
fn at_work(model: &Model, seed: u64) -> (ContactMonitor, Vec<[f64; 6]>) {
    let off = unexplained(model, &identified(model));
    let mut calibration = calibration(seed, 600.0);
    for (sample, off) in off.iter().enumerate() {
        for (joint, residuals) in calibration.joints.iter_mut().enumerate() {
            residuals[sample] += off[joint];
        }
    }
    (ContactMonitor::new(ContactSettings::new(RATE_HZ), &calibration).unwrap(), off)
}

/// Number of alarms in hours of undisturbed motion; detections within two seconds are one alarm.
fn false_alarms(hours: usize, seed: u64) -> usize {
    let model = load_robot(repository("robots/ur10.urdf")).unwrap().model;
    let (mut monitor, off) = at_work(&model, 1000 + seed);
    let mut noise = Noise::new(seed);
    let (mut alarms, mut quiet) = (0, usize::MAX);
    // The motion repeats every ten minutes, but the noise does not.
    for off in off.iter().cycle().take((3600.0 * RATE_HZ) as usize * hours) {
        let mut residuals = noise.next();
        for (residual, off) in residuals.iter_mut().zip(off) {
            *residual += off;
        }
        if monitor.add(&residuals).unwrap().is_some() {
            alarms += usize::from(quiet > 250);
            quiet = 0;
        } else {
            quiet = quiet.saturating_add(1);
        }
    }
    alarms
}

/// The settings allow one alarm in twenty hours.
#[test]
fn in_ten_hours_there_is_less_than_one_false_alarm() {
    let runs = dynident_testing::count(1, 30);
    let alarms: Vec<usize> = (0..runs as u64).map(|run| false_alarms(10, (5 + run) % 30)).collect();
    println!("false alarms in each ten hours: {alarms:?}");
    assert!(alarms.iter().sum::<usize>() < runs, "{alarms:?}");
}

#[test]
fn half_a_kilogram_and_a_push_at_the_wrist_are_seen() {
    let model = load_robot(repository("robots/ur10.urdf")).unwrap().model;
    let (monitor, off) = at_work(&model, 3);
    let carried: Vec<[f64; 6]> = unexplained(&carrying(&model, 0.5), &model);
    let mut noise = Noise::new(4);
    // Time from the start of a load or push until its detection, s, and the time scale.
    let mut detected = |from_s: f64, push: Option<f64>, look: TimeScale| {
        let mut monitor = monitor.clone();
        let from = (from_s * RATE_HZ) as usize;
        for sample in from - (20.0 * RATE_HZ) as usize..off.len() {
            let mut residuals = noise.next();
            for joint in 0..6 {
                let load = if push.is_none() && sample >= from { carried[sample][joint] } else { 0.0 };
                residuals[joint] += off[sample][joint] + load;
            }
            residuals[4] += push.filter(|_| sample >= from).unwrap_or(0.0);
            match monitor.add(&residuals).unwrap() {
                Some(contact) if contact.look == look => {
                    assert!(sample >= from, "before there was anything: {contact:?}");
                    assert!(push.is_none() || contact.joint == 4);
                    return (sample - from) as f64 / RATE_HZ;
                }
                _ => {}
            }
        }
        panic!("not seen")
    };
    let moments: Vec<f64> = (0..40).map(|k| 30.0 + 13.7 * f64::from(k)).collect();
    let mut latest = |push: Option<f64>, look: TimeScale| {
        let mut all: Vec<f64> = moments.iter().map(|&from_s| detected(from_s, push, look)).collect();
        all.sort_by(f64::total_cmp);
        (all[all.len() / 2], all[all.len() - 1])
    };
    let push = latest(Some(3.0), TimeScale::Collision);
    let (up, payload) = (latest(Some(-3.0), TimeScale::Collision), latest(None, TimeScale::Payload));
    println!("3 Nm seen after {push:?} and {up:?} s, 0.5 kg after {payload:?} s: median and longest of forty");
    // A time constant of 20 ms detects a push of twice the threshold within 14 ms; five time constants suffice for
    // both.
    assert!(push.1 < 0.1 && up.1 < 0.1, "{push:?} {up:?}");
    // Half a kilogram at a metre is 5 Nm at the shoulder: detected within three time constants of the payload.
    assert!(payload.1 < 6.0, "{payload:?}");
}

#[test]
fn the_band_of_a_model_gives_the_thresholds_of_its_noise() {
    // Compares thresholds from the model accuracy with thresholds measured on noise of that size and correlation: two
    // ways to Rice's rate of the same process.
    let settings = ContactSettings { false_alarms_per_hour: 10.0, ..ContactSettings::new(RATE_HZ) };
    let measured = ContactMonitor::new(settings.clone(), &calibration(8, 3600.0)).unwrap();
    let correlation_s = -1.0 / (RATE_HZ * 0.7_f64.ln());
    let stated = ContactMonitor::from_band(settings.clone(), &STD, correlation_s, None).unwrap();
    for (measured, stated) in measured.thresholds_nm().iter().zip(stated.thresholds_nm()) {
        for look in 0..2 {
            // The 8 ms sampling is not exactly continuous time, and the largest mean in an hour raises the measured
            // threshold.
            assert!((stated[look] / measured[look] - 1.0).abs() < 0.25, "{stated:?} and {measured:?}");
        }
    }
    assert!(ContactMonitor::from_band(settings.clone(), &[0.0; 6], 1.0, None).is_err());
    assert!(ContactMonitor::from_band(settings.clone(), &STD, f64::NAN, None).is_err());
    assert!(ContactMonitor::from_band(settings, &STD, 1.0, Some(0.0)).is_err());
}

#[test]
fn thresholds_include_filtered_noise() {
    // White noise of 1 Nm at 125 Hz has a standard deviation of √(4/62.5) after a 4 Hz filter, as used by the model.
    let settings = ContactSettings { false_alarms_per_hour: 10.0, ..ContactSettings::new(RATE_HZ) };
    let mut random = Random::new(11);
    let white = (0..450_000).map(|_| (0..12).map(|_| random.uniform(-0.5, 0.5)).sum()).collect();
    let measured = ContactMonitor::new(settings.clone(), &Residuals { joints: vec![white] }).unwrap();
    let known = (4.0 / (0.5 * RATE_HZ)).sqrt();
    let stated = ContactMonitor::from_band(settings.clone(), &[known], 0.1, Some(4.0)).unwrap();
    let [measured, stated] = [measured, stated].map(|monitor| monitor.thresholds_nm()[0][0]);
    // A mean over 2.5 samples passes slightly less than 12.5 Hz; the largest mean in an hour raises the measured
    // threshold.
    assert!((stated / measured - 1.0).abs() < 0.2, "{stated} and {measured}");
    let blind = ContactMonitor::from_band(settings, &[known], 0.1, None).unwrap();
    assert!(blind.thresholds_nm()[0][0] < 0.7 * measured);
}

#[test]
fn unusable_calibration_is_refused() {
    let settings = ContactSettings::new(RATE_HZ);
    let refused = ContactMonitor::new(settings.clone(), &calibration(1, 1.0));
    assert!(matches!(refused, Err(OnlineError::Number { .. })));
    let silent = Residuals { joints: vec![vec![0.0; 10_000]; 6] };
    assert!(matches!(ContactMonitor::new(settings.clone(), &silent), Err(OnlineError::Number { .. })));
    let mut monitor = ContactMonitor::new(settings, &calibration(1, 60.0)).unwrap();
    assert!(matches!(monitor.add(&[0.0; 5]), Err(OnlineError::Length { .. })));
    assert!(matches!(monitor.add(&[f64::NAN; 6]), Err(OnlineError::Number { .. })));
    assert_eq!(monitor.thresholds_nm().len(), 6);
}
