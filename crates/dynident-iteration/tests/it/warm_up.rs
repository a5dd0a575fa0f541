use super::simulated_arm::{self, RATE_HZ, Simulated};
use dynident_iteration::{
    Iteration, IterationStatus, IterationStore, NextMotion, Robot, RobotRun, RobotStatus, RunPurpose, RunRequest,
    SimulatedRobot, Supervisor, iterate, iterate_supervised,
};
use dynident_simulation::{SensorSettings, SimulationError};

/// The arm with dry friction that decreases with every motion, like warming grease; records the commanded motions.
#[derive(Debug)]
struct Cold {
    coulomb: [f64; 2],
    commanded: Vec<(usize, RunPurpose, f64)>,
    stops_in: Option<usize>,
}

fn arm(coulomb: [f64; 2]) -> SimulatedRobot {
    Simulated { coulomb, sensors: SensorSettings::default(), ..Simulated::default() }.robot()
}

impl Cold {
    fn new() -> Self {
        Self { coulomb: [3.0, 2.0], commanded: Vec::new(), stops_in: None }
    }
}

impl Robot for Cold {
    fn run(&mut self, request: &RunRequest<'_>) -> Result<RobotRun, SimulationError> {
        self.commanded.push((request.run, request.purpose, request.speed));
        let mut run = arm(self.coulomb).run(request)?;
        // Half of the excess above the warm value disappears with every motion.
        for (value, warm) in self.coulomb.iter_mut().zip([1.5, 1.0]) {
            *value = 0.5 * (*value + warm);
        }
        if let RunPurpose::WarmUp { pass, .. } = request.purpose
            && self.stops_in == Some(pass)
        {
            run.status = RobotStatus::Stopped { reason: "protective stop".to_owned() };
        }
        Ok(run)
    }
}

fn iteration(warm_up_s: f64) -> Iteration {
    let mut settings = simulated_arm::settings();
    settings.safety.warm_up_s = warm_up_s;
    settings.safety.speed_steps = vec![0.5];
    settings.max_runs = 2;
    Iteration::new(simulated_arm::task(), settings).unwrap()
}

/// The motion lasts 20 s, so 50 s are three passes, after the slow run and before the first run, once per call. Power
/// loss and friction torque follow from the work of the torque along the motion.
#[test]
fn passes_come_before_the_first_run_of_a_call() {
    let folder = tempfile::tempdir().unwrap();
    let store = IterationStore::open(folder.path(), "test", true).unwrap();
    let mut cold = Cold::new();
    let outcome = iterate(&iteration(50.0), &mut [&mut cold], Some(&store), &mut |_, _| {}).unwrap();
    let pass = |pass| (1, RunPurpose::WarmUp { pass, of: 3 }, 1.0);
    let expected =
        [(1, RunPurpose::Run, 0.5), pass(1), pass(2), pass(3), (1, RunPurpose::Run, 1.0), (2, RunPurpose::Run, 1.0)];
    assert_eq!(cold.commanded, expected);
    assert!(outcome.runs[1].warm_up.is_none());
    let shown = outcome.runs[0].warm_up.as_ref().unwrap();
    let duration_s = simulated_arm::reference().duration_s();
    assert!(shown.passes == 3 && (shown.duration_s - 3.0 * duration_s).abs() < 1e-9);
    // Expected from dry and viscous friction with the velocities of the motion.
    let reference = simulated_arm::reference();
    let motion = reference.motion();
    let (mut way, mut square) = ([0.0; 2], [0.0; 2]);
    for joint in 0..2 {
        for dq in &motion.dq[motion.of(joint)] {
            way[joint] += (dq / 0.1_f64).tanh() * dq / RATE_HZ;
            square[joint] += dq * dq / RATE_HZ;
        }
    }
    let power =
        |coulomb: [f64; 2]| (0..2).map(|j| coulomb[j] * way[j] + [0.8, 0.5][j] * square[j]).sum::<f64>() / duration_s;
    // The slow run has halved the excess once.
    let [first, second, third] = [[2.25, 1.5], [1.875, 1.25], [1.6875, 1.125]].map(power);
    for (found, expected) in shown.lost_power_w.iter().zip([first, second, third]) {
        // The arm is some mrad and mrad/s off its path.
        assert!((found / expected - 1.0).abs() < 0.02, "{found} W, {expected} W");
    }
    let change = shown.change_percent().unwrap();
    assert!((change - 100.0 * (third / first - 1.0)).abs() < 1.0, "{change}");
    let last = shown.last_change_percent().unwrap();
    assert!((last - 100.0 * (third / second - 1.0)).abs() < 1.0, "{last}");
    let (joint, torque) = shown.largest_change().unwrap();
    assert!(joint == 0 && (torque + 0.5625).abs() < 0.05, "{torque}");
    let sentence = shown.sentence(&["one".to_owned(), "two".to_owned()]);
    assert!(sentence.contains("3 times, 60 s") && sentence.contains("most at one"), "{sentence}");
    assert_eq!(store.records().unwrap()[0].warm_up.as_ref(), Some(shown));
    let mut settings = simulated_arm::settings();
    settings.safety.warm_up_s = 10.0;
    settings.max_runs = 3;
    settings.settled.tracking_tolerance = 1e-9;
    settings.settled.floor_ratio = 1.0;
    let more = Iteration::new(simulated_arm::task(), settings).unwrap();
    let mut cold = Cold::new();
    iterate(&more, &mut [&mut cold], Some(&store), &mut |_, _| {}).unwrap();
    let expected = [(3, RunPurpose::WarmUp { pass: 1, of: 1 }, 1.0), (3, RunPurpose::Run, 1.0)];
    assert_eq!(cold.commanded, expected);
}

#[test]
fn a_warm_robot_shows_no_drift() {
    let mut robot = Simulated::default().robot();
    let outcome = iterate(&iteration(60.0), &mut [&mut robot], None, &mut |_, _| {}).unwrap();
    let shown = outcome.runs[0].warm_up.as_ref().unwrap();
    // 0.05 Nm of 10000 torques along 1.5 Nm: a change of 4 parts in 10000 is one standard deviation.
    assert!(shown.change_percent().unwrap().abs() < 0.2, "{:?}", shown.change_percent());
    assert_ne!(shown.lost_power_w[0], shown.lost_power_w[1], "the same noise twice");
}

struct Asked(Vec<NextMotion>);

impl Supervisor for Asked {
    fn allows(&mut self, motion: &NextMotion) -> bool {
        self.0.push(motion.clone());
        true
    }
}

/// Requests for permission contain the pass; a pass that ends early ends the call.
#[test]
fn a_pass_that_ends_early_is_looked_at() {
    let mut cold = Cold { stops_in: Some(2), ..Cold::new() };
    let mut asked = Asked(Vec::new());
    let outcome = iterate_supervised(&iteration(50.0), &mut [&mut cold], None, &mut asked).unwrap();
    let IterationStatus::Waiting { reason } = &outcome.status else { panic!("{}", outcome.status) };
    assert!(reason.contains("pass 2 of 3 of the warm-up") && reason.contains("Check the robot"), "{reason}");
    assert!(outcome.runs.is_empty() && cold.commanded.len() == 3);
    assert_eq!(asked.0[2].purpose, RunPurpose::WarmUp { pass: 2, of: 3 });
}
