//! Generated studies for files as other tools write them: preambles, several files, still joints.

use crate::new_study_mapping::{doubts, robot, rows, written_of};
use dynident::Study;
use dynident::result::NewStudyFile;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// A line of a study with a doubt about its columns or joints. The torques of [`rows`] are not those of these robots,
/// so `check` may have doubts too.
const MARK: &str = "# UNSURE:";

/// A file with this text and a line for each of [`rows`].
pub(crate) fn file(folder: &Path, name: &str, before: &str, line: impl Fn(usize, [f64; 5]) -> String) -> PathBuf {
    let path = folder.join(name);
    let mut text = before.to_owned();
    for (row, values) in rows().into_iter().enumerate() {
        text.push_str(&line(row, values));
    }
    std::fs::write(&path, text).unwrap();
    path
}

fn written(robot: &Path, log: PathBuf) -> (NewStudyFile, Study) {
    written_of(robot, &[log]).unwrap()
}

fn columns(study: &Study) -> [String; 2] {
    let format = study.format.as_ref().unwrap();
    [&format.position, format.torque.as_ref().unwrap()]
        .map(|group| format!("{:?}", group.column_list("columns").unwrap()))
}

/// The planar robot with a sliding finger.
fn robot_with_finger(folder: &Path) -> PathBuf {
    robot_with_joints_and_finger(folder, ["joint1", "joint2"])
}

/// The planar robot with joints of these names and a sliding finger.
pub(crate) fn robot_with_joints_and_finger(folder: &Path, names: [&str; 2]) -> PathBuf {
    let path = robot(folder, names);
    let finger = r#"<joint name="finger.left" type="prismatic"><parent link="link2"/><child link="tip"/>
        <origin xyz="0.4 0 0"/><axis xyz="0 1 0"/><limit effort="5" lower="0" upper="0.04" velocity="1"/></joint>
        <link name="tip"><inertial><mass value="0.1"/><inertia ixx="1e-5" ixy="0" ixz="0" iyy="1e-5" iyz="0" izz="1e-5"/>
        </inertial></link></robot>"#;
    std::fs::write(&path, std::fs::read_to_string(&path).unwrap().replace("</robot>", finger)).unwrap();
    path
}

#[test]
fn lines_above_a_table_are_skipped() {
    let folder = tempfile::tempdir().unwrap();
    let robot = robot(folder.path(), ["joint1", "joint2"]);
    let line = |_, [t, q1, q2, tau1, tau2]: [f64; 5]| format!("{t}\t{q1}\t{q2}\t{tau1}\t{tau2}\n");
    let preamble = "LabVIEW Measurement\t\nSeparator\tTab\n***End_of_Header***\t\n\t\nChannels\t4\t\nSamples\t9\t9\t9\t9\t\n***End_of_Header***\t\n";
    let names = "X_Value\tq1\tq2\ttau1\ttau2";
    let (found, study) = written(&robot, file(folder.path(), "a.lvm", &format!("{preamble}{names}\tComment\n"), line));
    let expected = ["[Name(\"q1\"), Name(\"q2\")]", "[Name(\"tau1\"), Name(\"tau2\")]"];
    assert_eq!(columns(&study), expected.map(str::to_owned), "{}", found.text);
    assert!(!found.text.contains(MARK), "{}", found.text);
    assert!(found.text.contains("time = { column = \"X_Value\" }"), "{}", found.text);

    // Names in a comment, and channels with their own stamps.
    let (_, study) = written(&robot, file(folder.path(), "b.dat", "# a run\n# t\tq1\tq2\ttau1\ttau2\n", line));
    assert_eq!(columns(&study), expected.map(str::to_owned));
    let scope = "Name\tScope\n\nName\tAct.q1\tName\tAct.q2\tName\tAct.tau1\tName\tAct.tau2\nSampleTime[ms]\t4\tSampleTime[ms]\t4\tSampleTime[ms]\t4\tSampleTime[ms]\t4\n\n";
    let line = |_, [t, q1, q2, tau1, tau2]: [f64; 5]| {
        let t = 1e3 * t;
        format!("{t:.3}\t{q1}\t{t:.3}\t{q2}\t{t:.3}\t{tau1}\t{t:.3}\t{tau2}\n")
    };
    let (found, study) = written(&robot, file(folder.path(), "c.csv", scope, line));
    assert_eq!(columns(&study)[1], "[Name(\"Act.tau1\"), Name(\"Act.tau2\")]");
    assert!(found.text.contains("time = { column = \"Name\", unit = \"ms\" }"), "{}", found.text);
}

#[test]
fn printed_messages_are_read_by_their_joint_names() {
    let folder = tempfile::tempdir().unwrap();
    let robot = robot(folder.path(), ["b_joint", "a_joint"]);
    let line = |_, [t, q1, q2, tau1, tau2]: [f64; 5]| {
        let (sec, nanosec) = (1_718_000_000 + t as u64, (t.fract() * 1e9).round());
        format!("{sec},{nanosec},base,a_joint,b_joint,{q2},{q1},0.0,0.0,{tau2},{tau1}\n")
    };
    let (found, study) = written(&robot, file(folder.path(), "echo.csv", "", line));
    let expected = ["position", "effort"].map(|what| format!("[Name(\"{what}[b_joint]\"), Name(\"{what}[a_joint]\")]"));
    assert_eq!(columns(&study), expected, "{}", found.text);
    assert!(found.text.contains("time = { column = \"sec\" }"), "{}", found.text);
}

#[test]
fn a_file_for_each_joint_is_one_recording() {
    let folder = tempfile::tempdir().unwrap();
    let robot = robot(folder.path(), ["joint1", "joint2"]);
    let logs: Vec<PathBuf> = (0..2)
        .map(|joint| {
            let line = |_, row: [f64; 5]| format!("{},{},{}\n", row[0], row[1 + joint], row[3 + joint]);
            file(folder.path(), &format!("axis{}.csv", joint + 1), "t,position,torque\n", line)
        })
        .collect();
    let (found, study) = written_of(&robot, &logs).unwrap();
    let format = study.format.as_ref().unwrap();
    for group in [&format.position, format.torque.as_ref().unwrap()] {
        assert_eq!(group.file.as_deref(), Some(Path::new("axis{1..2}.csv")), "{}", found.text);
    }
    assert_eq!(study.log.len(), 2, "{}", found.text);
    assert!(found.check.is_some() && !found.text.contains(MARK), "{}", found.text);
    // Files of different length are separate recordings, which are not those of one arm.
    std::fs::write(&logs[1], "t,position,torque\n0,0,0\n").unwrap();
    let (found, _) = written_of(&robot, &logs).unwrap();
    assert!(doubts(&found).contains("1 columns for 2 joints"), "{}", found.text);
}

#[test]
fn a_finger_that_stands_still_is_locked_where_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let robot = robot_with_finger(folder.path());
    let names = ["joint1", "joint2", "finger.left"];
    let header = format!(
        "t,{}\n",
        ["pos", "effort"].map(|what| names.map(|joint| format!("{joint}/{what}")).join(",")).join(",")
    );
    let log = |finger: f64, torque: f64| {
        file(folder.path(), "log.csv", &header, |row, [t, q1, q2, tau1, tau2]| {
            let noise = if row % 2 == 0 { 1e-5 } else { 0.0 };
            format!("{t},{q1},{q2},{},{tau1},{tau2},{}\n", 0.02 + noise + finger * t, torque * t)
        })
    };
    let (found, study) = written(&robot, log(0.0, 0.0));
    assert_eq!(study.robot.joints.as_deref(), Some(&["joint1", "joint2"].map(str::to_owned)[..]), "{}", found.text);
    assert!((study.robot.lock["finger.left"] - 0.020_005).abs() < 1e-9, "{}", found.text);
    assert!(found.text.contains("constant in all recordings") && !found.text.contains(MARK), "{}", found.text);
    // A finger that moves, or whose torque changes, is identified.
    for (finger, torque) in [(0.002, 0.0), (0.0, 1.0)] {
        let (found, study) = written(&robot, log(finger, torque));
        assert!(study.robot.lock.is_empty() && found.text.contains("finger.left/pos"), "{}", found.text);
    }
}

#[test]
fn a_joint_that_carries_others_is_locked_with_a_doubt() {
    let folder = tempfile::tempdir().unwrap();
    let robot = robot(folder.path(), ["joint1", "joint2"]);
    let line = |_, [t, _, q2, _, tau2]: [f64; 5]| format!("{t},0.5,{q2},3.0,{tau2}\n");
    let (found, study) = written(&robot, file(folder.path(), "log.csv", "t,q1,q2,tau1,tau2\n", line));
    assert_eq!(study.robot.lock["joint1"], 0.5, "{}", found.text);
    assert!(doubts(&found).contains("its channels are dead"), "{}", found.text);
}

#[test]
fn a_joint_of_another_publisher_is_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let robot = robot_with_finger(folder.path());
    // The robot description has no right finger.
    let names = ["joint1", "joint2", "finger.left", "finger_right"];
    let columns = ["pos", "effort"].map(|what| names.map(|joint| format!("{joint}/{what}")).join(","));
    let header = format!("t,{}\n", columns.join(","));
    let log = file(folder.path(), "log.csv", &header, |row, [t, q1, q2, tau1, tau2]| match row % 5 {
        4 => format!("{t},,,0.03,0.03,,,0.0,0.0\n"),
        _ => format!("{t},{q1},{q2},,,{tau1},{tau2},,\n"),
    });
    let (found, study) = written(&robot, log);
    assert_eq!(study.robot.joints.as_deref(), Some(&["joint1", "joint2"].map(str::to_owned)[..]), "{}", found.text);
    assert_eq!(study.robot.lock["finger.left"], 0.03, "{}", found.text);
    assert!(!found.text.contains(MARK), "{}", found.text);
}

#[test]
fn names_of_joints_alone_are_positions_next_to_their_torques() {
    let folder = tempfile::tempdir().unwrap();
    let robot = robot_with_finger(folder.path());
    let line = |_, [t, q1, q2, tau1, tau2]: [f64; 5]| format!("{t},{q2},{q1},{tau1},{tau2}\n");
    let header = "t,joint2,joint1,torque_joint1,torque_joint2\n";
    let (found, study) = written(&robot, file(folder.path(), "log.csv", header, line));
    assert_eq!(columns(&study)[0], "[Name(\"joint1\"), Name(\"joint2\")]", "{}", found.text);
    assert!(!found.text.contains(MARK), "{}", found.text);
}

#[test]
fn the_entries_of_one_matrix_have_no_names() {
    let folder = tempfile::tempdir().unwrap();
    let robot = robot(folder.path(), ["joint1", "joint2"]);
    let path = folder.path().join("log.jsonl");
    let mut text = String::new();
    for row in rows() {
        writeln!(text, "{{\"M\": {row:?}}}").unwrap();
    }
    std::fs::write(&path, text).unwrap();
    let (found, study) = written(&robot, path);
    assert_eq!(columns(&study)[1], "[Name(\"M[3]\"), Name(\"M[4]\")]", "{}", found.text);
    assert!(doubts(&found).contains("the columns have no names"), "{}", found.text);
}

#[test]
fn jumps_are_named_where_they_leave_too_few_samples() {
    let folder = tempfile::tempdir().unwrap();
    let robot = robot(folder.path(), ["joint1", "joint2"]);
    let line = |_, [t, q1, q2, tau1, tau2]: [f64; 5]| {
        let wrapped = |q: f64| (4.0 * q).to_degrees().rem_euclid(360.0);
        format!("{t},{},{},{tau1},{tau2}\n", wrapped(q1), wrapped(q2))
    };
    let (found, _) = written(&robot, file(folder.path(), "log.csv", "t,q1_deg,q2_deg,tau1,tau2\n", line));
    assert!(doubts(&found).contains("wrap"), "{}", doubts(&found));
}
