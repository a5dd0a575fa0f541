//! Temperature-dependent friction in a study.
use crate::common::{Job, Motion, Truth, format, header, repository};
use dynident::dynamics::Workspace;
use std::fmt::Write;
use std::path::Path;

/// Nm s/(rad K) and Nm/K of each joint.
const CHANGES: [[f64; 2]; 2] = [[-0.02, 0.01], [0.015, -0.012]];

/// Joints that warm up from `from` °C by 20 K within about a minute, the second one faster.
fn temperature(t: f64, from: f64) -> [f64; 2] {
    [from + 20.0 * (1.0 - (-t / 40.0).exp()), from + 20.0 * (1.0 - (-t / 15.0).exp())]
}

fn warm_log(path: &Path, truth: &Truth, seed: u64, from: f64, seconds: f64) {
    let (mut workspace, motion) = (Workspace::new(&truth.model), Motion::new(2, seed));
    let mut text = format!("{},T1,T2\n", header(2));
    for k in 0..(seconds * 400.0) as usize {
        let t = k as f64 / 400.0;
        let [q, dq, ddq] = motion.at(t);
        let mut tau = truth.torque(&mut workspace, &q, &dq, &ddq);
        let warm = temperature(t, from);
        for joint in 0..2 {
            let [viscous, coulomb] = CHANGES[joint];
            tau[joint] += (warm[joint] - 30.0)
                * (viscous * dq[joint] + coulomb * (dq[joint] / truth.coulomb_width(joint)).tanh());
        }
        writeln!(text, "{t},{},{},{},{},{},{}", q[0], q[1], tau[0], tau[1], warm[0], warm[1]).unwrap();
    }
    std::fs::write(path, text).unwrap();
}

fn study(robot: &Path, channel: &str, more: &str) -> String {
    format!(
        "robot.file = {:?}\ndrive.laws = [{{ law = \"temperature\", reference_c = 30.0 }}]\nparallel_filter.factor = 4\n\
         log = [{{ file = \"warm.csv\" }}, {{ file = \"test.csv\", role = \"validate\" }}]\n{more}\n{}\n{channel}",
        robot.display().to_string(),
        format(2)
    )
}

#[test]
fn changes_with_the_temperature_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let robot = repository("examples/robots/paper_2r.toml");
    let truth = Truth::near(&robot, 0.3, false);
    warm_log(&folder.path().join("warm.csv"), &truth, 1, 22.0, 24.0);
    warm_log(&folder.path().join("test.csv"), &truth, 2, 35.0, 6.0);
    // In the unit of the law, and in another unit.
    for channel in [
        "temperature = { columns = \"T{1..2}\", unit = \"degC\" }",
        "temperature = { columns = [\"T1\", \"T2\"], scale = 0.5, offset = 10.0 }",
    ] {
        let job = Job::new(folder.path(), &study(&robot, channel, "estimator.physical = false"));
        let found = job.identify();
        let half = if channel.contains("scale") { 2.0 } else { 1.0 };
        for (joint, [viscous, coulomb]) in found.result.joints.iter().zip(CHANGES) {
            for (symbol, expected) in [("fvT", viscous), ("fcT", coulomb)] {
                let term = joint.terms.iter().find(|term| term.symbol.starts_with(symbol)).unwrap();
                // Noise-free: the tolerance of all other parameters, which are of order 0.01 here.
                assert!((term.value - half * expected).abs() < 1e-6, "{term:?} {expected}");
            }
        }
        let held_out = found.result.validation[0].model.relative_error_percent.unwrap();
        assert!(held_out < 1e-3, "{held_out}");
    }
}

#[test]
fn a_log_without_temperature_is_refused_and_a_constant_one_tells_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let robot = repository("examples/robots/paper_2r.toml");
    let truth = Truth::near(&robot, 0.3, false);
    warm_log(&folder.path().join("warm.csv"), &truth, 1, 22.0, 6.0);
    warm_log(&folder.path().join("test.csv"), &truth, 2, 22.0, 6.0);
    let job = Job::new(folder.path(), &study(&robot, "", ""));
    let refused = dynident::identify(&job.study, &job.path, &Job::options(1)).unwrap_err().to_string();
    assert!(refused.contains("`joint1` depends on the temperature") && refused.contains("warm"), "{refused}");
    let channel = "temperature = { columns = \"T{1..2}\" }";
    for (more, words) in [
        ("drive.friction = \"auto\"", "auto"),
        ("estimator.method = \"instrumental\"", "instruments"),
        ("drive.joints.joint1.laws = [{ law = \"temperature\", viscous = false, coulomb = false }]", "neither"),
    ] {
        let text = study(&robot, channel, more);
        let said = dynident::Study::parse(&text, Path::new("study.toml")).unwrap_err().to_string();
        assert!(said.contains(words), "{said}");
    }
    // At constant temperature the change coincides with friction: it is fixed at zero and reported.
    let text = std::fs::read_to_string(folder.path().join("warm.csv")).unwrap();
    let lines = text.lines().enumerate().map(|(k, line)| {
        let fields: Vec<&str> = line.split(',').collect();
        if k == 0 { line.to_owned() } else { format!("{},31.0,31.0", fields[..5].join(",")) }
    });
    std::fs::write(folder.path().join("warm.csv"), lines.collect::<Vec<_>>().join("\n") + "\n").unwrap();
    let found = Job::new(folder.path(), &study(&robot, channel, "")).identify().result;
    assert_eq!(found.method.not_excited, ["fvT1", "fcT1", "fvT2", "fcT2"]);
}
