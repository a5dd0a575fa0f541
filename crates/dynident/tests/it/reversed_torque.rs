//! Reversed torque of one joint of a real log: the result has a problem that names the joint.

use super::common::{Job, recordings, repository};

/// Example, joints, and the signs of their torque.
const EXAMPLES: [(&str, &[i32]); 6] = [
    ("ur10", &[1; 6]),
    ("panda", &[1; 7]),
    ("lbr_med7", &[-1; 7]),
    ("dfki_pendulum", &[1; 2]),
    // The torque of its other joints is dead for most of the time, which is reported.
    ("tiago", &[1, 1, 1, -1, -1]),
    // The sign of its last joint is not identifiable: no robot explains more than a fifth of its torque.
    ("lwr4plus_23_to_1", &[1; 6]),
];

fn reversed(name: &str, signs: &[i32], joint: usize) -> String {
    let study = std::fs::read_to_string(repository(&format!("examples/{name}.toml"))).unwrap();
    let data = recordings().unwrap();
    let study = study.replace("data = \"../../shared/data\"", &format!("data = {:?}", data.display().to_string()));
    let mut signs = signs.to_vec();
    signs[joint] = -signs[joint];
    match name {
        "tiago" => {
            signs.extend([-1; 3]);
            let (before, rest) = study.split_once("\nsign = ").unwrap();
            format!("{before}\nsign = {signs:?}{}", &rest[rest.find('\n').unwrap()..])
        }
        "lbr_med7" => study.replace("sign = -1.0", &format!("sign = {signs:?}")),
        _ => {
            if name == "lwr4plus_23_to_1" {
                signs.push(1);
            }
            let (before, rest) = study.split_once("\ntorque = {").unwrap();
            format!("{before}\ntorque = {{ sign = {signs:?},{rest}")
        }
    }
}

#[test]
fn one_reversed_joint_of_a_real_log_is_named() {
    if recordings().is_none() {
        return;
    }
    for (name, signs) in EXAMPLES {
        for joint in 0..signs.len().min(dynident_testing::count(1, signs.len())) {
            let folder = tempfile::tempdir().unwrap();
            let found = Job::new(folder.path(), &reversed(name, signs, joint)).identify().result;
            let named = &found.robot.joints[joint];
            let is_named =
                |problem: &String| problem.contains(&format!("`{named}`")) && problem.contains("opposite sign");
            assert!(found.problems.iter().any(is_named), "{name} {named}: {:?}", found.problems);
        }
    }
}
