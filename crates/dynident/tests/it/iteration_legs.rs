//! Legs with held joints in a study: bit-identical to the library.
use crate::common::repository;
use core::ops::ControlFlow;
use dynident::{Error, IterationWatch, IterationsFile, RunOptions, Silent, Study, design_study, iterate_study};
use dynident_dynamics::ParametricModel;
use dynident_excitation::Motion;
use dynident_iteration::{Iteration, IterationSettings, IterationTask, Leg, RunRecord, Scheme, iterate};
use dynident_iteration::{Robot, SimulatedRobot};
use dynident_simulation::{Integrator, LoopSettings, Plant, Reference};
use std::path::Path;

const RATE_HZ: f64 = 1000.0;

fn options() -> RunOptions<'static> {
    RunOptions { data: None, threads: 1, progress: &Silent }
}

fn iterated(study: &Study, path: &Path, out: &Path) -> Result<IterationsFile, Error> {
    let mut hear = |_: &_, _: &[_]| {};
    let mut watch = IterationWatch::new(&|_| ControlFlow::Continue(()), &mut hear);
    iterate_study(study, path, out, true, &options(), &mut watch)
}

/// The strokes of the design as separate legs.
fn by_library(study: &Study, path: &Path) -> Vec<Vec<RunRecord>> {
    let outcome = design_study(study, path, &options(), |_| ControlFlow::Continue(())).unwrap();
    let model = outcome.robot.model().clone();
    let whole = Reference::of_family(outcome.family(), &outcome.file.parameters, RATE_HZ, None).unwrap();
    let section = study.iteration.clone().unwrap();
    let mut known: Vec<(usize, f64)> = Vec::new();
    let mut start_s = 0.0;
    let mut all = Vec::new();
    for stroke in &outcome.file.windowed.as_ref().unwrap().strokes {
        let joint = model.joint_index(&stroke.joint).unwrap();
        let motion = whole.motion();
        let sample = |time_s: f64| (time_s * RATE_HZ).round() as usize;
        let (first, last) = (sample(start_s), sample(start_s + stroke.period_s).min(motion.samples - 1));
        let part = |values: &[f64]| -> Vec<f64> {
            values.chunks_exact(motion.samples).flat_map(|own| own[first..=last].to_vec()).collect()
        };
        let (q, dq, ddq) = (part(&motion.q), part(&motion.dq), part(&motion.ddq));
        let own = Motion { samples: last + 1 - first, joints: 2, q, dq, ddq, dddq: Vec::new() };
        let reference = Reference::new(RATE_HZ, own).unwrap().with_joint_held(1 - joint, 0.0).unwrap();
        let begin_s = first as f64 / RATE_HZ;
        let mut windows = vec![Vec::new(); 2];
        windows[joint] = [0.25, 0.75]
            .map(|middle| {
                let centre = start_s + middle * stroke.period_s;
                [centre - stroke.window_s - begin_s, centre + stroke.window_s - begin_s]
            })
            .to_vec();
        start_s += stroke.period_s;
        let robot = ParametricModel::new(model.clone(), Vec::new()).unwrap().with_nominal(vec![0.0; 20]).unwrap();
        let legs = vec![Leg::windowed(reference, windows).unwrap()];
        let task = IterationTask { robot, legs, known: known.clone(), torque_limits: None };
        let mut settings = IterationSettings {
            model_free: section.model_free.clone().unwrap(),
            controller: study.controller.clone().unwrap(),
            max_runs: section.max_runs,
            ..IterationSettings::default()
        };
        settings.identification.scheme = Scheme::StepByStep;
        let resting = model.joints()[1 - joint].name.clone();
        let plant = Plant::new(&model, &[], &[]).unwrap().with_locked(&[resting]).unwrap();
        let integrator = Integrator::Rk4 { steps_per_sample: 1 };
        let mut robot = SimulatedRobot::new(plant, LoopSettings { integrator, ..LoopSettings::default() }).unwrap();
        let iteration = Iteration::new(task, settings).unwrap();
        let outcome = iterate(&iteration, &mut [&mut robot as &mut dyn Robot], None, &mut |_, _| {}).unwrap();
        let estimate = outcome.runs.last().unwrap().knowledge().cloned().unwrap();
        for (column, value) in estimate.values.iter().enumerate() {
            if !estimate.fixed.contains(&column) && known.iter().all(|(other, _)| *other != column) {
                known.push((column, *value));
            }
        }
        all.push(outcome.runs);
    }
    all
}

#[test]
fn legs_one_after_another_are_the_librarys() {
    let path = repository("examples/iterate_paper_2r_legs.toml");
    let study = Study::load(&path).unwrap();
    let out = tempfile::tempdir().unwrap();
    let file = iterated(&study, &path, out.path()).unwrap();
    assert!(file.converged, "{}", file.reason);
    let library = by_library(&study, &path);
    assert_eq!(library.len(), 2);
    let flat: Vec<(usize, &RunRecord)> =
        library.iter().enumerate().flat_map(|(leg, runs)| runs.iter().map(move |run| (leg + 1, run))).collect();
    assert_eq!(file.runs.len(), flat.len());
    for (run, (leg, record)) in file.runs.iter().zip(&flat) {
        assert_eq!((run.leg, run.run), (Some(*leg), record.run));
        let values: Vec<f64> = run.parameters.iter().map(|parameter| parameter.value).collect();
        assert_eq!(values, record.estimate.as_ref().unwrap().values);
        assert_eq!(run.max_tracking_error_rad, record.max_tracking_error_rad);
    }
    // All six parameters at the end; those of joint 2 with the error bars of its own leg.
    let last = file.runs[file.runs.len() - 1].known();
    let of_first = file.runs.iter().rfind(|run| run.leg == Some(1)).unwrap();
    for (parameter, before) in last.iter().zip(of_first.known()) {
        assert!(parameter.error.unwrap().abs() < 1e-6, "{parameter:?}");
        assert!(parameter.std.is_some() && (before.std.is_none() || parameter.std == before.std));
    }
    // The locked joint does not move.
    assert!(file.runs.iter().all(|run| run.max_tracking_error_rad[usize::from(run.leg != Some(1))] == 0.0));
    assert!(out.path().join("leg_2/runs/run_1/log.csv").is_file());
    // A second call reuses all runs.
    let again = iterated(&study, &path, out.path()).unwrap();
    assert_eq!(serde_json::to_string(&again).unwrap(), serde_json::to_string(&file).unwrap());
    let page = std::fs::read_to_string(out.path().join("report.html")).unwrap();
    assert!(page.contains("joint2: tracking error, leg 1") && page.contains("1 of leg 2"));
}

/// Both legs in every run, with one identification from both logs.
#[test]
fn legs_together_are_one_run() {
    let path = repository("examples/iterate_paper_2r_legs.toml");
    let text = std::fs::read_to_string(&path).unwrap().replace("\"one-after-another\"", "\"together\"");
    let out = tempfile::tempdir().unwrap();
    let study: Study = toml::from_str(&text).unwrap();
    let file = iterated(&study, &path, out.path()).unwrap();
    assert!(file.converged && file.runs.iter().all(|run| run.leg.is_none()), "{}", file.reason);
    assert!(file.runs.last().unwrap().parameters.iter().all(|parameter| parameter.error.unwrap().abs() < 1e-6));
    assert!(out.path().join("runs/run_1/log_2.csv").is_file());
}

#[test]
fn legs_that_make_no_sense_are_refused_with_the_place() {
    let path = repository("examples/iterate_paper_2r_legs.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let out = tempfile::tempdir().unwrap();
    for (from, to, what) in [
        ("hold = { joint1 = 0.0 }", "hold = { elbow = 0.0 }", "leg 1: hold: unknown joint `elbow`"),
        ("hold = { joint2 = 0.0 }", "hold = { joint1 = 0.0, joint2 = 0.0 }", "leg 2: hold: all joints are held"),
        ("hold = { joint1 = 0.0 }", "hold = { joint1 = nan }", "leg 1: hold.joint1 = NaN"),
        (
            "hold = { joint1 = 0.0 }",
            "hold = { joint1 = 0.0 }\nwindows = { joint1 = [[0.0, 1.0]] }",
            "leg 1: windows: joint `joint1` is held",
        ),
        (
            "hold = { joint1 = 0.0 }",
            "hold = { joint1 = 0.0 }\ntrajectory = \"a.csv\"\ndesign = {}",
            "leg 1: trajectory and design are both given",
        ),
    ] {
        let study: Study = toml::from_str(&text.replace(from, to)).unwrap();
        let error = iterated(&study, &path, out.path()).unwrap_err().to_string();
        assert!(error.contains(what), "{error}");
    }
}
