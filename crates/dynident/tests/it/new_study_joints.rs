//! Generated studies: joints without torque, grippers, second arms, and files of several runs.

use crate::new_study_files::{file, robot_with_joints_and_finger};
use crate::new_study_mapping::{doubts, robot, written_of};
use dynident::result::NewStudyFile;
use dynident::{RunOptions, Silent, Study, log_contents};
use dynident_recording::Level;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

const ARM: [&str; 2] = ["arm_joint1", "arm_joint2"];

/// The position of a gripper between these values.
fn gripper(t: f64, [low, high]: [f64; 2]) -> f64 {
    0.5 * (low + high) + 0.5 * (high - low) * (1.3 * t).sin()
}

/// Names of the columns of positions and of torques.
fn columns(study: &Study) -> [Vec<String>; 2] {
    let format = study.format.as_ref().unwrap();
    [&format.position, format.torque.as_ref().unwrap()].map(|group| {
        let text = format!("{:?}", group.column_list("columns").unwrap());
        text.split('"').skip(1).step_by(2).map(str::to_owned).collect()
    })
}

/// Asserts that the study uses these columns for each joint, in any order.
fn assert_pairs(found: &NewStudyFile, study: &Study, expected: [[&str; 3]; 2]) {
    let joints = study.robot.joints.clone().unwrap_or_else(|| ARM.map(str::to_owned).to_vec());
    let [position, torque] = columns(study);
    let mut pairs: Vec<[String; 3]> =
        (0..joints.len()).map(|at| [joints[at].clone(), position[at].clone(), torque[at].clone()]).collect();
    pairs.sort();
    assert_eq!(pairs, expected.map(|pair| pair.map(str::to_owned)), "{}", found.text);
}

/// The finger has no torque: it is locked, and the torques of the arm are used, although the log has commands too.
#[test]
fn torques_of_an_arm_are_used_without_that_of_its_gripper() {
    let folder = tempfile::tempdir().unwrap();
    let robot = robot_with_joints_and_finger(folder.path(), ARM);
    let log = |header: &str, range: [f64; 2]| {
        file(folder.path(), "log.csv", &format!("{header}\n"), |_, [t, q1, q2, tau1, tau2]| {
            let own = gripper(t, range);
            format!("{t},{q1},{q2},{own},{tau1},{tau2},{q1},{q2},{own}\n")
        })
    };
    let lerobot = "t,observation.state[joint_1],observation.state[joint_2],observation.state[gripper],\
                   observation.effort[joint_1],observation.effort[joint_2],action[joint_1],action[joint_2],action[gripper]";
    let expected = |position: [&'static str; 2], torque: [&'static str; 2]| {
        [0, 1].map(|at: usize| [ARM[at], position[at], torque[at]])
    };
    let (found, study) = written_of(&robot, &[log(lerobot, [5.0, 45.0])]).unwrap();
    let [position, torque] = ["state", "effort"]
        .map(|what| [1, 2].map(|joint| -> &'static str { format!("observation.{what}[joint_{joint}]").leak() }));
    assert_pairs(&found, &study, expected(position, torque));
    assert!(study.format.as_ref().unwrap().command.is_none(), "{}", found.text);
    assert!(!found.text.contains("no signed torque"), "{}", found.text);
    // Percent of the range from 0 to 0.04 m.
    assert!((study.robot.lock["finger.left"] - 0.01).abs() < 1e-4, "{}", found.text);
    assert!(doubts(&found).contains("a share of its range"), "{}", doubts(&found));

    // Columns of a text table, and a finger in metres.
    let plain = "t,joint1_pos,joint2_pos,gripper_pos,joint1_effort,joint2_effort,joint1_cmd,joint2_cmd,gripper_cmd";
    let (found, study) = written_of(&robot, &[log(plain, [0.01, 0.03])]).unwrap();
    assert_pairs(&found, &study, expected(["joint1_pos", "joint2_pos"], ["joint1_effort", "joint2_effort"]));
    assert!((study.robot.lock["finger.left"] - 0.02).abs() < 1e-4, "{}", found.text);
    assert!(!doubts(&found).contains("lock"), "{}", doubts(&found));
}

/// Torques of one joint of three, or of a joint that another one carries, are not those of the robot.
#[test]
fn torques_of_few_joints_are_named_next_to_commands() {
    let folder = tempfile::tempdir().unwrap();
    let robot = robot_with_joints_and_finger(folder.path(), ARM);
    let header = "t,q[arm_joint1],q[arm_joint2],q[finger.left],tau[arm_joint2],cmd[arm_joint1],cmd[arm_joint2],cmd[finger.left]\n";
    let log = file(folder.path(), "log.csv", header, |_, [t, q1, q2, _, tau2]| {
        let own = gripper(t, [0.01, 0.03]);
        format!("{t},{q1},{q2},{own},{tau2},{q1},{q2},{own}\n")
    });
    let (found, study) = written_of(&robot, &[log]).unwrap();
    assert!(study.format.unwrap().torque.is_none(), "{}", found.text);
    assert!(!found.text.contains("no signed torque") && found.text.contains("tau[arm_joint2]"), "{}", found.text);
}

/// Numbers in the names decide, in any order of the columns, although the gripper matches the finger only by its kind.
#[test]
fn a_gripper_does_not_hide_the_numbers_of_the_joints() {
    let folder = tempfile::tempdir().unwrap();
    let robot = robot_with_joints_and_finger(folder.path(), ARM);
    for order in [["joint_2", "joint_1", "gripper"], ["gripper", "joint_1", "joint_2"]] {
        let names = |feature: &str, suffix: &str| {
            order.map(|joint| format!("observation.{feature}[{joint}.{suffix}]")).join(",")
        };
        let header = format!("t,{},{}\n", names("state", "pos"), names("effort", "effort"));
        let log = file(folder.path(), "log.csv", &header, |_, [t, q1, q2, tau1, tau2]| {
            let value = |joint: &str, values: [f64; 3]| match joint {
                "joint_1" => values[0],
                "joint_2" => values[1],
                _ => values[2],
            };
            let mut line = format!("{t}");
            let own = gripper(t, [5.0, 45.0]);
            for joint in &order {
                write!(line, ",{}", value(joint, [q1, q2, own])).unwrap();
            }
            for joint in &order {
                write!(line, ",{}", value(joint, [tau1, tau2, 0.1 * own.sin()])).unwrap();
            }
            line + "\n"
        });
        let (found, study) = written_of(&robot, &[log]).unwrap();
        let expected = [1, 2].map(|joint| {
            let [position, torque] = [("state", "pos"), ("effort", "effort")]
                .map(|(what, suffix)| format!("observation.{what}[joint_{joint}.{suffix}]"));
            [format!("arm_joint{joint}"), position, torque]
        });
        assert_pairs(&found, &study, expected.each_ref().map(|pair| pair.each_ref().map(String::as_str)));
        assert!(!found.text.contains("in their order in the log"), "{}", found.text);
        assert!((study.robot.lock["finger.left"] - 0.01).abs() < 1e-4, "{}", found.text);
    }
}

fn two_arms(folder: &Path) -> PathBuf {
    let names = |feature: &str| {
        let joints = ["left_joint_1", "left_joint_2", "right_joint_1", "right_joint_2"];
        joints.map(|joint| format!("observation.{feature}[{joint}.pos]")).join(",")
    };
    let header = format!("t,{},{}\n", names("state"), names("effort").replace(".pos", ".effort"));
    file(folder, "log.csv", &header, |_, [t, q1, q2, tau1, tau2]| {
        format!("{t},{q1},{q2},{q2},{q1},{tau1},{tau2},{tau2},{tau1}\n")
    })
}

#[test]
fn the_arm_of_the_robot_is_selected_among_two() {
    let folder = tempfile::tempdir().unwrap();
    let log = two_arms(folder.path());
    for (side, other) in [("left", "right"), ("right", "left")] {
        let joints = [1, 2].map(|joint| format!("arm_{side}_joint{joint}"));
        let robot = robot(folder.path(), joints.each_ref().map(String::as_str));
        let (found, study) = written_of(&robot, core::slice::from_ref(&log)).unwrap();
        let [position, torque] = columns(&study);
        let expected = |what: &str, suffix: &str| {
            [1, 2].map(|joint| format!("observation.{what}[{side}_joint_{joint}.{suffix}]")).to_vec()
        };
        assert_eq!([position, torque], [expected("state", "pos"), expected("effort", "effort")], "{}", found.text);
        assert!(found.text.contains(&format!("{other}_joint_1")), "{}", found.text);
    }
    // The names of this robot do not decide, so the message has the line.
    let message = written_of(&robot(folder.path(), ARM), &[log]).unwrap_err();
    assert!(message.contains("columns = \"observation.state[left_joint_{1..2}.pos]\""), "{message}");
}

/// Files of several runs in one folder, each with its own number of rows.
#[test]
fn files_of_joints_are_grouped_by_run() {
    let folder = tempfile::tempdir().unwrap();
    let robot = robot(folder.path(), ["pan_joint", "lift_joint"]);
    let mut logs = Vec::new();
    for (run, own) in [("a", 0..500), ("b", 500..usize::MAX)] {
        for (at, joint) in ["pan_joint", "lift_joint"].into_iter().enumerate() {
            let line = |row, values: [f64; 5]| {
                if own.contains(&row) {
                    format!("{},{},{}\n", values[0], values[1 + at], values[3 + at])
                } else {
                    String::new()
                }
            };
            logs.push(file(folder.path(), &format!("run_{run}_{joint}.csv"), "t,q,tau\n", line));
        }
    }
    let (found, study) = written_of(&robot, &logs).unwrap();
    assert_eq!(study.log.len(), 2, "{}", found.text);
    for (log, run) in ["a", "b"].into_iter().enumerate() {
        let format = study.format_of(log);
        for group in [&format.position, format.torque.as_ref().unwrap()] {
            let expected = format!("run_{run}_{{joint}}.csv");
            assert_eq!(group.file.as_deref(), Some(Path::new(&expected)), "{}", found.text);
        }
        assert!(study.log[log].file.to_string_lossy().contains(&format!("run_{run}_")), "{}", found.text);
    }
    let check = found.check.as_ref().unwrap_or_else(|| panic!("{}", doubts(&found)));
    assert_eq!(check.joints.len(), 2, "{}", found.text);
}

/// `joint_names` of an archive decides the order; names that are Python objects leave a doubt.
#[test]
fn names_in_an_archive_of_arrays_are_used() {
    let golden = crate::common::repository("golden/formats");
    let folder = tempfile::tempdir().unwrap();
    let robot = robot(folder.path(), ["elbow", "shoulder"]);
    let format = log_contents(&golden.join("named.npz")).unwrap().study_format;
    assert!(format.contains("\"q[{joint}]\"") && format.contains("\"tau[{joint}]\""), "{format}");
    let copy = |name: &str| {
        let path = folder.path().join(name);
        std::fs::copy(golden.join(name), &path).unwrap();
        path
    };
    let (found, study) = written_of(&robot, &[copy("named.npz")]).unwrap();
    assert_eq!(columns(&study)[1], ["tau[elbow]", "tau[shoulder]"], "{}", found.text);
    let (found, _) = written_of(&robot, &[copy("named_objects.npz")]).unwrap();
    assert!(doubts(&found).contains("joint_names: Python objects"), "{}", doubts(&found));
}

/// A robot that is not fixed: `new`, `check` and `identify` warn as `inspect` does.
#[test]
fn a_floating_base_is_a_warning_of_each_command() {
    let folder = tempfile::tempdir().unwrap();
    let robot = folder.path().join("robot.xml");
    std::fs::write(
        &robot,
        r#"<mujoco><worldbody><body name="torso"><freejoint/><inertial pos="0 0 0" mass="9" diaginertia="1 1 1"/>
        <body name="link1"><joint name="joint1" axis="0 1 0" range="-172 172"/>
        <inertial pos="0.25 0 0" mass="2" diaginertia="0.002 0.042 0.042"/>
        <body name="link2" pos="0.5 0 0"><joint name="joint2" axis="0 1 0" range="-160 160"/>
        <inertial pos="0.2 0 0" mass="1.5" diaginertia="0.0015 0.02 0.02"/></body></body></body></worldbody></mujoco>"#,
    )
    .unwrap();
    let line = |_, [t, q1, q2, tau1, tau2]: [f64; 5]| format!("{t},{q1},{q2},{tau1},{tau2}\n");
    let log = file(folder.path(), "log.csv", "t,q1,q2,tau1,tau2\n", line);
    let (found, study) = written_of(&robot, &[log]).unwrap();
    assert!(found.text.contains("body `torso` has a free joint"), "{}", found.text);
    let is_warning = |finding: &&dynident::result::CheckFinding| {
        finding.level == Level::Warning && finding.what.contains("body `torso` has a free joint")
    };
    assert_eq!(found.check.unwrap().findings.iter().filter(is_warning).count(), 1);
    let options = RunOptions { data: None, threads: 1, progress: &Silent };
    let result = dynident::identify(&study, &folder.path().join("study.toml"), &options).unwrap();
    assert_eq!(result.result.check.as_ref().unwrap().findings.iter().filter(is_warning).count(), 1);
    assert!(result.report().unwrap().contains("has a free joint"));
}
