//! A palletising arm with two closed chains, from logs to a model: `examples/palletizer.toml` with known truth.

use super::common::repository;
use dynident::study::Folders;
use dynident::{RunOptions, Silent, Study, StudyRobot, identify};
use serde_json::Value;
use std::path::PathBuf;

fn example() -> (Study, PathBuf) {
    let path = repository("examples/palletizer.toml");
    (Study::load(&path).unwrap(), path)
}

#[test]
fn a_palletising_arm_is_identified_from_the_logs_of_its_drives() {
    let (study, path) = example();
    let found = identify(&study, &path, &RunOptions { data: None, threads: 2, progress: &Silent }).unwrap();
    let result = &found.result;
    assert_eq!((result.joints.len(), result.bodies.len()), (4, 8));
    // 1 Nm of noise on torques of about 180 Nm is 0.6 %; sign friction and 125 Hz add about as much.
    let held_out = result.validation[0].model.relative_error_percent.unwrap();
    assert!(held_out < 2.0, "{held_out} %");
    let truth: Value =
        serde_json::from_str(&std::fs::read_to_string(repository("examples/palletizer/truth.json")).unwrap()).unwrap();
    let truth = truth["base_parameters"].as_array().unwrap();
    assert_eq!(truth.len(), result.base_parameters.len());
    let inside = result.base_parameters.iter().filter(|own| {
        let theirs = truth.iter().find(|theirs| theirs["expression"] == own.expression.as_str()).unwrap();
        (own.value - theirs["value"].as_f64().unwrap()).abs() <= own.half_width_95
    });
    // Of 40 intervals with 95 %, four miss for one in ten robots.
    assert!(inside.count() >= 36);
}

#[test]
fn a_loop_that_is_none_and_a_link_that_is_needed_are_refused() {
    let error = |change: &dyn Fn(&mut Study)| {
        let (mut study, path) = example();
        change(&mut study);
        StudyRobot::new(&study, &path, &Folders::new(&study, &path, None)).unwrap_err().to_string()
    };
    let text = error(&|study| study.robot.loops[0].points_m[0][2] = 0.05);
    assert!(text.contains("[[robot.loop]]") && text.contains("not a parallelogram"), "{text}");
    let text = error(&|study| study.robot.loops[0].passive[0] = "ellbow".to_owned());
    assert!(text.contains("there is no joint `ellbow`"), "{text}");
    let text = error(&|study| study.robot.drop = vec!["base".to_owned()]);
    assert!(text.contains("there is no link `base`"), "{text}");
}
