//! Contact is seen as often as was allowed where there is none, and soon where there is.

use dynident_dynamics::{Workspace, inverse_dynamics};
use dynident_model::sample::Random;
use dynident_model::{InertialParameters, Mat3, Model, Vec3, load_robot};
use dynident_online::{ContactMonitor, ContactSettings, Look, OnlineError, Residuals};
use dynident_testing::repository;

const RATE_HZ: f64 = 125.0;
/// Torque noise of the UR10's joints, Nm.
const STD: [f64; 6] = [0.8, 0.8, 0.5, 0.2, 0.2, 0.15];

/// Gaussian noise with a correlation of a few samples, as filtered residuals have it.
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
fn false_alarms_come_as_often_as_was_allowed() {
    // One a minute for an hour: sixty are expected, and their number scatters by eight.
    let settings = ContactSettings { false_alarms_per_hour: 60.0, ..ContactSettings::new(RATE_HZ) };
    let mut monitor = ContactMonitor::new(settings, &calibration(1, 600.0)).unwrap();
    let mut noise = Noise::new(2);
    let (mut alarms, mut quiet) = (0, 0);
    for _ in 0..(3600.0 * RATE_HZ) as usize {
        // What goes on is one alarm.
        match monitor.add(&noise.next()).unwrap() {
            Some(_) if quiet > 250 => {
                alarms += 1;
                quiet = 0;
            }
            Some(_) => quiet = 0,
            None => quiet += 1,
        }
    }
    // Rice's rate is that of high levels, and the safety for heavy tails makes alarms fewer.
    assert!((5..=90).contains(&alarms), "{alarms}");
}

/// The UR10 with a point mass in its hand.
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

/// A slow motion with the arm stretched out.
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

#[test]
fn half_a_kilogram_and_a_push_at_the_wrist_are_seen_and_nothing_else_is() {
    let model = load_robot(repository("robots/ur10.urdf")).unwrap().model;
    let loaded = carrying(&model, 0.5);
    let (mut own, mut other) = (Workspace::new(&model), Workspace::new(&loaded));
    let mut monitor = ContactMonitor::new(ContactSettings::new(RATE_HZ), &calibration(3, 600.0)).unwrap();
    let mut noise = Noise::new(4);
    let mut seen = Vec::new();
    let mut run = |monitor: &mut ContactMonitor, from_s: f64, to_s: f64, load: bool, push_nm: f64| {
        seen.clear();
        for sample in (from_s * RATE_HZ) as usize..(to_s * RATE_HZ) as usize {
            let time_s = sample as f64 / RATE_HZ;
            let [q, dq, ddq] = state(time_s);
            let predicted = inverse_dynamics(&model, &mut own, &q, &dq, &ddq).to_vec();
            let felt =
                if load { inverse_dynamics(&loaded, &mut other, &q, &dq, &ddq).to_vec() } else { predicted.clone() };
            let white = noise.next();
            let mut residuals: Vec<f64> = (0..6).map(|joint| felt[joint] - predicted[joint] + white[joint]).collect();
            residuals[4] += push_nm;
            if let Some(contact) = monitor.add(&residuals).unwrap() {
                seen.push((time_s - from_s, contact));
            }
        }
        seen.clone()
    };
    // Ten minutes in which nothing happens: one false alarm in ten hours is allowed.
    assert!(run(&mut monitor, 0.0, 600.0, false, 0.0).is_empty());
    // 3 Nm at a wrist: within a tenth of a second.
    let push = run(&mut monitor, 600.0, 600.2, false, 3.0);
    assert!(push[0].0 < 0.1 && push[0].1.joint == 4 && push[0].1.look == Look::Collision, "{:?}", push[0]);
    monitor.restart();
    // Half a kilogram at a metre is 5 Nm at the shoulder: within the payload's time constants.
    let payload = run(&mut monitor, 700.0, 706.0, true, 0.0);
    assert!(!payload.is_empty() && payload[0].0 < 6.0, "{payload:?}");
    assert!(payload.iter().any(|(_, contact)| contact.look == Look::Payload));
}

#[test]
fn a_calibration_that_says_nothing_is_refused() {
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
