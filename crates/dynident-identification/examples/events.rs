//! Searches simulated logs with one event each, and simulated logs with unusual but normal content.
//!
//! ```text
//! cargo run --release -p dynident-identification --example events -- [SET] [ratio]
//! ```
//!
//! Prints every log with its true intervals and the events that were found, then the number of logs whose event was
//! found within 0.2 s and named correctly, and the number of normal logs with an event. With `ratio`, it also fits each
//! log with an event and prints the held-out error relative to a fit to the same log without the event.

#![allow(clippy::print_stdout, reason = "printing results is what this program is for")]

use dynident_dynamics::ParametricModel;
use dynident_identification::{
    DiagnosisChoice, EventChoice, EventKind, Execution, IdentificationTask, LogEvent, Recording, identify,
    recording_events,
};
use dynident_model::Model;
use dynident_model::terms::{CoulombShape, DriveChoice, terms_per_joint};
use dynident_recording::JointSamples;
use dynident_testing::event_logs::{EVENTS, RATE_HZ, STYLES, Scene, Simulated, Style, Truth};
use dynident_testing::repository;
use std::error::Error;

const ROBOTS: [&str; 4] = ["ur10", "iiwa14", "panda_arm7", "tx40"];
/// Logs of each kind of event, and of each style without event.
const LOGS: [usize; 2] = [5, 4];
/// Largest error of a start or an end, s.
const TOLERANCE_S: f64 = 0.2;
/// Share of the intervals of one log that have to be found.
const MIN_FOUND: f64 = 0.75;

fn main() -> Result<(), Box<dyn Error>> {
    let set: u64 = std::env::args().nth(1).map_or(Ok(0), |text| text.parse())?;
    let with_ratio = std::env::args().nth(2).is_some_and(|text| text == "ratio");
    let events = EVENTS.iter().flat_map(|scene| (0..LOGS[0]).map(move |k| (*scene, k)));
    let normal = STYLES.iter().flat_map(|style| (0..LOGS[1]).map(move |k| (Scene::Normal(*style), k)));
    let [mut found, mut with_event, mut false_alarms, mut without] = [0; 4];
    let mut ratios: Vec<[f64; 3]> = Vec::new();
    for (number, (scene, k)) in events.chain(normal).enumerate() {
        let robot = ROBOTS[(number + k) % ROBOTS.len()];
        let model = dynident_model::load_robot(repository(&format!("robots/{robot}.urdf")))?.model;
        let seed = 1000 + 17 * number as u64 + 100_000 * set;
        let truth = Truth::new(&model, seed);
        let log = truth.log(scene, seed + 1);
        let task = task(&model, &log, None)?;
        let search = recording_events(&task, Execution::default()).swap_remove(0).search;
        let kinds = kinds(scene);
        let is_right = is_right(scene, &log, &search.events);
        if kinds.is_empty() {
            (without, false_alarms) = (without + 1, false_alarms + usize::from(!is_right));
        } else {
            (with_event, found) = (with_event + 1, found + usize::from(is_right));
        }
        println!("{} {number} {scene:?} {robot} {:.2?}", if is_right { "ok  " } else { "MISS" }, log.intervals);
        for event in &search.events {
            let state = if event.set_aside { "set aside" } else { "warning" };
            println!("       {:.2} to {:.2} s {:?} {:?} {state}", event.from_s, event.to_s, event.kind, event.joints);
        }
        if with_ratio && !kinds.is_empty() {
            let normal = Scene::Normal(Style::Excitation);
            let [clean, held_out] = [truth.log_without_event(scene, seed + 1), truth.log(normal, seed + 2)];
            let reference = held_out_error(&model, &clean, &held_out, EventChoice::Off)?;
            let of = |choice| held_out_error(&model, &log, &held_out, choice).map(|error| error / reference);
            let ratio = [of(EventChoice::SetAside)?, of(EventChoice::Auto)?, of(EventChoice::Off)?];
            let [set_aside, auto, all] = ratio;
            println!(
                "       held-out error relative to the log without the event: {set_aside:.2} \"set-aside\", {auto:.2} \"auto\", {all:.2} \"off\""
            );
            ratios.push(ratio);
        }
    }
    println!("{found} of {with_event} events found; {false_alarms} of {without} normal logs with an event");
    if with_ratio {
        let below = |k: usize| ratios.iter().filter(|ratio| ratio[k] <= 1.2).count();
        println!("held-out error within 1.2: {} \"set-aside\", {} \"auto\", {} \"off\"", below(0), below(1), below(2));
    }
    Ok(())
}

fn task(model: &Model, log: &Simulated, held_out: Option<&Simulated>) -> Result<IdentificationTask, Box<dyn Error>> {
    let coulomb = Some(CoulombShape::Smooth { width: 0.008 });
    let drive = DriveChoice { viscous: true, coulomb, offset: true, ..DriveChoice::default() };
    let robot = ParametricModel::new(model.clone(), terms_per_joint(model, |_| drive))?;
    let names = robot.joint_names();
    let read = |log: &Simulated, name: &str| {
        JointSamples::at_rate(RATE_HZ, log.q.clone(), log.tau.clone()).into_log(name, &names)
    };
    let mut recordings = vec![Recording::training("log", read(log, "log")?)];
    if let Some(held_out) = held_out {
        recordings.push(Recording::held_out("test", read(held_out, "test")?));
    }
    let mut task = IdentificationTask::new(robot, recordings);
    task.settings.diagnosis = DiagnosisChoice::Never;
    task.settings.consistency = None;
    Ok(task)
}

fn held_out_error(
    model: &Model,
    log: &Simulated,
    held_out: &Simulated,
    choice: EventChoice,
) -> Result<f64, Box<dyn Error>> {
    let mut task = task(model, log, Some(held_out))?;
    task.settings.events.choice = choice;
    let found = identify(&task, Execution::default())?;
    Ok(found.held_out[0].validation.model.relative_error_percent.unwrap_or(f64::NAN))
}

/// Kinds that name the event correctly.
fn kinds(scene: Scene) -> &'static [EventKind] {
    match scene {
        Scene::DrivesOff | Scene::EmergencyStop => &[EventKind::DrivesOff],
        Scene::Collision | Scene::Push | Scene::HandGuiding => &[EventKind::Contact],
        Scene::JointStop => &[EventKind::JointStop],
        Scene::LoadChange => &[EventKind::LoadChange],
        Scene::OffsetChange => &[EventKind::OffsetChange],
        Scene::Drift => &[EventKind::Drift],
        Scene::WarmUp => &[EventKind::WarmUp],
        Scene::FilledHoles => &[EventKind::Interpolated],
        Scene::Overflow => &[EventKind::Overflow],
        Scene::Normal(_) => &[],
    }
}

/// Whether the intervals of a log were found and named, without other events.
fn is_right(scene: Scene, log: &Simulated, events: &[LogEvent]) -> bool {
    let kinds = kinds(scene);
    let Some(first) = kinds.first() else { return events.is_empty() };
    let is_named =
        |event: &LogEvent| kinds.contains(&event.kind) || event.alternative.is_some_and(|kind| kinds.contains(&kind));
    if first.is_trend() {
        return events.iter().any(is_named);
    }
    // Of a change that lasts, the shorter part is the event.
    let lasts = matches!(scene, Scene::LoadChange | Scene::OffsetChange);
    let near = |a: f64, b: f64| (a - b).abs() < TOLERANCE_S;
    let is_before = |event: &LogEvent| lasts && event.from_s < TOLERANCE_S;
    let is_found = |[from, to]: &[f64; 2]| {
        let matches = |event: &&LogEvent| {
            is_named(event)
                && (near(event.from_s, *from) && near(event.to_s, *to) || is_before(event) && near(event.to_s, *from))
        };
        events.iter().any(|event| matches(&event))
    };
    let is_other = |event: &LogEvent| {
        let overlaps = |[from, to]: &[f64; 2]| event.from_s < to + TOLERANCE_S && event.to_s > from - TOLERANCE_S;
        !is_before(event) && !log.intervals.iter().any(overlaps)
    };
    let found = log.intervals.iter().filter(|interval| is_found(interval)).count();
    found as f64 >= MIN_FOUND * log.intervals.len() as f64 && !events.iter().any(is_other)
}
