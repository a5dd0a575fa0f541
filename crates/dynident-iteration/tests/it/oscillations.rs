//! Loops that are too fast: derived gains that tolerate light drives, runs that are stopped because a joint oscillates,
//! and torque chatter in a log.

use crate::simulated_arm::{Simulated, settings, task};
use dynident_dynamics::ParametricModel;
use dynident_excitation::Motion;
use dynident_iteration::robot::{ControlledRun, EnvelopeSettings, FunctionRobot};
use dynident_iteration::{
    DerivedControllers, GainSettings, Iteration, IterationStatus, OscillationSettings, Robot, RobotRun, RobotStatus,
    RunRequest, SimulatedRobot, derived_controllers, iterate, lowered_bandwidths,
};
use dynident_model::read_urdf;
use dynident_model::terms::{DriveInertia, TorqueTerm, Viscous};
use dynident_simulation::controllers::ControllerModel;
use dynident_simulation::{Integrator, Plant, Reference, SimulationError};
use std::collections::VecDeque;

const RATE_HZ: f64 = 500.0;
/// Simulation steps per sample, and in the delay of 5 ms.
const STEPS: usize = 4;
const LATE_STEPS: usize = 10;
const BANDWIDTH_HZ: f64 = 4.0;

/// An upper arm with a gripper. The robot description states 30 Nm, ten times as much as the light joint needs.
fn arm() -> ParametricModel {
    let joint = |name: &str, parent: &str, child: &str, x: f64, effort: f64| {
        format!(
            r#"<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
            <origin xyz="{x} 0 0"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="{effort}" velocity="3.2"/></joint>"#
        )
    };
    let link = |name: &str, x: f64, mass: f64, inertia: f64| {
        format!(
            r#"<link name="{name}"><inertial><origin xyz="{x} 0 0"/><mass value="{mass}"/>
            <inertia ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/></inertial></link>"#
        )
    };
    let text = format!(
        r#"<robot name="arm"><link name="base"/>{}{}{}{}</robot>"#,
        link("upper", 0.5, 2.0, 0.05),
        link("fingers", 0.02, 0.05, 1e-4),
        joint("shoulder", "base", "upper", 0.0, 60.0),
        joint("gripper", "upper", "fingers", 1.2, 30.0)
    );
    let terms = (0..2)
        .flat_map(|joint| [TorqueTerm::DriveInertia(DriveInertia { joint }), TorqueTerm::Viscous(Viscous { joint })]);
    ParametricModel::new(read_urdf(&text).unwrap().model, terms.collect()).unwrap()
}

fn reference() -> Reference {
    let samples = 4001;
    let mut motion = Motion::default();
    motion.reset(2, samples);
    let omega = core::f64::consts::TAU / 4.0;
    for at in 0..2 * samples {
        let phase = omega * (at % samples) as f64 / RATE_HZ;
        motion.q[at] = 0.4 * (1.0 - phase.cos());
        motion.dq[at] = 0.4 * omega * phase.sin();
        motion.ddq[at] = 0.4 * omega * omega * phase.cos();
    }
    Reference::new(RATE_HZ, motion).unwrap()
}

fn derived(lightest_drive: f64) -> DerivedControllers {
    // No delay is stated, because the robot waits for every torque.
    let gains = GainSettings {
        bandwidth_hz: BANDWIDTH_HZ.into(),
        uncertainty_percent: 30.0,
        delay_s: 0.0,
        lightest_drive,
        light_delay_s: 0.008,
        tracking_error: None,
    };
    derived_controllers(&arm(), &[&reference()], &gains).unwrap()
}

/// The first run of these gains on the arm, whose drives have 0.2 and 0.01 kg m² and a delay of 5 ms; and how it ended.
fn first_run(gains: &DerivedControllers, is_watched: bool) -> (RobotRun, String) {
    let (robot, reference) = (arm(), reference());
    let model = robot.model();
    let names = robot.joint_names();
    let mut plant = Plant::new(model, robot.terms(), &[0.2, 0.2, 0.01, 0.05]).unwrap();
    let mut function = FunctionRobot::new(names, |mut run: ControlledRun| {
        let motion = run.reference().motion();
        plant.set_state(0.0, &[motion.q[0], motion.q[motion.samples]], &[0.0, 0.0]);
        let mut late: VecDeque<Vec<f64>> = vec![vec![0.0, 0.0]; LATE_STEPS].into();
        let mut sample = 0.0;
        while let Some(tau) = run.torque(sample / RATE_HZ, plant.q(), plant.dq()) {
            let tau = tau.to_vec();
            for _ in 0..STEPS {
                late.push_back(tau.clone());
                let now = late.pop_front().unwrap();
                plant.advance(&now, 1.0 / (RATE_HZ * STEPS as f64), Integrator::default()).unwrap();
            }
            sample += 1.0;
        }
        (run, Ok(()))
    });
    let first_model = gains.first_model.as_ref().unwrap();
    let known = ControllerModel::from_parameters(model, robot.terms(), first_model).unwrap();
    let envelope = EnvelopeSettings::default().envelope(model).unwrap();
    let oscillation = OscillationSettings::default();
    let request = RunRequest {
        model: Some(&known),
        envelope: Some(&envelope),
        oscillation: oscillation.limits(model).filter(|_| is_watched),
        ..RunRequest::new(1, &reference, &gains.first)
    };
    let run = function.run(&request).unwrap();
    let ending = run.ending(&reference, oscillation.lowest_hz(model));
    (run, ending)
}

/// A gripper with a tenth of the typical drive inertia, with 4 Hz gains and 5 ms of delay: the run is stopped for an
/// oscillation, and the verdict names joint, frequency and the key to change, also if a velocity limit ends the run
/// first.
#[test]
fn a_light_joint_that_oscillates_is_named() {
    let gains = derived(1.0);
    for is_watched in [true, false] {
        let (run, words) = first_run(&gains, is_watched);
        assert!(!run.status.is_done(), "{words}");
        let own = words.split("joint gripper oscillates at ").nth(1).unwrap_or_else(|| panic!("{words}"));
        let hertz: f64 = own.split(' ').next().unwrap().parse().unwrap();
        assert!((30.0..70.0).contains(&hertz) && words.contains("bandwidth_hz"), "{words}");
        assert!(run.record.times_s.last().is_some_and(|end_s| *end_s < 2.0), "{words}");
    }
    let (watched, words) = first_run(&gains, true);
    assert!(matches!(watched.status, RobotStatus::Oscillated { .. } | RobotStatus::LeftEnvelope { .. }), "{words}");
}

/// The same arm with the default settings: the gains are stable with a tenth of the typical inertia. The heavy joint
/// keeps its bandwidth.
#[test]
fn derived_gains_bear_a_light_joint() {
    let gains = derived(0.1);
    let names = arm().joint_names();
    let lowered = lowered_bandwidths("nominal", &gains.first_hz, &names, &BANDWIDTH_HZ.into());
    assert!(lowered.len() == 1 && lowered[0].joint == "gripper" && lowered[0].hz > 1.0, "{lowered:?}");
    let (run, words) = first_run(&gains, true);
    assert!(run.status.is_done(), "{words}");
    let errors = run.max_error(&reference());
    assert!(errors.iter().all(|error| *error < 0.1), "{errors:?}");
}

/// The simulated arm, whose second drive switches between ±16 Nm in a fifth of the samples.
#[derive(Debug)]
struct Chattering(SimulatedRobot);

impl Robot for Chattering {
    fn run(&mut self, request: &RunRequest<'_>) -> Result<RobotRun, SimulationError> {
        let mut run = self.0.run(request)?;
        let of = run.record.of(1);
        let samples = run.record.samples;
        for (k, tau) in run.record.tau[of].iter_mut().enumerate().skip(samples / 2).take(samples / 5) {
            // 50 Hz at 500 Hz.
            *tau += if k % 10 < 5 { 16.0 } else { -16.0 };
        }
        Ok(run)
    }
}

/// The chatter is far above the cut-off of the fit, so the iteration converges as before; but the chatter is reported.
#[test]
fn torque_that_chatters_is_reported() {
    let mut robot = Chattering(Simulated::default().robot());
    let iteration = Iteration::new(task(), settings()).unwrap();
    let outcome = iterate(&iteration, &mut [&mut robot], None, &mut |_, _| {}).unwrap();
    assert_eq!(outcome.status, IterationStatus::Converged, "{:?}", outcome.shortfalls);
    for run in &outcome.runs {
        let joints = &run.evidence.as_ref().unwrap().joints;
        assert_eq!(joints[0].oscillation, None);
        let found = joints[1].oscillation.unwrap_or_else(|| panic!("run {}", run.run));
        assert!((found.frequency_hz - 50.0).abs() < 1.0 && (found.share - 0.2).abs() < 0.02, "{found:?}");
        assert!((found.amplitude - 16.0).abs() < 3.0, "{found:?}");
    }
    // It is not included in the noise of the log, 0.055 Nm.
    let first = &outcome.runs[0].evidence.as_ref().unwrap().joints[1];
    assert!(first.torque_noise < 0.083, "{first:?}");
}
