//! Equal results for any number of threads, from the written URDF and from the stored model.
use crate::common::{Job, Motion, Random, Truth, format, header, repository, write_log};
use dynident::dynamics::{Workspace, inverse_dynamics, torque_regressor};
use dynident::model::load_robot;
use dynident::{IdentificationOutcome, Silent, validate};
use std::path::Path;

/// A noisy study of a UR10 with two training and two held-out logs.
fn study(folder: &Path) -> (Job, Truth) {
    let truth = Truth::near(&repository("robots/ur10.urdf"), 0.1, false);
    let mut random = Random(5);
    for seed in 1..=4 {
        let path = folder.join(format!("log{seed}.csv"));
        write_log(&path, &truth, &Motion::new(6, seed), (250.0, 8.0), &header(6), |q, tau| {
            q.iter().copied().chain(tau.iter().map(|t| t + 0.2 * random.normal())).collect()
        });
    }
    let text = format!(
        "robot.file = {:?}\nlog = [{{ file = \"log1.csv\" }}, {{ file = \"log2.csv\" }}, \
         {{ file = \"log3.csv\", role = \"validate\" }}, {{ file = \"log4.csv\", fraction = [0.1, 0.9], role = \"validate\" }}]\n\
         {}",
        repository("robots/ur10.urdf").display().to_string(),
        format(6).replace("method = \"central-differences\", order = 8", "method = \"butterworth\"")
    );
    (Job::new(folder, &text), truth)
}

fn json(found: &IdentificationOutcome) -> serde_json::Value {
    serde_json::to_value(&found.result).unwrap()
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let folder = tempfile::tempdir().unwrap();
    let (job, _) = study(folder.path());
    let texts: Vec<String> = [1, 2, 3]
        .iter()
        .map(|&threads| {
            let found = dynident::identify(&job.study, &job.path, &Job::options(threads)).unwrap();
            let mut value = json(&found);
            value.as_object_mut().unwrap().remove("timings_s").unwrap();
            format!("{value}\n{}", found.urdf.unwrap())
        })
        .collect();
    assert_eq!(texts[0], texts[1]);
    assert_eq!(texts[0], texts[2]);
}

#[test]
fn the_written_urdf_gives_the_torques_of_the_base_parameters() {
    let folder = tempfile::tempdir().unwrap();
    let (job, _) = study(folder.path());
    let (found, robot) = (job.identify(), job.robot());
    let path = folder.path().join("identified.urdf");
    std::fs::write(&path, found.urdf.as_ref().unwrap()).unwrap();
    let written = load_robot(&path).unwrap().model;
    // All parameters with zero dependent ones: another full set than in the URDF, with the same torques.
    let mut parameters = vec![0.0; robot.base().all_columns().len()];
    for (&column, parameter) in robot.base().independent().iter().zip(&found.result.base_parameters) {
        parameters[column] = parameter.physical.unwrap();
    }
    let (mut workspace, mut random) = (Workspace::new(&written), Random(3));
    let mut workspace_of_study = Workspace::new(robot.model());
    for _ in 0..20 {
        let mut vector = |scale: f64| -> Vec<f64> { (0..6).map(|_| scale * random.next()).collect() };
        let (q, dq, ddq) = (vector(3.0), vector(2.0), vector(5.0));
        let from_urdf = inverse_dynamics(&written, &mut workspace, &q, &dq, &ddq).to_vec();
        let regressor = torque_regressor(robot.model(), &mut workspace_of_study, &q, &dq, &ddq);
        let largest = from_urdf.iter().fold(0.0_f64, |max, t| max.max(t.abs()));
        for row in 0..6 {
            let base: f64 = (0..60).map(|k| regressor[60 * row + k] * parameters[k]).sum();
            // Regrouping and the numbers of the URDF are accurate to about 1e-12.
            assert!((base - from_urdf[row]).abs() < 1e-9 * largest, "{base} {}", from_urdf[row]);
        }
    }
    // Damping and friction are those that were fitted for the file.
    let form = found.result.forms.iter().find(|form| form.forms.contains(&"urdf".to_owned())).unwrap();
    for (joint, (number, result)) in written.joints().iter().zip((1..).zip(&found.result.joints)) {
        let of_form = |symbol: &str| {
            let symbol = format!("{symbol}{number}");
            form.terms.iter().find(|term| term.symbol == symbol).map(|term| term.value)
        };
        assert_eq!([joint.damping, joint.friction], [of_form("fv"), of_form("fc")]);
        let value = |symbol: &str| result.terms.iter().find(|term| term.symbol.starts_with(symbol)).unwrap().value;
        let by_direction: Vec<f64> =
            result.terms.iter().filter(|term| term.symbol.ends_with(['+', '-'])).map(|term| term.value).collect();
        match by_direction[..] {
            [] => {}
            // A robot description has one value for both directions: near their mean, depending on the share of slow
            // motion.
            [forward, backward] => {
                let (friction, mean) = (joint.friction.unwrap(), 0.5 * (forward + backward));
                assert!((friction - mean).abs() < 0.05 * mean, "{friction} {forward} {backward}");
                let (damping, viscous) = (joint.damping.unwrap(), value("fv"));
                assert!((damping - viscous).abs() < 0.05 * viscous, "{damping} {viscous}");
            }
            _ => panic!("{:?}", result.terms),
        }
    }
    for (body, inertial) in found.result.bodies.iter().zip(written.inertials()) {
        let scale = body.parameters.iter().fold(0.0_f64, |max, p| max.max(p.abs()));
        for (stored, read) in body.parameters.iter().zip(inertial.0) {
            assert!((stored - read).abs() < 1e-12 * scale, "{}: {stored} {read}", body.name);
        }
    }
}

#[test]
fn a_stored_result_validates_as_it_did() {
    let folder = tempfile::tempdir().unwrap();
    let (job, _) = study(folder.path());
    let value = json(&job.identify());
    let stored = folder.path().join("result.json");
    std::fs::write(&stored, serde_json::to_string_pretty(&value).unwrap()).unwrap();
    let options = dynident::RunOptions { data: None, threads: 2, progress: &Silent };
    let again = validate(&stored, &job.study, &job.path, &options).unwrap();
    assert_eq!(serde_json::to_value(&again.validation).unwrap(), value["validation"]);
    assert_eq!(again.validation.len(), 2);
}

#[test]
fn moments_without_mass_leave_a_result_and_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let urdf = r#"<robot name="pendulum"><link name="base"/><link name="rod"/>
        <joint name="pivot" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint></robot>"#;
    std::fs::write(folder.path().join("pendulum.urdf"), urdf).unwrap();
    let rows: Vec<String> = (0..600)
        .map(|k| {
            let t = f64::from(k) * 0.01;
            let (q, ddq) = ((2.0 * t).sin(), -4.0 * (2.0 * t).sin());
            format!("{t},{q},{}", 0.3 * ddq + 4.0 * q.sin())
        })
        .collect();
    std::fs::write(folder.path().join("log.csv"), format!("t,q1,tau1\n{}\n", rows.join("\n"))).unwrap();
    let job = Job::new(
        folder.path(),
        &format!(
            "robot.file = \"pendulum.urdf\"\nestimator.physical = false\nlog = [{{ file = \"log.csv\" }}]\n{}",
            format(1)
        ),
    );
    let found = job.identify();
    assert!(found.urdf.is_none());
    assert!(found.result.no_urdf.unwrap().contains("moments but no mass"));
}
