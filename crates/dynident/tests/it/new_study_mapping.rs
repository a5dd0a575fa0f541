//! Generated studies: columns follow the names of joints, measured quantities are preferred, doubts are stated.

use crate::common::{Random, repository};
use dynident::result::{NewStudyFile, Unsure};
use dynident::{NewStudy, RunOptions, Silent, Study, XacroSettings, log_contents, new_study};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Time, positions and torques of two joints; the torques are those of a pendulum and noise.
pub(crate) fn rows() -> Vec<[f64; 5]> {
    let mut random = Random(5);
    (0..1500)
        .map(|row| {
            let t = f64::from(row) * 0.004;
            let q = [0.8 * (2.1 * t).sin() + 0.3 * (5.3 * t).cos(), 1.1 * (1.7 * t).cos() - 0.4 * (4.1 * t).sin()];
            let tau = [9.0 * q[0].sin() + 2.0 * (q[0] + q[1]).sin(), 2.0 * (q[0] + q[1]).sin()];
            [t, q[0], q[1], tau[0] + 0.05 * random.next(), tau[1] + 0.02 * random.next()]
        })
        .collect()
}

/// A file with these columns; each has the values of a column of [`rows`] with a factor.
fn csv(folder: &Path, columns: &[(&str, usize, f64)]) -> PathBuf {
    let path = folder.join("log.csv");
    let names: Vec<&str> = columns.iter().map(|(name, ..)| *name).collect();
    let mut text = names.join(",") + "\n";
    for row in rows() {
        let values: Vec<String> = columns.iter().map(|(_, at, factor)| format!("{:?}", row[*at] * factor)).collect();
        writeln!(text, "{}", values.join(",")).unwrap();
    }
    std::fs::write(&path, if names[0].is_empty() { text.split_once('\n').unwrap().1.to_owned() } else { text })
        .unwrap();
    path
}

/// A robot with two joints of these names.
pub(crate) fn robot(folder: &Path, names: [&str; 2]) -> PathBuf {
    let path = folder.join("robot.urdf");
    let text = std::fs::read_to_string(repository("robots/planar2r.urdf")).unwrap();
    std::fs::write(
        &path,
        text.replace("\"joint1\"", &format!("{:?}", names[0])).replace("\"joint2\"", &format!("{:?}", names[1])),
    )
    .unwrap();
    path
}

fn written(robot: &Path, log: &Path) -> Result<(NewStudyFile, Study), String> {
    written_of(robot, &[log.to_owned()])
}

pub(crate) fn written_of(robot: &Path, logs: &[PathBuf]) -> Result<(NewStudyFile, Study), String> {
    let request = NewStudy {
        robot: robot.to_owned(),
        description: None,
        xacro: XacroSettings::default(),
        logs: logs.to_vec(),
        out: logs[0].parent().unwrap().join("study.toml"),
        rate_hz: None,
        stated: Vec::new(),
    };
    let options = RunOptions { data: None, threads: 1, progress: &Silent };
    let found = new_study(&request, &options).map_err(|error| error.to_string())?;
    let study = Study::parse(&found.text, &request.out).unwrap_or_else(|error| panic!("{error}\n{}", found.text));
    Ok((found, study))
}

pub(crate) fn doubts(found: &NewStudyFile) -> String {
    found.unsure.iter().map(Unsure::sentence).collect::<Vec<_>>().join("\n")
}

#[test]
fn shuffled_columns_follow_the_names_of_joints() {
    let folder = tempfile::tempdir().unwrap();
    let robot = robot(folder.path(), ["A1", "A2"]);
    let columns = |names: [&'static str; 2]| {
        let all =
            [("position", 2, names[1]), ("position", 1, names[0]), ("effort", 4, names[1]), ("effort", 3, names[0])];
        let mut list = vec![("t".to_owned(), 0)];
        list.extend(all.map(|(what, at, joint)| (format!("{what}[{joint}]"), at)));
        list
    };
    let log = |names| {
        let columns = columns(names);
        csv(folder.path(), &columns.iter().map(|(name, at)| (name.as_str(), *at, 1.0)).collect::<Vec<_>>())
    };
    let (found, study) = written(&robot, &log(["A1", "A2"])).unwrap();
    let positions = study.format.as_ref().unwrap().position.column_list("columns").unwrap();
    assert_eq!(format!("{positions:?}"), "[Name(\"position[A1]\"), Name(\"position[A2]\")]", "{}", found.text);
    assert!(!doubts(&found).contains("joints"), "{}", doubts(&found));

    // Names of another numbering are matched by their numbers, and this is stated.
    let (found, study) = written(&robot, &log(["lbr_joint_0", "lbr_joint_1"])).unwrap();
    assert!(doubts(&found).contains("no joint `lbr_joint_1`") && found.text.contains("# UNSURE"), "{}", found.text);
    let joints = study.robot.joints.unwrap();
    let torques = study.format.unwrap().torque.unwrap().column_list("columns").unwrap();
    let at = joints.iter().position(|joint| joint == "A1").unwrap();
    assert_eq!(format!("{:?}", torques[at]), "Name(\"effort[lbr_joint_0]\")", "{}", found.text);
}

#[test]
fn the_order_of_a_message_is_not_used_silently() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    let mut writer = mcap::Writer::new(std::fs::File::create(&path).unwrap()).unwrap();
    let none = std::collections::BTreeMap::new();
    let channels = ["/plain", "/named"].map(|topic| writer.add_channel(0, topic, "json", &none).unwrap());
    for (row, [t, q1, q2, tau1, tau2]) in rows().into_iter().enumerate() {
        let (plain, named) =
            (format!("\"q\": [{q2:?}, {q1:?}], \"tau\": [{tau2:?}, {tau1:?}]"), "\"name\": [\"joint2\", \"joint1\"]");
        for (channel_id, data) in channels.into_iter().zip([format!("{{{plain}}}"), format!("{{{named}, {plain}}}")]) {
            let log_time = (t * 1e9) as u64;
            let header =
                mcap::records::MessageHeader { channel_id, sequence: row as u32, log_time, publish_time: log_time };
            writer.write_to_known_channel(&header, data.as_bytes()).unwrap();
        }
    }
    writer.finish().unwrap();
    // The names in the message come first.
    let robot = robot(folder.path(), ["joint1", "joint2"]);
    let (found, study) = written(&robot, &path).unwrap();
    let torques = study.format.unwrap().torque.unwrap().column_list("columns").unwrap();
    assert_eq!(
        format!("{torques:?}"),
        "[Name(\"/named.tau[joint1]\"), Name(\"/named.tau[joint2]\")]",
        "{}",
        found.text
    );
    assert!(!doubts(&found).contains("no joint names"), "{}", doubts(&found));
    let proposed = log_contents(&path).unwrap().study_format;
    assert!(
        proposed.contains("columns = \"/named.tau[{joint}]\"") || proposed.contains("no joint names"),
        "{proposed}"
    );

    // Without them, the order is a doubt.
    let mut writer = mcap::Writer::new(std::fs::File::create(&path).unwrap()).unwrap();
    let channel_id = writer.add_channel(0, "/plain", "json", &none).unwrap();
    for (row, [t, q1, q2, tau1, tau2]) in rows().into_iter().enumerate() {
        let log_time = (t * 1e9) as u64;
        let header =
            mcap::records::MessageHeader { channel_id, sequence: row as u32, log_time, publish_time: log_time };
        let data = format!("{{\"q\": [{q1:?}, {q2:?}], \"tau\": [{tau1:?}, {tau2:?}]}}");
        writer.write_to_known_channel(&header, data.as_bytes()).unwrap();
    }
    writer.finish().unwrap();
    let (found, _) = written(&robot, &path).unwrap();
    assert!(doubts(&found).contains("the message has no joint names"), "{}", found.text);
}

#[test]
fn every_joint_of_the_robot_in_the_log_is_used() {
    let folder = tempfile::tempdir().unwrap();
    let robot = robot(folder.path(), ["joint1", "jointGripper"]);
    let columns =
        [("t", 0), ("joint1.pos", 1), ("jointGripper.pos", 2), ("joint1.effort", 3), ("jointGripper.effort", 4)];
    let log = csv(folder.path(), &columns.map(|(name, at)| (name, at, 1.0)));
    let (found, study) = written(&robot, &log).unwrap();
    assert!(
        study.robot.joints.is_none() && study.format.unwrap().torque.unwrap().column_list("x").unwrap().len() == 2,
        "{}",
        found.text
    );
    // A joint that the robot does not have leaves a doubt, if a joint of the robot has no column.
    let unknown = columns.map(|(name, at)| {
        (
            if at == 2 {
                "finger.pos"
            } else if at == 4 {
                "finger.effort"
            } else {
                name
            },
            at,
            1.0,
        )
    });
    let (found, _) = written(&robot, &csv(folder.path(), &unknown)).unwrap();
    assert!(doubts(&found).contains("no joint `finger`"), "{}", found.text);
}

#[test]
fn measured_quantities_come_before_commanded_and_computed_ones() {
    let folder = tempfile::tempdir().unwrap();
    let robot = robot(folder.path(), ["joint1", "joint2"]);
    let log = csv(
        folder.path(),
        &[
            ("tt", 0, 1.0),
            ("q1", 1, 1.0),
            ("q2", 2, 1.0),
            ("vel1_deg", 1, 57.3),
            ("vel2_deg", 2, 57.3),
            ("tau_d1", 3, 1.1),
            ("tau_d2", 4, 1.1),
            ("tau_g1", 3, 0.9),
            ("tau_g2", 4, 0.9),
            ("tau_est1", 3, 0.9),
            ("tau_est2", 4, 0.9),
            ("current1", 3, 0.1),
            ("current2", 4, 0.1),
        ],
    );
    let (found, study) = written(&robot, &log).unwrap();
    let format = study.format.unwrap();
    assert_eq!(
        format!("{:?}", format.torque.as_ref().unwrap().columns),
        "Pattern(\"current{1..2}\")",
        "{}",
        found.text
    );
    for other in ["not used: commanded tau_d{1..2}", "computed tau_est{1..2}"] {
        assert!(found.text.contains(other), "{other}\n{}", found.text);
    }
    // The clock is found by its values; a velocity keeps the unit in its name.
    assert!(found.text.contains("time = { column = \"tt\" }") && found.text.contains("rises evenly"), "{}", found.text);
    assert_eq!(format!("{:?}", format.velocity.unwrap().unit), "Some(One(\"deg/s\"))", "{}", found.text);

    let message =
        written(&robot, &csv(folder.path(), &[("t", 0, 1.0), ("q1", 1, 1.0), ("q2", 2, 1.0), ("strom_a", 3, 1.0)]));
    let message = message.unwrap_err();
    assert!(
        message.contains("log.csv (4 columns) has unknown columns strom_a, and other columns of joints q{1..2}"),
        "{message}"
    );
}

/// The columns of the study in a second log are no alternative to them.
#[test]
fn equal_columns_of_two_logs_are_no_alternatives() {
    let folder = tempfile::tempdir().unwrap();
    let robot = robot(folder.path(), ["base", "elbow"]);
    let columns = [
        ("stamp_s", 0, 1.0),
        ("enc_base_rad", 1, 1.0),
        ("enc_elbow_rad", 2, 1.0),
        ("trq_base_Nm", 3, 1.0),
        ("trq_elbow_Nm", 4, 1.0),
    ];
    let first = csv(folder.path(), &columns);
    let second = folder.path().join("second.csv");
    std::fs::copy(&first, &second).unwrap();
    let (found, study) = written_of(&robot, &[first, second]).unwrap();
    assert!(found.text.contains("enc_base_rad") && study.log.len() == 2, "{}", found.text);
    assert!(!found.text.contains("not used"), "{}", found.text);
}

#[test]
fn columns_without_names_are_assigned_in_order() {
    let folder = tempfile::tempdir().unwrap();
    let robot = robot(folder.path(), ["joint1", "joint2"]);
    let log = csv(folder.path(), &[0, 1, 2, 3, 4].map(|at| ("", at, 1.0)));
    let (found, study) = written(&robot, &log).unwrap();
    let format = study.format.unwrap();
    assert_eq!(format!("{:?}", format.position.columns), "Pattern(\"{1..2}\")", "{}", found.text);
    assert_eq!(format!("{:?}", format.torque.as_ref().unwrap().columns), "Pattern(\"{3..4}\")", "{}", found.text);
    assert!(found.text.contains("time = { column = \"0\" }") && found.check.is_some(), "{}", found.text);
    for place in ["format.position", "format.torque"] {
        assert!(doubts(&found).contains(place), "{}", doubts(&found));
    }
}
