//! Drift detection with errors correlated in time: false-alarm rate as allowed, and short detection times.

use dynident_dynamics::ParametricModel;
use dynident_model::load_robot;
use dynident_model::sample::Random;
use dynident_model::terms::{DriveChoice, terms_per_joint};
use dynident_online::{DriftMonitor, DriftSettings, OnlineError, OnlineEstimator, OnlineSettings, StartingPoint};
use dynident_testing::repository;
use nalgebra::{DMatrix, DVector};

const RATE_HZ: f64 = 20.0;
const HALF_LIFE_S: f64 = 5.0;
const CHECK_S: f64 = 20.0;
const STD: [f64; 2] = [0.3, 0.1];
/// Correlation of errors between samples: nineteen samples contain the information of one independent sample.
const KEPT: f64 = 0.9;

fn robot() -> ParametricModel {
    let model = load_robot(repository("robots/planar2r.urdf")).unwrap().model;
    let terms = terms_per_joint(&model, |_| DriveChoice { viscous: true, ..DriveChoice::default() });
    ParametricModel::new(model, terms).unwrap()
}

/// An arm at work: its parameters, and errors correlated in time.
struct AtWork {
    estimator: OnlineEstimator,
    random: Random,
    errors: [f64; 2],
    sample: u64,
}

impl AtWork {
    fn new(seed: u64) -> Self {
        let half_life_samples = Some(HALF_LIFE_S * RATE_HZ);
        // The correlation of errors is not given; it is learned.
        let settings = OnlineSettings { half_life_samples, ..OnlineSettings::new(STD.to_vec()) };
        let estimator = OnlineEstimator::new(robot(), settings, None).unwrap();
        Self { estimator, random: Random::new(seed), errors: [0.0; 2], sample: 0 }
    }

    /// Works until the next check, with these parameters.
    fn work(&mut self, truth: &[f64]) {
        for _ in 0..(CHECK_S * RATE_HZ) as usize {
            let time_s = self.sample as f64 / RATE_HZ;
            let mut state = [[0.0; 2]; 3];
            for joint in 0..2 {
                for (part, size) in [(0.7, 1.0), (1.9, 0.4), (2.6, 0.3)] {
                    let omega = part + 0.13 * joint as f64;
                    let (sin, cos) = (omega * time_s).sin_cos();
                    state[0][joint] += size * sin;
                    state[1][joint] += size * omega * cos;
                    state[2][joint] -= size * omega * omega * sin;
                }
                let white: f64 = (0..12).map(|_| self.random.uniform(-0.5, 0.5)).sum();
                self.errors[joint] = KEPT * self.errors[joint] + STD[joint] * (1.0 - KEPT * KEPT).sqrt() * white;
            }
            let [q, dq, ddq] = state;
            // Torque for the true parameters: computes the regressor before the sample is added.
            let tau = self.torque(truth, [q, dq, ddq]);
            self.estimator.add(&q, &dq, &ddq, &tau).unwrap();
            self.sample += 1;
        }
    }

    fn torque(&self, truth: &[f64], [q, dq, ddq]: [[f64; 2]; 3]) -> [f64; 2] {
        use dynident_dynamics::{BatchWorkspace, Panels, regressor_panels};
        use dynident_model::terms::JointMotion;
        thread_local! {
            static PLACE: std::cell::RefCell<Option<(BatchWorkspace, Panels)>> = const { std::cell::RefCell::new(None) };
        }
        let robot = &self.estimator.model().parametric;
        let motion = JointMotion { samples: 1, q: &q, dq: &dq, ddq: &ddq };
        PLACE.with_borrow_mut(|place| {
            let (workspace, panels) =
                place.get_or_insert_with(|| (BatchWorkspace::new(robot.model()), Panels::default()));
            regressor_panels(robot.model(), workspace, robot.layout(), &motion, panels);
            core::array::from_fn(|joint| {
                let own = robot.layout().joint_columns(joint).iter().zip(panels.joint(joint));
                own.map(|(&column, entry)| truth[column] * entry).sum::<f64>() + self.errors[joint]
            })
        })
    }
}

/// True parameters, and a reference identified from one minute with other errors.
fn reference(seed: u64) -> (Vec<f64>, StartingPoint) {
    let robot = robot();
    let mut truth = robot.nominal_base().unwrap().to_vec();
    for (value, column) in truth.iter_mut().zip(robot.layout().columns()) {
        if matches!(column, dynident_dynamics::Column::Term(_)) {
            *value = 1.0;
        }
    }
    let mut recorded = AtWork::new(seed);
    for _ in 0..3 {
        recorded.work(&truth);
    }
    let factor = recorded.estimator.information();
    let triangle = factor.regressor_triangle();
    let values: DVector<f64> = triangle.solve_upper_triangular(&factor.rotated_torque()).unwrap();
    let root = triangle.solve_upper_triangular(&DMatrix::identity(values.len(), values.len())).unwrap();
    // Nineteen samples contain the information of one.
    let covariance = &root * root.transpose() * ((1.0 + KEPT) / (1.0 - KEPT));
    (truth, StartingPoint { values: values.as_slice().to_vec(), covariance })
}

fn learned(work: &mut AtWork, truth: &[f64], reference: StartingPoint, per_hour: f64) -> DriftMonitor {
    let settings = DriftSettings { false_alarms_per_hour: per_hour, ..DriftSettings::new(CHECK_S) };
    let mut monitor = DriftMonitor::new(settings, reference).unwrap();
    // The first check still depends on the start.
    work.work(truth);
    while monitor.learned() < 30 {
        assert!(monitor.check(&work.estimator).unwrap().is_none() || monitor.is_ready());
        work.work(truth);
        monitor.learn(&work.estimator).unwrap();
    }
    monitor
}

#[test]
fn false_alarm_rate_is_at_most_as_allowed() {
    // Nine per hour are one in twenty checks, for ten arms with a reference and thirty learned checks each: fifty of
    // 1000 checks are allowed. The uncertainty of the scatter reduces alarms, but zero alarms would not test anything.
    let (mut alarms, mut checks) = (0, 0);
    for arm in 0..10 {
        let (truth, reference) = reference(100 + arm);
        let mut work = AtWork::new(arm);
        let monitor = learned(&mut work, &truth, reference, 9.0);
        for _ in 0..100 {
            work.work(&truth);
            alarms += usize::from(monitor.check(&work.estimator).unwrap().unwrap().is_raised());
            checks += 1;
        }
    }
    // Upper bound: fifty plus three standard deviations of seven; a threshold far too high would give no alarm.
    println!("{alarms} false alarms in {checks} checks; 50 were allowed");
    assert!((1..=71).contains(&alarms), "{alarms} of {checks}");
}

#[test]
fn friction_that_doubles_in_an_hour_is_seen_within_it_and_a_payload_at_once() {
    let (truth, reference) = reference(3);
    let mut work = AtWork::new(4);
    // One false alarm in ten hours.
    let monitor = learned(&mut work, &truth, reference, 0.1);
    let friction = work.estimator.model().base().expressions().iter().position(|name| name == "fv2").unwrap();
    let mut drifting = truth.clone();
    let mut first = None;
    for check in 1..=180 {
        drifting[friction] = truth[friction] * (1.0 + f64::from(check) / 180.0);
        work.work(&drifting);
        let found = monitor.check(&work.estimator).unwrap().unwrap();
        if found.is_raised() {
            first = Some((check, found));
            break;
        }
    }
    let (check, found) = first.unwrap();
    let share = f64::from(check) / 180.0;
    println!("seen after {} minutes, at {} of the friction", share * 60.0, 1.0 + share);
    assert!(check < 90, "friction was {} of what it is", 1.0 + f64::from(check) / 180.0);
    assert_eq!(found.parameter, friction);
    // Back, and then with a payload: first moments and inertias of half a kilogram at the tip.
    for _ in 0..3 {
        work.work(&truth);
    }
    assert!(!monitor.check(&work.estimator).unwrap().unwrap().is_raised());
    let robot = robot();
    let mut bodies: Vec<f64> = robot.nominal().to_vec();
    let tip = robot.model().inertial_count() - 10;
    let (mass, arm) = (0.5, 0.5);
    for (place, value) in [(0, mass), (1, mass * arm), (7, mass * arm * arm), (9, mass * arm * arm)] {
        bodies[tip + place] += value;
    }
    let carrying = robot.base().values(&bodies);
    let mut loaded = truth.clone();
    for ((loaded, with), without) in loaded.iter_mut().zip(&carrying).zip(robot.nominal_base().unwrap()) {
        *loaded += with - without;
    }
    work.work(&loaded);
    assert!(monitor.check(&work.estimator).unwrap().unwrap().is_raised());
}

#[test]
fn invalid_input_is_refused() {
    let (_, reference) = reference(1);
    assert!(DriftSettings::new(0.0).validate().is_err());
    assert!(DriftSettings { false_alarms_per_hour: 40.0, ..DriftSettings::new(60.0) }.validate().is_err());
    let small = StartingPoint { values: vec![0.0; 2], covariance: DMatrix::identity(2, 2) };
    let mut monitor = DriftMonitor::new(DriftSettings::new(60.0), small).unwrap();
    assert!(matches!(monitor.learn(&AtWork::new(1).estimator), Err(OnlineError::Length { .. })));
    let short = StartingPoint { covariance: DMatrix::identity(2, 2), ..reference.clone() };
    assert!(matches!(DriftMonitor::new(DriftSettings::new(60.0), short), Err(OnlineError::Length { .. })));
    let mut monitor = DriftMonitor::new(DriftSettings::new(60.0), reference).unwrap();
    // The estimator has no samples yet.
    assert!(matches!(monitor.learn(&AtWork::new(1).estimator), Err(OnlineError::Number { .. })));
    assert!(monitor.threshold().is_none());
}
