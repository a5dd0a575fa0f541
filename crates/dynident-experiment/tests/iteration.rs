//! The paper's planar arm through the whole iteration.

#![allow(clippy::unwrap_used)]

use dynident_excitation::families::{SplicedLogisticSettings, Step, StepWiseLogistic};
use dynident_experiment::controllers::{FiniteTimeSettings, JointPdSettings};
use dynident_experiment::iteration::*;
use dynident_experiment::*;
use dynident_model::sample::planar_2r;
use dynident_model::{InertialParameters, Model};

/// The paper's arm: point masses of 1 kg at the ends of links of 1 m; θ = [2, 2, 0, 1, 1, 0].
fn paper_arm() -> Model {
    let tip = InertialParameters([1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0]);
    planar_2r(1.0, tip, tip)
}

/// Base parameters of the arm in the order of the base columns: m r_x, m r_y and I_zz of each link with what is carried.
const TRUTH: [f64; 6] = [2.0, 0.0, 2.0, 1.0, 0.0, 1.0];

/// The best single stroke inside the paper's limits (18): reading-notes 4.
const STROKE: [f64; 2] = [1.991, 1.046];
const DELTA_S: f64 = 5.74;

fn reference(order: &[usize], rate_hz: f64) -> (Reference, Vec<Vec<[f64; 2]>>) {
    let period_s = 40.0 / STROKE[1];
    let steps: Vec<Step> = order.iter().map(|&joint| Step { joint, period_s }).collect();
    let family = StepWiseLogistic::new(&[0.0; 2], &steps, &SplicedLogisticSettings::default()).unwrap();
    let parameters: Vec<f64> = order.iter().flat_map(|_| STROKE).collect();
    let mut windows = vec![Vec::new(); 2];
    for (place, &joint) in order.iter().enumerate() {
        for middle in [0.25, 0.75] {
            let centre = (place as f64 + middle) * period_s;
            windows[joint].push([centre - DELTA_S, centre + DELTA_S]);
        }
    }
    (Reference::of_family(&family, &parameters, rate_hz, None).unwrap(), windows)
}

fn robot(settings: LoopSettings) -> SimulatedRobot {
    SimulatedRobot::new(Plant::new(&paper_arm(), &[], &[]).unwrap(), settings).unwrap()
}

fn exact() -> LoopSettings {
    LoopSettings { integrator: Integrator::Rk4 { steps_per_sample: 1 }, ..LoopSettings::default() }
}

/// No prior: the description's inertials are unknown to the iteration.
fn machine() -> IteratedMachine {
    IteratedMachine::new(&paper_arm(), &[], Some(vec![0.0; 20])).unwrap()
}

fn worst(values: &[f64]) -> f64 {
    values.iter().zip(TRUTH).fold(0.0, |most, (value, truth)| most.max((value - truth).abs()))
}

#[test]
fn probe() {
    for scheme in [Scheme::AllJoints, Scheme::StepByStep] {
        let (reference, windows) = reference(&[1, 0], 1000.0);
        let task =
            IterationTask { machine: machine(), legs: vec![Leg::windowed(reference, windows).unwrap()], known: vec![] };
        let mut settings = IterationSettings {
            model_free: ControllerSettings::JointPd(JointPdSettings {
                kp: vec![100.0, 16.0].into(),
                kd: vec![60.0, 8.0].into(),
            }),
            controller: ControllerSettings::FiniteTime(FiniteTimeSettings::with_gains(vec![2.0, 4.0], vec![20.0, 4.0])),
            max_runs: 6,
            ..IterationSettings::default()
        };
        settings.identification.scheme = scheme;
        settings.settled.parameter_tolerance = 0.0;
        settings.settled.parameter_sigmas = 0.0;
        let iteration = Iteration::new(task, settings).unwrap();
        let mut robot = robot(exact());
        let start = std::time::Instant::now();
        let outcome = iterate(&iteration, &mut [&mut robot], None, &mut |record, _| {
            println!(
                "{} {:?} acc {} {:?} err {:?} worst {:.2e} {:?}",
                record.run,
                record.controller.name,
                record.accepted,
                record.reason,
                record.max_tracking_error_rad,
                record.estimate.as_ref().map_or(9.0, |e| worst(&e.values)),
                record.estimate.as_ref().map(|e| (&e.std, &e.fixed, &e.impossible))
            );
        })
        .unwrap();
        println!("{:?} {:?}", outcome.status, start.elapsed());
    }
}
