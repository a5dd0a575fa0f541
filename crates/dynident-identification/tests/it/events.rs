//! Events of a log: each clear kind is found and left out of the fit, and honest logs have none.

use dynident_dynamics::ParametricModel;
use dynident_identification::estimators::Estimator;
use dynident_identification::{
    DiagnosisChoice, EventChoice, EventKind, Execution, Identification, IdentificationTask, LogEvent, Recording,
    identify, recording_events,
};
use dynident_model::Model;
use dynident_model::terms::{CoulombShape, DriveChoice, terms_per_joint};
use dynident_recording::JointSamples;
use dynident_testing::event_logs::{RATE_HZ, Scene, Simulated, Style, Truth};

/// Largest error of a start or an end, s: five bins of the search.
const TOLERANCE_S: f64 = 0.2;
/// Largest held-out error relative to that of the log without the event: fewer rows, and their noise.
const MAX_RATIO: f64 = 1.2;

fn robot(name: &str) -> Model {
    dynident_model::load_robot(dynident_testing::repository(&format!("robots/{name}.urdf"))).unwrap().model
}

fn task(model: &Model, logs: &[&Simulated], held_out: &[&Simulated]) -> IdentificationTask {
    let coulomb = Some(CoulombShape::Smooth { width: 0.008 });
    let drive = DriveChoice { viscous: true, coulomb, offset: true, ..DriveChoice::default() };
    let robot = ParametricModel::new(model.clone(), terms_per_joint(model, |_| drive)).unwrap();
    let names = robot.joint_names();
    let read = |log: &Simulated| {
        JointSamples::at_rate(RATE_HZ, log.q.clone(), log.tau.clone()).into_log("log", &names).unwrap()
    };
    let training = logs.iter().enumerate().map(|(k, log)| Recording::training(format!("log {k}"), read(log)));
    let held_out = held_out.iter().map(|log| Recording::held_out("test", read(log)));
    let mut task = IdentificationTask::new(robot, training.chain(held_out).collect());
    task.settings.diagnosis = DiagnosisChoice::Never;
    task.settings.consistency = None;
    task
}

fn fitted(model: &Model, log: &Simulated, held_out: &Simulated, choice: EventChoice) -> Identification {
    let mut task = task(model, &[log], &[held_out]);
    task.settings.events.choice = choice;
    task.settings.estimation.estimator = Estimator::default();
    identify(&task, Execution::default()).unwrap()
}

fn error_percent(found: &Identification) -> f64 {
    found.held_out[0].validation.model.relative_error_percent.unwrap()
}

fn found_events(model: &Model, logs: &[&Simulated]) -> Vec<LogEvent> {
    let found = recording_events(&task(model, logs, &[]), Execution::default());
    found.into_iter().flat_map(|of_log| of_log.search.events).collect()
}

/// The event is found and named, and the fit without its rows is as good as one to a log without the event. With
/// `spoils`, the fit to all rows is not.
fn is_set_aside(robot_name: &str, scene: Scene, kind: EventKind, seed: u64, spoils: bool) {
    let model = robot(robot_name);
    let truth = Truth::new(&model, seed);
    let normal = Scene::Normal(Style::Excitation);
    let [log, clean] = [truth.log(scene, seed + 1), truth.log_without_event(scene, seed + 1)];
    let held_out = truth.log(normal, seed + 2);
    let [reference, all_rows] = [(&clean, EventChoice::Off), (&log, EventChoice::Off)]
        .map(|(log, choice)| fitted(&model, log, &held_out, choice));
    let choice = if kind.is_unmistakable() { EventChoice::default() } else { EventChoice::SetAside };
    let found = fitted(&model, &log, &held_out, choice);
    let events = &found.events.iter().find(|of_log| of_log.index == 0).unwrap().search.events;
    for [from_s, to_s] in &log.intervals {
        let is_found = |event: &&LogEvent| {
            let near = |a: f64, b: f64| (a - b).abs() < TOLERANCE_S;
            // Of a change that lasts, the shorter part is the event.
            let is_before = event.from_s < TOLERANCE_S && near(event.to_s, *from_s);
            event.kind == kind
                && event.set_aside
                && (near(event.from_s, *from_s) && near(event.to_s, *to_s) || is_before)
        };
        assert!(events.iter().any(|event| is_found(&event)), "{from_s} to {to_s}: {events:#?}");
    }
    let [reference, all_rows, without] = [&reference, &all_rows, &found].map(error_percent);
    assert!(
        without <= MAX_RATIO * reference,
        "{scene:?}: {without} % without the event, {reference} % for a clean log"
    );
    assert!(!spoils || all_rows > MAX_RATIO * reference, "{scene:?}: {all_rows} % with all rows, {reference} %");
}

#[test]
fn drives_that_are_off_are_left_out() {
    is_set_aside("tx40", Scene::DrivesOff, EventKind::DrivesOff, 1, true);
}

#[test]
fn an_emergency_stop_is_left_out() {
    is_set_aside("tx40", Scene::EmergencyStop, EventKind::DrivesOff, 4, true);
}

#[test]
fn a_collision_is_left_out() {
    is_set_aside("tx40", Scene::Collision, EventKind::Contact, 3, true);
}

#[test]
fn a_push_is_left_out() {
    is_set_aside("ur10", Scene::Push, EventKind::Contact, 4, true);
}

#[test]
fn hand_guiding_is_left_out() {
    is_set_aside("tx40", Scene::HandGuiding, EventKind::Contact, 5, true);
}

#[test]
fn a_joint_on_its_stop_is_left_out() {
    is_set_aside("ur10", Scene::JointStop, EventKind::JointStop, 6, false);
}

#[test]
fn the_part_with_another_load_is_left_out() {
    is_set_aside("tx40", Scene::LoadChange, EventKind::LoadChange, 1, true);
}

#[test]
fn the_part_with_another_offset_is_left_out() {
    is_set_aside("ur10", Scene::OffsetChange, EventKind::OffsetChange, 4, true);
}

#[test]
fn filled_holes_are_left_out() {
    is_set_aside("tx40", Scene::FilledHoles, EventKind::Interpolated, 9, false);
}

#[test]
fn an_overflow_is_left_out() {
    is_set_aside("ur10", Scene::Overflow, EventKind::Overflow, 10, true);
}

/// Another offset of one joint costs no row of the others.
#[test]
fn joints_that_an_event_cannot_load_keep_their_rows() {
    let model = robot("tx40");
    let truth = Truth::new(&model, 12);
    let log = truth.log(Scene::OffsetChange, 13);
    let found = found_events(&model, &[&log]);
    assert!(found.len() == 1 && found[0].affected == ["joint_2"], "{found:#?}");
    let rows = |choice| -> Vec<usize> {
        let mut task = task(&model, &[&log], &[]);
        task.settings.events.choice = choice;
        // The same rows for both fits.
        task.settings.motion.differentiator = task.settings.motion.differentiator.with_cutoff(5.0);
        identify(&task, Execution::default()).unwrap().training.problem.joint_rows().clone()
    };
    let [all, without] = [rows(EventChoice::Warn), rows(EventChoice::SetAside)];
    let lost: Vec<usize> = all.iter().zip(&without).map(|(all, without)| all - without).collect();
    // The offset of joint 2 changes for the last 9.2 s of 24 s.
    assert!(lost[1] > 35 * all[1] / 100 && lost[1] < 42 * all[1] / 100, "{lost:?} of {all:?}");
    assert!(lost.iter().enumerate().all(|(joint, lost)| joint == 1 || *lost == 0), "{lost:?} of {all:?}");
}

#[test]
fn honest_logs_have_no_event() {
    let styles = [
        Style::Rests,
        Style::PickAndPlace,
        Style::Stiction,
        Style::FrictionWithMemory,
        Style::LoadFriction,
        Style::SharpStribeck,
        Style::SlowThenFast,
        Style::CoarseEncoders,
    ];
    for (number, style) in styles.into_iter().enumerate() {
        let model = robot(["tx40", "iiwa14"][number % 2]);
        let seed = 50 + number as u64;
        let log = Truth::new(&model, seed).log(Scene::Normal(style), seed);
        let events = found_events(&model, &[&log]);
        assert!(events.is_empty(), "{style:?}: {events:#?}");
    }
}

#[test]
fn friction_that_holds_a_joint_at_rest_is_no_event() {
    let seeds = (0..8).map(|seed| (["ur10", "iiwa14", "panda_arm7", "tx40"][seed as usize % 4], 80 + seed, 90 + seed));
    // Logs in which a model whose friction does not depend on the motion before a rest has an event.
    let known = [1_202_870, 1_502_836, 1_502_870].map(|seed| ("ur10", seed, seed + 1));
    let further = [1_102_887, 1_502_853].map(|seed| ("panda_arm7", seed, seed + 1));
    for (name, of_truth, of_log) in seeds.chain(known).chain(further) {
        let model = robot(name);
        let log = Truth::new(&model, of_truth).log(Scene::Normal(Style::RepeatedProgram), of_log);
        let events = found_events(&model, &[&log]);
        assert!(events.is_empty(), "{name}, seed {of_truth}: {events:#?}");
    }
}

#[test]
fn another_payload_in_another_log_is_no_event() {
    let model = robot("ur10");
    let truth = Truth::new(&model, 70);
    let [plain, loaded] = [Style::PickAndPlace, Style::OtherTool].map(|style| truth.log(Scene::Normal(style), 71));
    let events = found_events(&model, &[&plain, &loaded]);
    assert!(events.is_empty(), "{events:#?}");
}
