//! Comparison of logged and commanded torque: every mistake of a log is reported, no correct log is, and no iteration
//! converges with a wrong log.

use super::simulated_arm::{self, Simulated, arm};
use dynident_dynamics::{Workspace, gravity_torque};
use dynident_iteration::{
    Iteration, IterationOutcome, IterationSettings, Next, Robot, RobotRun, RunRequest, SimulatedRobot, TorqueCause,
    UnmetCondition, iterate,
};
use dynident_simulation::controllers::PositionLoopSettings;
use dynident_simulation::{ControllerSettings, Record, SensorSettings, SimulationError};

struct Faulty<'a> {
    inner: SimulatedRobot,
    fault: &'a dyn Fn(&mut Record),
}

impl core::fmt::Debug for Faulty<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        self.inner.fmt(f)
    }
}

impl Robot for Faulty<'_> {
    fn run(&mut self, request: &RunRequest<'_>) -> Result<RobotRun, SimulationError> {
        let mut run = self.inner.run(request)?;
        (self.fault)(&mut run.record);
        // An external robot does not provide the true motion.
        Ok(RobotRun { truth: None, ..run })
    }
}

fn iterated(simulated: &Simulated, settings: IterationSettings, fault: &dyn Fn(&mut Record)) -> IterationOutcome {
    let iteration = Iteration::new(simulated_arm::task(), settings).unwrap();
    let mut robot = Faulty { inner: simulated.robot(), fault };
    iterate(&iteration, &mut [&mut robot], None, &mut |_, _| {}).unwrap()
}

fn scaled(record: &mut Record, factors: [f64; 2]) {
    for (joint, factor) in factors.into_iter().enumerate() {
        let own = record.of(joint);
        record.tau[own].iter_mut().for_each(|tau| *tau *= factor);
    }
}

fn without_gravity(record: &mut Record) {
    let model = arm(1.0, Simulated::default().tip_kg);
    let mut workspace = Workspace::new(&model);
    for sample in 0..record.samples {
        let q: Vec<f64> = (0..2).map(|joint| record.q[record.of(joint)][sample]).collect();
        let gravity = gravity_torque(&model, &mut workspace, &q).to_vec();
        for (joint, gravity) in gravity.into_iter().enumerate() {
            let place = record.of(joint).start + sample;
            record.tau[place] -= gravity;
        }
    }
}

fn without_friction(record: &mut Record) {
    let times = record.times_s.clone();
    for (joint, (viscous, dry)) in [(0.8, 1.5), (0.5, 1.0)].into_iter().enumerate() {
        let own = record.of(joint);
        let q = record.q[own.clone()].to_vec();
        for sample in 0..record.samples {
            let (before, after) = (sample.saturating_sub(10), (sample + 10).min(record.samples - 1));
            let speed = (q[after] - q[before]) / (times[after] - times[before]);
            record.tau[own.start + sample] -= viscous * speed + dry * (speed / 0.1).tanh();
        }
    }
}

fn exchanged(record: &mut Record) {
    let samples = record.samples;
    let (first, second) = record.tau.split_at_mut(samples);
    first.swap_with_slice(second);
}

fn cut(record: &mut Record) {
    let own = record.of(0);
    let most = record.tau[own.clone()].iter().fold(0.0_f64, |most, tau| most.max(tau.abs()));
    record.tau[own].iter_mut().for_each(|tau| *tau = tau.clamp(-0.8 * most, 0.8 * most));
}

fn causes(outcome: &IterationOutcome) -> Vec<TorqueCause> {
    let of =
        |unmet: &UnmetCondition| if let UnmetCondition::Torque(cause) = unmet { Some(cause.clone()) } else { None };
    outcome.shortfalls.iter().filter_map(of).collect()
}

/// Correct logs with sensor noise, feedback delay, and a controller that differentiates its encoders: the check passes
/// in every run, and its scales are one within a percent.
#[test]
fn correct_logs_pass() {
    let noisy = Simulated::default().sensors;
    let late = SensorSettings { feedback_delay_samples: 2, ..noisy.clone() };
    for sensors in [noisy, late] {
        let simulated = Simulated { sensors, ..Simulated::default() };
        let outcome = iterated(&simulated, simulated_arm::settings(), &|_| {});
        assert!(outcome.status.is_converged(), "{:?}", outcome.shortfalls);
        for run in &outcome.runs {
            let check = run.torque_check.as_ref().unwrap();
            assert!(check.causes.is_empty(), "{check:?}");
            for joint in &check.joints {
                let (scale, std) = (joint.scale.unwrap(), joint.scale_std.unwrap());
                assert!((scale - 1.0).abs() < 0.01 && std < 0.01, "{scale} ± {std}");
                assert!(joint.difference_percent.unwrap() < 3.0, "{:?}", joint.difference_percent);
            }
        }
    }
}

/// Each mistake is reported after the first run, and the model of the wrong log never reaches a controller.
#[test]
fn a_wrong_torque_is_named_and_never_loaded() {
    let named = |fault: &dyn Fn(&mut Record)| -> Vec<TorqueCause> {
        let outcome = iterated(&Simulated::default(), simulated_arm::settings(), fault);
        assert!(
            !outcome.status.is_converged() && outcome.runs.len() == 1,
            "{}: {:?}",
            outcome.status,
            outcome.shortfalls
        );
        causes(&outcome)
    };
    let joint = |k: usize| format!("joint{k}");
    let both = || vec![joint(1), joint(2)];
    for factor in [0.85, 0.95, 1.06] {
        let [TorqueCause::Scale { joint: name, factor: found, half_width_95 }] =
            &named(&|log| scaled(log, [1.0, factor]))[..]
        else {
            panic!("{factor}")
        };
        assert!(*name == joint(2) && (found - factor).abs() < half_width_95.max(0.01), "{found} ± {half_width_95}");
        let [TorqueCause::CommonScale { factor: found }] = named(&|log| scaled(log, [factor; 2]))[..] else {
            panic!("{factor}")
        };
        assert!((found - factor).abs() < 0.01, "{found}");
    }
    assert_eq!(
        named(&|log| scaled(log, [-1.0, 1.0])),
        [TorqueCause::Sign { joints: vec![joint(1)], is_commanded: false }]
    );
    assert_eq!(named(&|log| scaled(log, [-1.0, -1.0])), [TorqueCause::Sign { joints: both(), is_commanded: false }]);
    assert_eq!(named(&without_gravity), [TorqueCause::Gravity { joints: both() }]);
    // With only gravity in the first controller it is less than a twentieth of the torque.
    let outcome = iterated(&Simulated::default(), simulated_arm::settings(), &without_friction);
    assert!(!outcome.status.is_converged() && outcome.runs.len() <= 2, "{}", outcome.status);
    assert_eq!(causes(&outcome), [TorqueCause::Friction { joints: both() }]);
    let exchange = |joint, of| TorqueCause::Exchanged { joint, of, is_commanded: false };
    assert_eq!(named(&exchanged), [exchange(joint(1), joint(2)), exchange(joint(2), joint(1))]);
    assert!(matches!(&named(&cut)[..], [TorqueCause::Clipped { joint: name, .. }] if *name == joint(1)));
    let drift = |log: &mut Record| log.times_s.iter_mut().for_each(|time| *time /= 1.003);
    assert!(matches!(named(&drift)[..], [TorqueCause::Clock { percent }] if (percent - 0.3).abs() < 0.05));
    let late = |log: &mut Record| {
        let samples = log.samples;
        for own in log.q.chunks_exact_mut(samples) {
            own.copy_within(..samples - 10, 10);
        }
    };
    assert!(matches!(named(&late)[..], [TorqueCause::Delay { lag_s }] if (lag_s + 0.02).abs() < 2e-3));
}

/// An unknown disturbance of the torque is reported without a cause.
#[test]
fn a_difference_without_a_known_cause_has_none() {
    let wave = |log: &mut Record| {
        let own = log.of(1);
        for (tau, time) in log.tau[own].iter_mut().zip(&log.times_s) {
            *tau += 3.0 * (2.0 * core::f64::consts::TAU * time).sin();
        }
    };
    let outcome = iterated(&Simulated::default(), simulated_arm::settings(), &wave);
    assert!(!outcome.status.is_converged());
    let found = causes(&outcome);
    assert!(matches!(&found[..], [TorqueCause::Undetermined { joint, .. }] if joint == "joint2"), "{found:?}");
}

/// Drives with their own loop and unknown gains: the feed-forward torque determines the scale.
#[test]
fn the_scale_of_drives_with_their_own_loop_is_found() {
    let mut settings = simulated_arm::settings();
    settings.first = None;
    let own = PositionLoopSettings {
        kp: Some(2000.0.into()),
        kd: Some(120.0.into()),
        ..PositionLoopSettings::of_robot(true)
    };
    settings.controller = ControllerSettings::PositionLoop(own);
    let outcome = iterated(&Simulated::default(), settings.clone(), &|_| {});
    assert!(causes(&outcome).is_empty(), "{:?}", outcome.shortfalls);
    let outcome = iterated(&Simulated::default(), settings, &|log| scaled(log, [1.0, 1.12]));
    assert!(!outcome.status.is_converged());
    let found = causes(&outcome);
    let [TorqueCause::Scale { joint, factor, .. }] = &found[..] else { panic!("{found:?}: {:?}", outcome.shortfalls) };
    assert!(joint == "joint2" && (factor - 1.12).abs() < 0.02, "{joint} {factor}");
}

#[test]
fn after_a_wrong_log_no_run_is_planned() {
    let iteration = Iteration::new(simulated_arm::task(), simulated_arm::settings()).unwrap();
    let mut robot = Faulty { inner: Simulated::default().robot(), fault: &|log| scaled(log, [1.0, 0.8]) };
    let outcome = iterate(&iteration, &mut [&mut robot], None, &mut |_, _| {}).unwrap();
    let Next::Finished(status) = iteration.next(&outcome.runs).unwrap() else { panic!("a run is planned") };
    assert!(status.to_string().contains("joint2") && status.to_string().contains("--fresh"), "{status}");
}
