//! The closed loop: limits, status, sensors.

use dynident_excitation::Motion;
use dynident_model::sample::planar_2r;
use dynident_model::{InertialParameters, Mat3, Vec3};
use dynident_simulation::controllers::{JointPd, JointPdSettings, Measured, Target};
use dynident_simulation::{
    Controller, Divergence, Integrator, LimitedQuantity, LoopSettings, Plant, Reference, Run, RunLimits, RunStatus,
    SensorSettings, Start, VelocitySource, closed_loop,
};

fn plant() -> Plant {
    let point = InertialParameters::from_centre_of_mass(1.0, Vec3([1.0, 0.0, 0.0]), &Mat3::ZERO);
    Plant::new(&planar_2r(1.0, point, point), &[], &[]).unwrap()
}

fn pd(kp: f64, kd: f64) -> JointPd {
    JointPd::new(2, &JointPdSettings { kp: kp.into(), kd: kd.into() }).unwrap()
}

fn run(settings: &LoopSettings) -> Run {
    let reference = Reference::standing(&[-1.2, 0.3], 1000.0, 2.0).unwrap();
    closed_loop(&mut plant(), &mut pd(500.0, 100.0), &reference, settings).unwrap()
}

#[test]
fn torques_are_cut_and_counted() {
    let limits = RunLimits { torque: Some(vec![3.0, 1e9].into()), ..RunLimits::default() };
    let own = run(&LoopSettings { limits, ..LoopSettings::default() });
    // The weight of the arm requires more than 3 Nm at most samples.
    assert!(own.saturated[0] > 500 && own.saturated[1] == 0);
    assert!(own.tau[own.of(0)].iter().all(|tau| tau.abs() <= 3.0));
}

#[test]
fn broken_limits_stop_the_run() {
    let cases: [(RunLimits, LimitedQuantity); 4] = [
        (RunLimits { lower: Some(vec![-1.21, -9.0].into()), ..RunLimits::default() }, LimitedQuantity::Position),
        (RunLimits { upper: Some(vec![-1.3, 9.0].into()), ..RunLimits::default() }, LimitedQuantity::Position),
        (RunLimits { speed: Some(0.01.into()), ..RunLimits::default() }, LimitedQuantity::Speed),
        (RunLimits { tracking_error: Some(0.002.into()), ..RunLimits::default() }, LimitedQuantity::TrackingError),
    ];
    let whole = run(&LoopSettings::default());
    for (limits, expected) in cases {
        let own = run(&LoopSettings { limits, ..LoopSettings::default() });
        let RunStatus::LimitBroken { quantity, time_s, ref joint, .. } = own.status else { panic!("{}", own.status) };
        assert_eq!((quantity, joint.as_str()), (expected, "joint1"));
        assert_eq!(own.samples, (time_s * 1000.0).round() as usize);
        assert_eq!(own.reference.samples, own.samples);
        for joint in 0..2 {
            assert_eq!(own.q[own.of(joint)], whole.q[whole.of(joint)][..own.samples]);
            assert_eq!(own.tau[own.of(joint)], whole.tau[whole.of(joint)][..own.samples]);
        }
        assert!(own.status.to_string().contains("joint1"));
    }
}

/// Gains far too high for the rate: divergence is reported, and all numbers are finite.
#[test]
fn divergence_is_reported() {
    let reference = Reference::standing(&[-1.2, 0.3], 100.0, 5.0).unwrap();
    for integrator in [
        Integrator::SemiImplicitEuler { steps_per_sample: 1 },
        Integrator::Rk4 { steps_per_sample: 1 },
        Integrator::Adaptive { relative_tolerance: 1e-8, absolute_tolerance: 1e-8 },
    ] {
        let settings = LoopSettings { integrator, ..LoopSettings::default() };
        let own = closed_loop(&mut plant(), &mut pd(1e6, 1e6), &reference, &settings).unwrap();
        assert!(matches!(own.status, RunStatus::Diverged { .. }), "{}", own.status);
        assert!(own.samples < 501);
        let numbers = [&own.q, &own.dq, &own.tau, &own.max_error, &own.rms_error];
        assert!(numbers.into_iter().flatten().all(|x| x.is_finite()));
    }
}

#[derive(Debug)]
struct Broken;

impl Controller for Broken {
    fn name(&self) -> &'static str {
        "broken"
    }
    fn joints(&self) -> usize {
        2
    }
    fn reset(&mut self) {}
    fn torque(&mut self, time_s: f64, _: Target<'_>, _: Measured<'_>, tau: &mut [f64]) {
        tau.fill(if time_s > 0.5 { f64::NAN } else { 0.0 });
    }
}

#[test]
fn a_nan_torque_is_reported() {
    let reference = Reference::standing(&[-1.2, 0.3], 1000.0, 1.0).unwrap();
    let own = closed_loop(&mut plant(), &mut Broken, &reference, &LoopSettings::default()).unwrap();
    assert!(matches!(own.status, RunStatus::Diverged { reason: Divergence::Torque { joint: 0 }, .. }));
    assert_eq!(own.samples, 501);
}

#[test]
fn accelerations_are_those_of_the_motion() {
    let settings = LoopSettings {
        integrator: Integrator::Rk4 { steps_per_sample: 1 },
        start: Start::At { q: vec![-1.0, 0.0], dq: vec![0.2, 0.0] },
        accelerations: true,
        ..LoopSettings::default()
    };
    let own = run(&settings);
    for joint in 0..2 {
        let (dq, ddq) = (&own.dq[own.of(joint)], &own.ddq[own.of(joint)]);
        // The mean acceleration of the interval differs from that at its start by half a step of the jerk, which is
        // below 500 · 100 rad/s³ at the start and decays.
        let worst = (1000..1999).map(|k| ((dq[k + 1] - dq[k]) * 1000.0 - ddq[k]).abs()).fold(0.0, f64::max);
        assert!(worst < 0.05, "{worst}");
    }
}

fn sine_run(sensors: SensorSettings) -> (Plant, Run, SensorSettings) {
    let samples = 10_001;
    let mut motion = Motion::default();
    motion.reset(2, samples);
    for sample in 0..samples {
        let (sine, cosine) = (2.0 * sample as f64 / 1000.0).sin_cos();
        motion.q[sample] = -1.5 + 0.5 * sine;
        motion.dq[sample] = cosine;
        motion.ddq[sample] = -2.0 * sine;
    }
    let reference = Reference::new(1000.0, motion).unwrap();
    let settings = LoopSettings {
        integrator: Integrator::Rk4 { steps_per_sample: 1 },
        sensors: sensors.clone(),
        ..LoopSettings::default()
    };
    let mut plant = plant();
    let run = closed_loop(&mut plant, &mut pd(500.0, 100.0), &reference, &settings).unwrap();
    assert!(run.status.is_done());
    (plant, run, sensors)
}

#[test]
fn perfect_sensors_record_the_truth() {
    let (plant, run, sensors) = sine_run(SensorSettings::default());
    let record = sensors.record(plant.model(), &run).unwrap();
    assert_eq!((&record.q, &record.tau, record.samples), (&run.q, &run.tau, run.samples));
    // Between samples the cubic has an error of h⁴/384 of a fourth derivative of some 1e3: below 1e-11.
    let twice = SensorSettings { record_rate_hz: Some(2000.0), ..sensors };
    let fine = twice.record(plant.model(), &run).unwrap();
    assert_eq!(fine.samples, 20_001);
    for joint in 0..2 {
        let (fine, own) = (&fine.q[fine.of(joint)], &run.q[run.of(joint)]);
        for k in 100..9900 {
            assert!((fine[2 * k] - own[k]).abs() < 1e-14);
            let middle = (9.0 * (own[k] + own[k + 1]) - own[k - 1] - own[k + 2]) / 16.0;
            assert!((fine[2 * k + 1] - middle).abs() < 1e-9);
        }
    }
    let csv = record.csv();
    assert!(csv.starts_with("t_s,q1,q2,tau1,tau2\n0,") && csv.lines().count() == 10_002);
}

/// Settings can have any size, but the numbers of a record are finite.
#[test]
fn a_record_that_would_not_be_finite_is_refused() {
    for (position_std, torque_std, torque_step) in [(0.0, 1e308, None), (1e308, 0.0, None), (0.0, 0.0, Some(1e-320))] {
        let sensors = SensorSettings {
            position_std: position_std.into(),
            torque_std: torque_std.into(),
            torque_step: torque_step.map(Into::into),
            // Instants that differ from the controller's, whose readings have no noise here.
            record_rate_hz: Some(2000.0),
            ..SensorSettings::default()
        };
        let (plant, run, _) = sine_run(SensorSettings::default());
        let error = sensors.record(plant.model(), &run).unwrap_err().to_string();
        assert!(error.contains("sizes that a sensor can have"), "{error}");
    }
}

#[test]
fn encoders_quantise_and_noise_has_its_size() {
    let sensors = SensorSettings {
        encoder_steps: Some(4096.0.into()),
        position_std: 1e-3.into(),
        torque_std: 0.2.into(),
        torque_correlation: 0.9,
        torque_step: Some(1e-3.into()),
        seed: 5,
        ..SensorSettings::default()
    };
    let (plant, run, sensors) = sine_run(sensors);
    let record = sensors.record(plant.model(), &run).unwrap();
    assert_eq!(record, sensors.record(plant.model(), &run).unwrap());
    assert_eq!(record.q, run.measured_q);
    let step = core::f64::consts::TAU / 4096.0;
    assert!(record.q.iter().all(|q| (q / step - (q / step).round()).abs() < 1e-6));
    assert!(record.tau.iter().all(|tau| (tau / 1e-3 - (tau / 1e-3).round()).abs() < 1e-6));
    let std =
        |a: &[f64], b: &[f64]| (a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / a.len() as f64).sqrt();
    // White noise and a uniform error of a step: σ² + Δ²/12, within five standard errors of 20,000 samples.
    let expected = (1e-6 + step * step / 12.0).sqrt();
    assert!((std(&record.q, &run.q) / expected - 1.0).abs() < 0.03);
    // Correlation reduces the number of independent samples: 20,000 · (1 - ρ²)/(1 + ρ²) = 2,100.
    assert!((std(&record.tau, &run.tau) / 0.2 - 1.0).abs() < 0.08);
    let error: Vec<f64> = record.tau.iter().zip(&run.tau).map(|(a, b)| a - b).collect();
    let product: f64 = error[..10_000].windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / 9_999.0;
    assert!((product / 0.04 - 0.9).abs() < 0.12);
    let other = SensorSettings { seed: 6, ..sensors };
    assert_ne!(other.record(plant.model(), &run).unwrap().tau, record.tau);
}

/// Delays shift channels, drift stretches time, and jitter adds noise proportional to the velocity.
#[test]
fn channels_come_late_and_clocks_drift() {
    let (plant, run, _) = sine_run(SensorSettings::default());
    let record = |sensors: SensorSettings| sensors.record(plant.model(), &run).unwrap();
    let late = record(SensorSettings {
        position_delay_s: 0.008.into(),
        torque_delay_s: 0.020.into(),
        ..SensorSettings::default()
    });
    for k in 100..10_000 {
        assert!((late.q[k] - run.q[k - 8]).abs() < 1e-12);
        assert_eq!(late.tau[k], run.tau[k - 20]);
    }
    let slow = record(SensorSettings { clock_drift_ppm: 1000.0, ..SensorSettings::default() });
    assert_eq!(slow.samples, 9991);
    assert_eq!(slow.times_s[9000], 9.0);
    assert!((slow.q[9000] - run.q[9009]).abs() < 1e-12);
    let shaken = record(SensorSettings { jitter_std_s: 1e-3, ..SensorSettings::default() });
    let rms = |values: &mut dyn Iterator<Item = f64>| {
        let (sum, count) = values.fold((0.0, 0.0), |(sum, count), x| (sum + x * x, count + 1.0));
        f64::sqrt(sum / count)
    };
    let error = rms(&mut (0..10_001).map(|k| shaken.q[k] - run.q[k]));
    let speed = rms(&mut run.dq[run.of(0)].iter().copied());
    assert!((error / (1e-3 * speed) - 1.0).abs() < 0.05, "{error} {speed}");
}

/// Velocities from differences lag by half a sample and the filter's `1/(2πf)`; delayed feedback makes the loop softer.
#[test]
fn feedback_by_encoders_and_late() {
    let (_, own, _) = sine_run(SensorSettings {
        speed: VelocitySource::Differences { cutoff_hz: 50.0 },
        ..SensorSettings::default()
    });
    let lag_s = 0.5e-3 + 1.0 / (core::f64::consts::TAU * 50.0);
    let own_range = own.of(0);
    let (seen, truth) = (&own.measured_dq[own_range.clone()], &own.dq[own_range]);
    let late = (lag_s * 1000.0).floor() as usize;
    let share = lag_s * 1000.0 - late as f64;
    for k in 2000..10_000 {
        let expected = (1.0 - share) * truth[k - late] + share * truth[k - late - 1];
        // The lag of the exact exponential differs from 1/(2πf) by up to half a sample: 1e-3 s of 2 rad/s².
        assert!((seen[k] - expected).abs() < 2e-3, "{k} {} {expected}", seen[k]);
    }
    let (_, delayed, _) = sine_run(SensorSettings { feedback_delay_samples: 3, ..SensorSettings::default() });
    let range = delayed.of(0);
    let (seen, truth) = (&delayed.measured_q[range.clone()], &delayed.q[range]);
    assert_eq!(seen[100..], truth[97..truth.len() - 3]);
    assert_eq!(seen[..4], [truth[0]; 4]);
}

/// Settings are unchanged by TOML and JSON, also those of a robot description with and without limits.
#[test]
fn settings_can_be_stored() {
    let ur10 = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/ur10.urdf");
    let models = [dynident_model::load_robot(ur10).unwrap().model, plant().model().clone()];
    for model in models {
        let settings = LoopSettings {
            limits: RunLimits::of_model(&model),
            integrator: Integrator::Adaptive { relative_tolerance: 1e-9, absolute_tolerance: 1e-8 },
            sensors: SensorSettings::birdy_standard(4),
            start: Start::At { q: vec![0.1], dq: vec![0.2] },
            accelerations: true,
        };
        let json = serde_json::to_string(&settings).unwrap();
        assert_eq!(serde_json::from_str::<LoopSettings>(&json).unwrap(), settings);
        let text = toml::to_string(&settings).unwrap();
        assert_eq!(toml::from_str::<LoopSettings>(&text).unwrap(), settings);
        settings.validate(model.dof()).unwrap();
    }
}

#[test]
fn bad_settings_are_named() {
    let bad = [
        SensorSettings { position_std: f64::NAN.into(), ..SensorSettings::default() },
        SensorSettings { encoder_steps: Some(0.0.into()), ..SensorSettings::default() },
        SensorSettings { torque_correlation: 1.0, ..SensorSettings::default() },
        SensorSettings { torque_delay_s: vec![0.0].into(), ..SensorSettings::default() },
        SensorSettings { record_rate_hz: Some(-1.0), ..SensorSettings::default() },
        SensorSettings { feedback_delay_samples: 100_000, ..SensorSettings::default() },
        SensorSettings { speed: VelocitySource::Differences { cutoff_hz: 0.0 }, ..SensorSettings::default() },
    ];
    for sensors in bad {
        assert!(sensors.validate(2).is_err(), "{sensors:?}");
    }
    for text in ["[sensors]\ncolour = 1", "[integrator]\nkind = \"rk5\"", "speed = 1", "[limits]\ntorqe = 1.0"] {
        assert!(toml::from_str::<LoopSettings>(text).is_err(), "{text}");
    }
    let zero = LoopSettings { integrator: Integrator::Rk4 { steps_per_sample: 0 }, ..LoopSettings::default() };
    assert!(zero.validate(2).is_err());
    let limits = RunLimits { torque: Some(0.0.into()), ..RunLimits::default() };
    assert!(LoopSettings { limits, ..LoopSettings::default() }.validate(2).is_err());
    assert!(Reference::standing(&[f64::NAN], 100.0, 1.0).is_err());
    assert!(Reference::standing(&[0.0], 0.0, 1.0).is_err());
    let other = Reference::standing(&[0.0; 3], 100.0, 1.0).unwrap();
    assert!(closed_loop(&mut plant(), &mut pd(1.0, 1.0), &other, &LoopSettings::default()).is_err());
    let start = Start::At { q: vec![0.0; 2], dq: vec![f64::INFINITY; 2] };
    let reference = Reference::standing(&[0.0; 2], 100.0, 1.0).unwrap();
    let settings = LoopSettings { start, ..LoopSettings::default() };
    assert!(closed_loop(&mut plant(), &mut pd(1.0, 1.0), &reference, &settings).is_err());
}
