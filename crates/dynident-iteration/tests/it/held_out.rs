//! Runs of a held-out motion validate the newest model and change nothing else.

use super::simulated_arm::{self, RATE_HZ, Simulated};
use dynident_excitation::Motion;
use dynident_identification::{Execution, Role, identify};
use dynident_iteration::{
    HeldOutMotion, Iteration, IterationStatus, IterationStore, Leg, Robot, RobotRun, RobotStatus, RunPurpose,
    RunRequest, SimulatedRobot, UnmetCondition, iterate,
};
use dynident_simulation::{Reference, SimulationError};

/// Other sines than those of the iteration's motion, 10 s from rest to rest.
fn other() -> Reference {
    let samples = (10.0 * RATE_HZ) as usize + 1;
    let mut motion = Motion { samples, joints: 2, ..Motion::default() };
    for (amplitude, hertz) in [(0.5, 0.2), (-0.6, 0.3)] {
        let w = core::f64::consts::TAU * hertz;
        for sample in 0..samples {
            let t = sample as f64 / RATE_HZ;
            motion.q.push(amplitude * (1.0 - (w * t).cos()));
            motion.dq.push(amplitude * w * (w * t).sin());
            motion.ddq.push(amplitude * w * w * (w * t).cos());
        }
    }
    Reference::new(RATE_HZ, motion).unwrap()
}

fn held_out(every: Option<usize>) -> HeldOutMotion {
    HeldOutMotion { leg: Leg::whole(other()).unwrap(), every }
}

fn iteration(every: Option<usize>) -> Iteration {
    Iteration::new(simulated_arm::task(), simulated_arm::settings()).unwrap().with_held_out(held_out(every)).unwrap()
}

/// The arm; on the held-out motion it has other parameters if requested.
#[derive(Debug)]
struct Noted {
    inner: SimulatedRobot,
    on_held_out: Option<SimulatedRobot>,
    /// Whether it is stopped there.
    stops: bool,
    commanded: Vec<(usize, RunPurpose)>,
}

impl Noted {
    fn new() -> Self {
        Self { inner: Simulated::default().robot(), on_held_out: None, stops: false, commanded: Vec::new() }
    }
}

impl Robot for Noted {
    fn run(&mut self, request: &RunRequest<'_>) -> Result<RobotRun, SimulationError> {
        self.commanded.push((request.run, request.purpose));
        let is_held_out = request.purpose == RunPurpose::HeldOut;
        let robot = self.on_held_out.as_mut().filter(|_| is_held_out).unwrap_or(&mut self.inner);
        let run = robot.run(request)?;
        let reason = || "protective stop".to_owned();
        let status = if self.stops && is_held_out { RobotStatus::Stopped { reason: reason() } } else { run.status };
        Ok(RobotRun { status, ..run })
    }
}

/// The held-out run is made once at the end; the runs are bit-identical to those of an iteration without it; and the
/// final identification uses it for validation, with the error of its noise.
#[test]
fn the_newest_model_is_judged_before_it_has_converged() {
    let without = Iteration::new(simulated_arm::task(), simulated_arm::settings()).unwrap();
    let plain = iterate(&without, &mut [&mut Noted::new()], None, &mut |_, _| {}).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let store = IterationStore::open(folder.path(), "test", true).unwrap();
    let (iteration, mut robot) = (iteration(None), Noted::new());
    let outcome = iterate(&iteration, &mut [&mut robot], Some(&store), &mut |_, _| {}).unwrap();
    assert_eq!(outcome.status, IterationStatus::Converged, "{:?}", outcome.shortfalls);
    let runs = plain.runs.len();
    assert_eq!(robot.commanded.len(), runs + 1);
    assert_eq!(robot.commanded[runs], (runs, RunPurpose::HeldOut));
    let mut bare = outcome.runs.clone();
    let judged = bare[runs - 1].held_out.take().unwrap();
    assert_eq!(bare, plain.runs);
    let evidence = judged.evidence.as_ref().unwrap();
    for joint in &evidence.joints {
        let prediction = joint.prediction.unwrap();
        assert!(prediction.inside > 0.85 && prediction.rms_error < 0.1, "{prediction:?}");
    }
    // A resumed iteration has nothing to do, and its log is read back unchanged.
    let mut again = Noted::new();
    let taken_up = iterate(&iteration, &mut [&mut again], Some(&store), &mut |_, _| {}).unwrap();
    assert!(again.commanded.is_empty() && taken_up.runs == outcome.runs);
    let task = iteration.identification_task(&outcome.runs, &store).unwrap().unwrap();
    let tests: Vec<&str> =
        task.recordings.iter().filter(|own| own.role == Role::Validate).map(|own| &*own.name).collect();
    assert_eq!(tests, [format!("run {runs}, held out")]);
    assert_eq!(task.recordings.len(), runs + 1);
    let found = identify(&task, Execution::default()).unwrap();
    assert!(found.held_out[0].validation.model.relative_error_percent.unwrap() < 2.0);
}

/// An arm with other parameters outside of the fitted motion: the iteration without held-out runs converges, the one
/// with them does not, and it reports the failed prediction.
#[test]
fn a_model_that_predicts_no_other_motion_has_not_converged() {
    let heavier = Simulated { tip_kg: 1.6, ..Simulated::default() };
    let mut robot = Noted { on_held_out: Some(heavier.robot()), ..Noted::new() };
    let outcome = iterate(&iteration(None), &mut [&mut robot], None, &mut |_, _| {}).unwrap();
    assert!(!outcome.status.is_converged(), "{}", outcome.status);
    let Some(UnmetCondition::HeldOutPrediction { inside_percent, .. }) =
        outcome.shortfalls.iter().find(|own| matches!(own, UnmetCondition::HeldOutPrediction { .. }))
    else {
        panic!("{:?}", outcome.shortfalls)
    };
    assert!(*inside_percent < 50.0, "{inside_percent}");
    // No other condition is unmet, and each further run was validated again.
    assert!(outcome.shortfalls.iter().all(|own| matches!(own, UnmetCondition::HeldOutPrediction { .. })));
    assert!(robot.commanded.iter().filter(|own| own.1 == RunPurpose::HeldOut).count() >= 2);
    assert!(outcome.shortfalls[0].to_string().starts_with("held-out motion: "));
}

/// Held-out run after every run: if the run or the held-out run is removed, a resumed iteration repeats it, and a
/// held-out run without its run is removed.
#[test]
fn held_out_runs_belong_to_their_runs() {
    let folder = tempfile::tempdir().unwrap();
    let store = IterationStore::open(folder.path(), "test", true).unwrap();
    let iteration = iteration(Some(1));
    let mut robot = Noted::new();
    let outcome = iterate(&iteration, &mut [&mut robot], Some(&store), &mut |_, _| {}).unwrap();
    let runs = outcome.runs.len();
    assert!(outcome.status.is_converged() && outcome.runs.iter().all(|run| run.held_out.is_some()));
    let expected: Vec<(usize, RunPurpose)> =
        (1..=runs).flat_map(|run| [(run, RunPurpose::Run), (run, RunPurpose::HeldOut)]).collect();
    assert_eq!(robot.commanded, expected);
    let of_run = |run: usize| store.held_out_log_path(run).parent().unwrap().to_owned();
    // Only the last held-out run is removed.
    std::fs::remove_dir_all(of_run(runs)).unwrap();
    let mut robot = Noted::new();
    let again = iterate(&iteration, &mut [&mut robot], Some(&store), &mut |_, _| {}).unwrap();
    assert_eq!(again.runs, outcome.runs);
    assert_eq!(robot.commanded, [(runs, RunPurpose::HeldOut)]);
    std::fs::remove_dir_all(store.run_folder(runs)).unwrap();
    let store = IterationStore::open(folder.path(), "test", true).unwrap();
    assert!(!of_run(runs).exists() && of_run(runs - 1).exists());
    let again = iterate(&iteration, &mut [&mut Noted::new()], Some(&store), &mut |_, _| {}).unwrap();
    assert_eq!(again.runs, outcome.runs);
    IterationStore::open(folder.path(), "test", false).unwrap();
    assert!(!of_run(1).exists());
}

/// A held-out run that is stopped validates nothing, and the iteration of an external robot waits for a person.
#[test]
fn a_held_out_run_that_ends_early() {
    let mut settings = simulated_arm::settings();
    settings.safety.outside = true;
    let iteration = Iteration::new(simulated_arm::task(), settings).unwrap().with_held_out(held_out(None)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let store = IterationStore::open(folder.path(), "test", true).unwrap();
    let mut robot = Noted { stops: true, ..Noted::new() };
    let outcome = iterate(&iteration, &mut [&mut robot], Some(&store), &mut |_, _| {}).unwrap();
    let IterationStatus::Waiting { reason } = &outcome.status else { panic!("{}", outcome.status) };
    assert!(reason.contains("held-out run after run") && reason.contains("Check the robot"), "{reason}");
    assert!(
        matches!(&outcome.shortfalls[..], [UnmetCondition::HeldOutFailed { reason }] if reason.contains("protective"))
    );
    // With several legs there is no single held-out motion.
    let mut task = simulated_arm::task();
    task.legs.push(task.legs[0].clone());
    let legs = Iteration::new(task, simulated_arm::settings()).unwrap().with_held_out(held_out(None));
    assert!(legs.unwrap_err().to_string().contains("held_out"));
}
