//! Generated studies of unusual logs: read as meant, or written with a doubt that names the key.

use crate::common::{Random, repository};
use dynident::result::{NewStudyFile, Unsure};
use dynident::{NewStudy, RunOptions, Silent, XacroSettings, new_study};
use std::path::{Path, PathBuf};

/// Number of rows, and their rate, Hz.
const ROWS: u32 = 1500;
const RATE_HZ: f64 = 250.0;

/// Positions and torques of two joints in a row.
fn row(row: u32, random: &mut Random) -> [f64; 4] {
    let t = f64::from(row) / RATE_HZ;
    let q = [0.8 * (2.1 * t).sin() + 0.3 * (5.3 * t).cos(), 1.1 * (1.7 * t).cos() - 0.4 * (4.1 * t).sin()];
    let tau = [9.0 * q[0].sin() + 2.0 * (q[0] + q[1]).sin(), 2.0 * (q[0] + q[1]).sin()];
    [q[0], q[1], tau[0] + 0.05 * random.next(), tau[1] + 0.02 * random.next()]
}

/// A file with this header and these rows; each gets its number, and the positions and torques.
fn csv(folder: &Path, header: &str, line: impl Fn(u32, [f64; 4]) -> String) -> PathBuf {
    let mut random = Random(7);
    let path = folder.join("log.csv");
    let lines: String = (0..ROWS).map(|at| line(at, row(at, &mut random)) + "\n").collect();
    std::fs::write(&path, format!("{header}\n{lines}")).unwrap();
    path
}

/// A row with its time in seconds and these numbers.
fn timed(at: u32, values: &[f64]) -> String {
    let values: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
    format!("{:?},{}", f64::from(at) / RATE_HZ, values.join(","))
}

fn written(robot: &Path, logs: &[PathBuf]) -> NewStudyFile {
    let request = NewStudy {
        robot: robot.to_owned(),
        description: None,
        xacro: XacroSettings::default(),
        logs: logs.to_vec(),
        out: logs[0].parent().unwrap().join("study.toml"),
        rate_hz: None,
        stated: Vec::new(),
    };
    new_study(&request, &RunOptions { data: None, threads: 1, progress: &Silent }).unwrap()
}

fn planar() -> PathBuf {
    repository("robots/planar2r.urdf")
}

fn doubts(found: &NewStudyFile) -> String {
    found.unsure.iter().map(Unsure::sentence).collect::<Vec<_>>().join("\n")
}

fn has(found: &NewStudyFile, lines: &[&str]) {
    for line in lines {
        assert!(found.text.lines().any(|own| own == *line), "{line}\n{}", found.text);
    }
}

#[test]
fn measured_and_raw_columns_come_before_set_and_filtered_ones() {
    let folder = tempfile::tempdir().unwrap();
    for (header, columns) in [
        ("t,SetPos1,SetPos2,SetTrq1,SetTrq2,ActPos1,ActPos2,ActTrq1,ActTrq2", ["ActPos{1..2}", "ActTrq{1..2}"]),
        ("t,q_filtered1,q_filtered2,tau_filtered1,tau_filtered2,q1,q2,tau1,tau2", ["q{1..2}", "tau{1..2}"]),
        ("t,qdes1,qdes2,taudes1,taudes2,qfb1,qfb2,taufb1,taufb2", ["qfb{1..2}", "taufb{1..2}"]),
    ] {
        let log = csv(folder.path(), header, |at, [a, b, c, d]| timed(at, &[1.02 * a, b, 0.8 * c, d, a, b, c, d]));
        let found = written(&planar(), &[log]);
        has(&found, &columns.map(|columns| format!("columns = \"{columns}\"")).each_ref().map(String::as_str));
        assert!(!doubts(&found).contains("equally"), "{}", doubts(&found));
    }
    // Nothing in the names decides: a doubt, and torques of the same arm.
    let header = "t,one_q1,one_q2,two_q1,two_q2,two_tau1,two_tau2,one_tau1,one_tau2";
    let log =
        csv(folder.path(), header, |at, [a, b, c, d]| timed(at, &[a, b, 0.7 * a, 0.8 * b, 3.0 * c, 2.0 * d, c, d]));
    let found = written(&planar(), &[log]);
    has(&found, &["columns = \"one_q{1..2}\"", "columns = \"one_tau{1..2}\""]);
    assert!(doubts(&found).contains("two_q{1..2} may equally be meant"), "{}", doubts(&found));
}

#[test]
fn columns_without_a_quantity_are_assumed() {
    let folder = tempfile::tempdir().unwrap();
    let log = csv(folder.path(), "t,A1,A2,T1,T2", |at, values| timed(at, &values));
    let found = written(&planar(), &[log]);
    has(&found, &["columns = \"A{1..2}\"", "columns = \"T{1..2}\""]);
    for place in ["[format.position]", "[format.torque]"] {
        assert!(doubts(&found).contains(place), "{place}\n{}", doubts(&found));
    }
    // Torques of another numbering are those of the joints in order.
    let log = csv(folder.path(), "t,q0,q1,tau1,tau2", |at, values| timed(at, &values));
    has(&written(&planar(), &[log]), &["columns = \"q{0..1}\"", "columns = \"tau{1..2}\""]);
}

#[test]
fn a_file_for_each_quantity_needs_no_names() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(7);
    let rows: Vec<[f64; 4]> = (0..ROWS).map(|at| row(at, &mut random)).collect();
    let paths = [("q.csv", 0), ("tau.csv", 2)].map(|(name, at)| {
        let path = folder.path().join(name);
        let lines: Vec<String> = rows.iter().map(|row| format!("{:?},{:?}", row[at], row[at + 1])).collect();
        std::fs::write(&path, lines.join("\n")).unwrap();
        path
    });
    let found = written(&planar(), &paths);
    has(&found, &["columns = \"{0..1}\"", "file = \"tau.csv\""]);
    assert!(doubts(&found).contains("rate_hz"), "{}", doubts(&found));
}

#[test]
fn each_joint_has_the_unit_in_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let robot = folder.path().join("robot.urdf");
    let text = std::fs::read_to_string(planar()).unwrap();
    std::fs::write(&robot, text.replace("\"joint2\" type=\"revolute\"", "\"joint2\" type=\"prismatic\"")).unwrap();
    let line = |at, [a, b, c, d]: [f64; 4]| timed(at, &[a.to_degrees(), 1e3 * b, c, d]);
    let log = csv(folder.path(), "t,joint1_deg,joint2_mm,joint1_torque,joint2_torque", line);
    let found = written(&robot, &[log]);
    has(&found, &["columns = [\"joint1_deg\", \"joint2_mm\"]", "unit = [\"deg\", \"mm\"]"]);
    // Without units, their values show them, with a doubt.
    let found = written(&robot, &[csv(folder.path(), "t,q1,q2,tau1,tau2", line)]);
    has(&found, &["unit = [\"deg\", \"mm\"]"]);
    assert!(doubts(&found).contains("implausible in metres"), "{}", doubts(&found));
}

#[test]
fn repeated_and_missing_values_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let held = |at: u32, _| timed(at, &row(at / 5 * 5, &mut Random(u64::from(at / 5 + 1))));
    let found = written(&planar(), &[csv(folder.path(), "t,q1,q2,tau1,tau2", held)]);
    has(&found, &["keep_every = 5"]);
    let missing = |at: u32, values: [f64; 4]| {
        if at.is_multiple_of(3) { timed(at, &values) } else { timed(at, &values[..2]) + ",," }
    };
    let found = written(&planar(), &[csv(folder.path(), "t,q1,q2,tau1,tau2", missing)]);
    has(&found, &["missing = \"drop\"", "keep_every = 3"]);
    assert!(found.check.is_some() && doubts(&found).contains("keep_every"), "{}", doubts(&found));
}

#[test]
fn clocks_of_other_notations_are_recognised() {
    let folder = tempfile::tempdir().unwrap();
    let with = |stamp: fn(u32) -> String| {
        move |at: u32, values: [f64; 4]| {
            let values = timed(at, &values);
            format!("{},{}", stamp(at), values.split_once(',').unwrap().1)
        }
    };
    // Days since 1900.
    let days = |at: u32| format!("{:.12}", 45_356.5 + f64::from(at) / RATE_HZ / 86_400.0);
    let found = written(&planar(), &[csv(folder.path(), "Time,q1,q2,tau1,tau2", with(days))]);
    has(&found, &["time = { column = \"Time\", scale = 86400.0 }"]);
    // Rows or milliseconds.
    let found = written(&planar(), &[csv(folder.path(), "t,q1,q2,tau1,tau2", with(|at| at.to_string()))]);
    assert!(doubts(&found).contains("rate_hz"), "{}", doubts(&found));
    // Seconds and nanoseconds.
    let split = |at: u32| format!("{},{}", 1_718_000_000 + at / 250, at % 250 * 4_000_000);
    let found = written(&planar(), &[csv(folder.path(), "secs,nsecs,q1,q2,tau1,tau2", with(split))]);
    has(&found, &["time = { column = \"secs\" }"]);
    assert!(found.text.contains("# 250.0000 Hz"), "{}", found.text);
}

#[test]
fn a_log_that_check_cannot_use_is_a_doubt() {
    let folder = tempfile::tempdir().unwrap();
    let log = csv(folder.path(), "t,q1,q2,tau1,tau2", |at, values| {
        if at == 700 { "stopped,0,0,0,0".to_owned() } else { timed(at, &values) }
    });
    let found = written(&planar(), &[log]);
    has(&found, &["time = { column = \"t\" }"]);
    assert!(found.check.is_none() && doubts(&found).contains("log.csv:702"), "{}", doubts(&found));
}

/// Followers are links of the tree, but not joints of the log.
#[test]
fn a_joint_that_carries_others_is_found_next_to_followers() {
    let folder = tempfile::tempdir().unwrap();
    let link = |name: &str| {
        format!(
            "<link name=\"{name}\"><inertial><origin xyz=\"0.1 0 0\"/><mass value=\"1\"/>\
             <inertia ixx=\"0.01\" iyy=\"0.01\" izz=\"0.01\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link>"
        )
    };
    let joint = |name: &str, parent: &str, child: &str, more: &str| {
        format!(
            "<joint name=\"{name}\" type=\"continuous\"><parent link=\"{parent}\"/><child link=\"{child}\"/>\
             <origin xyz=\"0.3 0 0\"/><axis xyz=\"0 1 0\"/>{more}</joint>"
        )
    };
    let robot = folder.path().join("robot.urdf");
    let follows = "<mimic joint=\"joint1\" multiplier=\"0.5\"/>";
    let text = [
        "<robot name=\"arm\"><link name=\"base\"/>".to_owned(),
        ["follower", "link1", "link2"].map(link).concat(),
        joint("first", "base", "follower", follows),
        joint("joint1", "follower", "link1", ""),
        joint("joint2", "link1", "link2", ""),
        "</robot>".to_owned(),
    ];
    std::fs::write(&robot, text.concat()).unwrap();
    let log = csv(folder.path(), "t,joint1_pos,joint2_pos,joint1_torque,joint2_torque", |at, row| timed(at, &row));
    let found = written(&robot, &[log]);
    assert!(!doubts(&found).contains("has no column"), "{}", doubts(&found));
    let log = csv(folder.path(), "t,joint2_pos,other,joint2_torque,another", |at, row| timed(at, &row));
    assert!(doubts(&written(&robot, &[log])).contains("`joint1`"));
}
