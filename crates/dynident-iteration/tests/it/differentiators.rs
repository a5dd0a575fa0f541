//! Selection of the differentiator from a run's rows.

use crate::simulated_arm::{Simulated, described, iterated, settings, strokes_in_turn};
use dynident_dynamics::{Workspace, inverse_dynamics};
use dynident_iteration::{DifferentiatorChoice, IterationTask, RunIdentificationSettings, identify_run};
use dynident_model::sample::Random;
use dynident_simulation::Record;

fn choosing() -> RunIdentificationSettings {
    RunIdentificationSettings { choose_differentiator: true, ..settings().identification }
}

/// A record of an arm without friction that follows its strokes exactly with a lag of 20 ms, with position noise.
fn late_record(noise_rad: f64) -> (IterationTask, Record) {
    let robot = dynident_dynamics::ParametricModel::new(described().model().clone(), Vec::new()).unwrap();
    let reference = strokes_in_turn();
    let (motion, rate_hz) = (reference.motion().clone(), reference.rate_hz());
    let (samples, late) = (motion.samples, 10);
    let mut workspace = Workspace::new(robot.model());
    let mut random = Random::new(3);
    let (mut q, mut tau) = (vec![0.0; 2 * samples], vec![0.0; 2 * samples]);
    for sample in 0..samples {
        let at = |values: &[f64]| [0, 1].map(|joint| values[motion.of(joint)][sample.saturating_sub(late)]);
        let torque = inverse_dynamics(robot.model(), &mut workspace, &at(&motion.q), &at(&motion.dq), &at(&motion.ddq));
        for joint in 0..2 {
            q[joint * samples + sample] = at(&motion.q)[joint] + noise_rad * random.normal();
            tau[joint * samples + sample] = torque[joint] + 0.01 * random.normal();
        }
    }
    let record = Record {
        joints: robot.joint_names(),
        rate_hz,
        samples,
        times_s: (0..samples).map(|sample| sample as f64 / rate_hz).collect(),
        q,
        tau,
    };
    (IterationTask::new(robot, reference).unwrap(), record)
}

fn ratio(choice: &DifferentiatorChoice, name: &str) -> f64 {
    choice.candidates.iter().find(|candidate| candidate.name == name).unwrap().residual_ratio.unwrap()
}

/// With a pure delay and a coarse encoder, differentiators that know the stroke are better than any filter: the time
/// warp first, then the paper's map, which transmits the noise.
#[test]
fn a_pure_delay_and_a_coarse_encoder_ask_for_a_way_that_knows_the_stroke() {
    let (task, record) = late_record(3e-3);
    // The torque belongs to the sample; it is not held here.
    let settings = RunIdentificationSettings { held_torque: false, ..choosing() };
    let found = identify_run(&task, std::slice::from_ref(&record), &settings).unwrap();
    let choice = found.differentiator.unwrap();
    assert_eq!(choice.name, "time-warp", "{}", choice.sentence());
    assert!(ratio(&choice, "position-map") > 1.0 && ratio(&choice, "butterworth") > 1.0, "{}", choice.sentence());
}

/// For tracking errors that are not a pure delay, the smoothed deviation is selected instead of the map.
#[test]
fn a_closed_loop_asks_for_the_smoothed_deviation() {
    let mut settings = settings();
    settings.identification.choose_differentiator = true;
    let (_, outcome) = iterated(&Simulated::default(), settings);
    for run in &outcome.runs {
        let choice = run.estimate.as_ref().unwrap().differentiator.as_ref().unwrap();
        assert_eq!(choice.name, "deviation", "{}", choice.sentence());
        let map = choice.candidates.iter().find(|candidate| candidate.name == "position-map").unwrap();
        assert!(map.problem.is_some() || map.residual_ratio.unwrap() > 1.0, "{}", choice.sentence());
    }
    assert!(outcome.status.is_converged());
}
