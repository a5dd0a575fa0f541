//! Logs with commanded positions in place of torques: `new`, `log` and `check`.

use crate::common::{recordings, repository};
use core::f64::consts::{PI, TAU};
use dynident::recording::Level;
use dynident::result::{NewStudyFile, StudyChange, StudyCheck};
use dynident::{NewStudy, RunOptions, Silent, Study, XacroSettings, check, log_contents, new_study};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

const COUNT: f64 = TAU / 4096.0;
const OPTIONS: RunOptions<'_> = RunOptions { data: None, threads: 1, progress: &Silent };

/// Time, two positions and two commands: first-order responses at 50 Hz to the command 40 ms earlier, in counts.
fn rows() -> Vec<[f64; 5]> {
    let command = |joint: usize, row: usize| {
        let t = row as f64 * 0.02;
        0.4 * (t * (1.1 + 0.3 * joint as f64)).sin() + if (row / 170).is_multiple_of(2) { 0.1 } else { -0.1 }
    };
    let mut q = [command(0, 0), command(1, 0)];
    (0..1500_usize)
        .map(|row| {
            for (joint, q) in q.iter_mut().enumerate() {
                *q += 0.25 * (command(joint, row.saturating_sub(2)) - *q);
            }
            let counted = q.map(|q| (q / COUNT).round() * COUNT);
            [row as f64 * 0.02, counted[0], counted[1], command(0, row), command(1, row)]
        })
        .collect()
}

fn csv(folder: &Path, header: &str, change: impl Fn(&mut [f64; 5])) -> PathBuf {
    let path = folder.join("log.csv");
    let mut text = format!("{header}\n");
    for mut row in rows() {
        change(&mut row);
        writeln!(text, "{}", row.map(|value| format!("{value:?}")).join(",")).unwrap();
    }
    std::fs::write(&path, text).unwrap();
    path
}

fn written(folder: &Path, robot: PathBuf, logs: Vec<PathBuf>) -> (NewStudyFile, Study) {
    let request = NewStudy {
        robot,
        description: None,
        xacro: XacroSettings::default(),
        logs,
        out: folder.join("study.toml"),
        rate_hz: None,
        stated: Vec::new(),
    };
    let found = new_study(&request, &OPTIONS).unwrap();
    let study = Study::parse(&found.text, &request.out).unwrap_or_else(|error| panic!("{error}\n{}", found.text));
    (found, study)
}

#[test]
fn a_log_without_torque_gives_a_study_with_commands() {
    let robot = repository("robots/planar2r.urdf");
    for header in [
        "t,q1,q2,cmd1,cmd2",
        "t,actual_q_0,actual_q_1,target_q_0,target_q_1",
        "t,q_1,q_2,goal_position_1,goal_position_2",
        "timestamp,observation.state[a.pos],observation.state[b.pos],action[a.pos],action[b.pos]",
    ] {
        let folder = tempfile::tempdir().unwrap();
        let log = csv(folder.path(), header, |_| {});
        let (found, study) = written(folder.path(), robot.clone(), vec![log.clone()]);
        let format = study.format.unwrap();
        let names: Vec<&str> = header.split(',').collect();
        let expected = |from: usize| format!("{:?}", &names[from..from + 2]);
        let columns = |group: &dynident::recording::log::ChannelGroup| {
            let list = group.column_list("columns").unwrap();
            let name = |column: &dynident::recording::log::ColumnRef| match column {
                dynident::recording::log::ColumnRef::Name(name) => name.clone(),
                dynident::recording::log::ColumnRef::Index(index) => index.to_string(),
            };
            format!("{:?}", list.iter().map(name).collect::<Vec<_>>())
        };
        assert!(format.torque.is_none(), "{}", found.text);
        assert_eq!(columns(&format.position), expected(1), "{}", found.text);
        assert_eq!(columns(format.command.as_ref().unwrap()), expected(3), "{}", found.text);
        let check = found.check.unwrap();
        assert!(check.findings.iter().all(|finding| finding.kind == "description"), "{:?}", check.findings);
        // `log` proposes the same.
        let proposed = log_contents(&log).unwrap().study_format;
        assert!(proposed.contains("\ncommand = {") && !proposed.contains("torque"), "{proposed}");
    }
}

#[test]
fn the_size_of_a_current_without_its_sign_is_no_torque() {
    let folder = tempfile::tempdir().unwrap();
    let log = csv(folder.path(), "t,q1,q2,current1,current2", |row| {
        row[3] = row[3].abs();
        row[4] = row[4].abs();
    });
    // Without commands, currents are used as before.
    assert!(log_contents(&log).unwrap().study_format.contains("torque = { columns = \"current{1..2}\""));
    let text = std::fs::read_to_string(&log).unwrap();
    let text: String = text
        .lines()
        .map(|line| {
            let values: Vec<&str> = line.split(',').collect();
            if line.starts_with('t') {
                format!("{line},cmd1,cmd2\n")
            } else {
                format!("{line},{},{}\n", values[1], values[2])
            }
        })
        .collect();
    std::fs::write(&log, text).unwrap();
    let (found, study) = written(folder.path(), repository("robots/planar2r.urdf"), vec![log]);
    assert!(study.format.unwrap().torque.is_none() && found.text.contains("current"), "{}", found.text);
}

/// Findings of a study about the log in `folder`.
fn checked(folder: &Path, format: &str) -> StudyCheck {
    let robot = repository("robots/planar2r.urdf");
    let text = format!(
        "[robot]\nfile = \"{}\"\n\n[[log]]\nfile = \"log.csv\"\n\n[format]\ntime = {{ column = \"t\" }}\n{format}",
        robot.display()
    );
    let path = folder.join("study.toml");
    check(&Study::parse(&text, &path).unwrap(), &path, &OPTIONS).unwrap().check
}

const FORMAT: &str = "[format.position]\ncolumns = \"q{1..2}\"\n\n[format.command]\ncolumns = \"r{1..2}\"\n";

fn of_commands(check: &StudyCheck) -> Vec<(&str, Level, &[StudyChange])> {
    let own = check.findings.iter().filter(|finding| finding.kind != "description");
    own.map(|finding| (&finding.kind[..], finding.level, &finding.write[..])).collect()
}

/// Each mistake is found with the keys that correct it, and the corrected study has no finding.
#[test]
fn mistakes_are_corrected_by_the_printed_keys() {
    type Change = fn(&mut [f64; 5]);
    type Case<'a> = (&'a str, Change, &'a [(&'a str, &'a str)]);
    let cases: [Case<'_>; 5] = [
        ("sign", |row| row[4] = -row[4], &[("format.command", "sign = [1, -1]")]),
        ("offset", |row| row[3] -= 0.5, &[("format.command", "offset = [0.5, 0.0]")]),
        ("unit", |row| row.iter_mut().skip(3).for_each(|r| *r *= 180.0 / PI), &[("format.command", "unit = \"deg\"")]),
        ("unit", |row| row[1] *= 180.0 / PI, &[("format.position", "unit = [\"deg\", \"rad\"]")]),
        (
            "command",
            |row| {
                row.swap(1, 3);
                row.swap(2, 4);
            },
            &[("format.position", "columns = \"r{1..2}\""), ("format.command", "columns = \"q{1..2}\"")],
        ),
    ];
    for (kind, change, keys) in cases {
        let folder = tempfile::tempdir().unwrap();
        csv(folder.path(), "t,q1,q2,r1,r2", change);
        let found = checked(folder.path(), FORMAT);
        let [(own, _, write)] = of_commands(&found)[..] else { panic!("{kind}: {:?}", found.findings) };
        assert_eq!(own, kind);
        assert_eq!(write.len(), keys.len(), "{write:?}");
        let mut corrected = FORMAT.to_owned();
        for (change, (table, line)) in write.iter().zip(keys) {
            assert_eq!(change.table, *table);
            if kind == "offset" {
                let value: f64 = change.line.split(['[', ',']).nth(1).unwrap().parse().unwrap();
                assert!((value - 0.5).abs() < 0.02, "{}", change.line);
            } else {
                assert_eq!(change.line, *line);
            }
            let heading = format!("[{table}]\n");
            let (before, after) = corrected.split_once(&heading).unwrap();
            let rest = if line.starts_with("columns") { after.split_once('\n').unwrap().1 } else { after };
            corrected = format!("{before}{heading}{}\n{rest}", change.line);
        }
        let after = checked(folder.path(), &corrected);
        assert!(of_commands(&after).is_empty(), "{kind}: {:?}", after.findings);
    }
}

#[test]
fn clamped_commands_and_jumps_name_log_and_time() {
    let folder = tempfile::tempdir().unwrap();
    csv(folder.path(), "t,q1,q2,r1,r2", |row| {
        row[1] = row[1].max(-0.2);
        row[2] += if row[0] > 15.0 { TAU } else { 0.0 };
    });
    let found = checked(folder.path(), FORMAT);
    let sentences: Vec<String> = found.findings.iter().map(dynident::result::CheckFinding::sentence).collect();
    let has = |parts: &[&str]| sentences.iter().any(|text| parts.iter().all(|part| text.contains(part)));
    assert!(has(&["command of joint1 is clamped", "log `log`", "-0.2", "drop_time_s"]), "{sentences:?}");
    assert!(has(&["encoder of joint2 jumps", "a whole turn", "15.02 s"]), "{sentences:?}");
}

/// Recordings of a bench in JSON state their mass and gain; a study without them gets the keys.
#[test]
fn masses_and_gains_of_a_bench_are_named() {
    let folder = tempfile::tempdir().unwrap();
    for (name, mass, kp) in [("light.json", 0.3, 16), ("heavy.json", 0.6, 32)] {
        let entries: Vec<String> = rows()
            .iter()
            .map(|row| {
                let position = row[1] - 0.01 * mass;
                format!("{{\"timestamp\": {}, \"position\": {position}, \"goal_position\": {}}}", row[0], row[3])
            })
            .collect();
        let text = format!("{{\"mass\": {mass}, \"kp\": {kp}, \"entries\": [{}]}}", entries.join(", "));
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let urdf = "<robot name=\"bench\"><link name=\"base\"/><link name=\"rod\"><inertial><origin xyz=\"0 0 -0.1\"/>\
                <mass value=\"0.1\"/><inertia ixx=\"0.001\" iyy=\"0.001\" izz=\"0.001\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/>\
                </inertial></link><joint name=\"swing\" type=\"continuous\"><parent link=\"base\"/><child link=\"rod\"/>\
                <axis xyz=\"0 1 0\"/></joint></robot>";
    std::fs::write(folder.path().join("bench.urdf"), urdf).unwrap();
    let of = |keys: &str, more: &str| {
        let text = format!(
            "[robot]\nfile = \"bench.urdf\"\n[format]\ntime = {{ column = \"timestamp\" }}\nposition = {{ columns = \
             [\"position\"] }}\ncommand = {{ columns = [\"goal_position\"] }}\n{more}[[log]]\nfile = \"light.json\"\n\
             {keys}[[log]]\nfile = \"heavy.json\"\n{}",
            keys.replace("0.5", "1.0")
        );
        let path = folder.path().join("study.toml");
        check(&Study::parse(&text, &path).unwrap(), &path, &OPTIONS).unwrap().check
    };
    let found = of("", "");
    let lines: Vec<&str> = found.findings.iter().flat_map(|own| &own.write).map(|change| &change.line[..]).collect();
    assert_eq!(lines, ["payload = \"0.3 kg\"", "payload = \"0.6 kg\"", "servo_gain = 0.5", "servo_gain = 1"]);
    let payload = "[[payload]]\nname = \"own\"\nlink = \"rod\"\nmass_kg = 0.3\ncom_m = [0.0, 0.0, -0.15]\n";
    let stated = of("payload = \"own\"\nservo_gain = 0.5\n", payload);
    assert!(stated.findings.iter().all(|finding| finding.write.is_empty()), "{:?}", stated.findings);
}

#[test]
fn a_log_without_torque_and_commands_is_refused_with_the_fix() {
    let folder = tempfile::tempdir().unwrap();
    csv(folder.path(), "t,q1,q2,r1,r2", |_| {});
    let robot = repository("robots/planar2r.urdf");
    let text = |format: &str| {
        format!(
            "[robot]\nfile = {robot:?}\n[[log]]\nfile = \"log.csv\"\n[format]\ntime = {{ column = \"t\" }}\n{format}"
        )
    };
    let path = folder.path().join("study.toml");
    let refused = Study::parse(&text("[format.position]\ncolumns = \"q{1..2}\"\n"), &path).unwrap_err();
    let refused = dynident::Error::from(refused).to_string();
    assert!(refused.contains("neither torque nor command") && refused.contains("command = {"), "{refused}");
}

/// The published recordings of an SO-101: all six joints are mapped, the gripper from its share to its limits.
#[test]
fn a_sage_recording_gives_a_study() {
    let Some(data) = recordings() else { return };
    let (log, robot) = (data.join("so101_sage/chirp_sweep"), data.join("../robots/so101/so101_nomesh.xml"));
    if !log.is_dir() || !robot.is_file() {
        println!("SKIPPED: no recordings of an SO-101");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let clamped = data.join("so101_sage/single_joint_wrist_roll");
    let (found, study) = written(folder.path(), robot, vec![log, clamped]);
    let format = study.format.as_ref().unwrap();
    assert!(format.torque.is_none() && study.log.len() == 2, "{}", found.text);
    let names = ["Rotation", "Pitch", "Elbow", "Wrist_Pitch", "Wrist_Roll", "Jaw"];
    for (group, file) in [(&format.position, "state_motor"), (format.command.as_ref().unwrap(), "control")] {
        let expected: Vec<String> = names.iter().map(|name| format!("{file}.positions[{name}]")).collect();
        let found_ = format!("{:?}", group.column_list("columns").unwrap());
        assert!(
            expected.iter().all(|name| found_.contains(name)) && found_.matches("positions").count() == 6,
            "{found_}"
        );
        let scale = group.scale.as_ref().unwrap();
        assert_eq!((scale.at(0), scale.at(5).map(|scale| (scale * 1e4).round())), (Some(1.0), Some(19199.0)));
    }
    let joints = study.robot.joints.as_ref().unwrap();
    assert_eq!(joints[..], ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"]);
    let findings = found.check.unwrap().findings;
    let own: Vec<_> = findings.iter().filter(|finding| finding.kind != "description").collect();
    assert!(own.len() == 1 && own[0].what.contains("wrist_roll is clamped"), "{own:?}");
}
