//! A recording gives the same result in every format.
use crate::common::{Job, repository};
use dynident::{Folders, LogContents, Study, identify, log_contents};
use std::fmt::Write as _;
use std::path::Path;

const NAMES: [&str; 2] = ["lower", "upper"];
const START_NS: i64 = 1_790_000_000_123_456_789;

/// A row: nanoseconds after the start, positions, torques.
type Row = (i64, [f64; 2], [f64; 2]);

/// A motion of two joints with plausible torques and noise; jittering time stamps.
fn rows(seed: u64) -> Vec<Row> {
    let mut random = crate::common::Random(seed);
    (0..1200)
        .map(|row| {
            let ns = row * 5_000_000 + (40_000.0 * random.next()) as i64;
            let t = ns as f64 / 1e9;
            let phase = seed as f64;
            let q = [
                0.8 * (2.1 * t + phase).sin() + 0.3 * (5.3 * t).cos(),
                1.1 * (1.7 * t).cos() - 0.4 * (4.1 * t + phase).sin(),
            ];
            let tau = [
                9.0 * q[0].sin() + 2.0 * (q[0] + q[1]).sin() + 0.05 * random.next(),
                2.0 * (q[0] + q[1]).sin() + 0.02 * random.next(),
            ];
            (ns, q, tau)
        })
        .collect()
}

/// sensor_msgs/JointState in CDR, little-endian; the upper joint is first in every third message.
fn joint_state(row: &Row, at: usize) -> Vec<u8> {
    fn align(bytes: &mut Vec<u8>, size: usize) {
        // Alignment is relative to the end of the 4-byte encapsulation header.
        while !(bytes.len() - 4).is_multiple_of(size) {
            bytes.push(0);
        }
    }
    fn word(bytes: &mut Vec<u8>, value: u32) {
        align(bytes, 4);
        bytes.extend_from_slice(&value.to_le_bytes());
    }
    fn text(bytes: &mut Vec<u8>, value: &str) {
        word(bytes, value.len() as u32 + 1);
        bytes.extend_from_slice(value.as_bytes());
        bytes.push(0);
    }
    let order = if at.is_multiple_of(3) { [1, 0] } else { [0, 1] };
    let stamp = START_NS + row.0;
    let mut bytes = vec![0, 1, 0, 0];
    word(&mut bytes, (stamp / 1_000_000_000) as u32);
    word(&mut bytes, (stamp % 1_000_000_000) as u32);
    text(&mut bytes, "base");
    word(&mut bytes, 2);
    for joint in order {
        text(&mut bytes, NAMES[joint]);
    }
    for values in [&row.1[..], &[], &row.2[..]] {
        word(&mut bytes, values.len() as u32);
        for joint in order.iter().take(values.len()) {
            align(&mut bytes, 8);
            bytes.extend_from_slice(&values[*joint].to_le_bytes());
        }
    }
    bytes
}

fn write_bag(path: &Path, rows: &[Row]) {
    let mut writer = mcap::Writer::new(std::fs::File::create(path).unwrap()).unwrap();
    let text = "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n\
        ================================================================================\n\
        MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n";
    let schema = writer.add_schema("sensor_msgs/msg/JointState", "ros2msg", text.as_bytes()).unwrap();
    let none = std::collections::BTreeMap::new();
    let channel_id = writer.add_channel(schema, "/joint_states", "cdr", &none).unwrap();
    for (at, row) in rows.iter().enumerate() {
        let log_time = (START_NS + row.0) as u64 + 700_000;
        let header = mcap::records::MessageHeader { channel_id, sequence: at as u32, log_time, publish_time: log_time };
        writer.write_to_known_channel(&header, &joint_state(row, at)).unwrap();
    }
    writer.finish().unwrap();
}

fn write_csv(path: &Path, rows: &[Row]) {
    let mut text = "t,q1,q2,tau1,tau2\n".to_owned();
    for row in rows {
        // Time stamps are relative to the first one.
        let t = (row.0 - rows[0].0) as f64 / 1e9;
        writeln!(text, "{t:?},{:?},{:?},{:?},{:?}", row.1[0], row.1[1], row.2[0], row.2[1]).unwrap();
    }
    std::fs::write(path, text).unwrap();
}

#[test]
fn a_bag_gives_the_model_of_the_same_table_to_the_last_bit() {
    let folder = tempfile::tempdir().unwrap();
    let robot = repository("robots/planar2r.urdf");
    let joints = dynident::model::load_robot(&robot).unwrap().model.dof();
    assert_eq!(joints, 2);
    for (seed, name) in [(1, "train"), (2, "test")] {
        let rows = rows(seed);
        write_bag(&folder.path().join(format!("{name}.mcap")), &rows);
        write_csv(&folder.path().join(format!("{name}.csv")), &rows);
    }
    let names = |field: &str| {
        let list: Vec<String> = NAMES.iter().map(|joint| format!("\"/joint_states.{field}[{joint}]\"")).collect();
        format!("[{}]", list.join(", "))
    };
    let of_bag = format!(
        "time.column = \"/joint_states.header.stamp\"\nposition.columns = {}\ntorque.columns = {}\n",
        names("position"),
        names("effort")
    );
    let of_table = "time.column = \"t\"\nposition.columns = \"q{1..2}\"\ntorque.columns = \"tau{1..2}\"\n".to_owned();
    let found = [("mcap", of_bag), ("csv", of_table)].map(|(extension, format)| {
        let text = format!(
            "[robot]\nfile = {:?}\n[format]\n{format}[[log]]\nfile = \"train.{extension}\"\n\
             [[log]]\nfile = \"test.{extension}\"\nrole = \"validate\"\n",
            robot.display().to_string()
        );
        let job = Job::new(folder.path(), &text);
        let result = identify(&job.study, &job.path, &Job::options(2)).unwrap().result;
        let value = serde_json::to_value(&result).unwrap();
        let numbers = ["base_parameters", "base_parameter_covariance", "bodies", "joints", "training"];
        let mut kept: Vec<serde_json::Value> = numbers.iter().map(|key| value[key].clone()).collect();
        kept[4]["logs"] = serde_json::Value::Null;
        kept.push(value["validation"][0]["model"].clone());
        kept.push(value["validation"][0]["rmse_nm"].clone());
        kept.push(value["logs"][0]["import"]["rate_hz"].clone());
        kept
    });
    assert!(!found[0][0].as_array().unwrap().is_empty() && found[0][7].is_number());
    assert_eq!(found[0], found[1]);
}

#[test]
fn what_a_recording_holds_is_said_and_leads_to_a_study() {
    let of = |file: &str| -> LogContents { log_contents(&repository(&format!("golden/formats/{file}"))).unwrap() };
    let bag = of("two_clocks.mcap");
    let groups: Vec<(&str, u64)> =
        bag.groups.iter().map(|group| (group.name.as_deref().unwrap(), group.rows)).collect();
    assert_eq!((bag.format.as_str(), groups), ("MCAP", vec![("/joint_states", 40), ("/tau", 13)]));
    assert!(
        (bag.groups[0].rate_hz.unwrap() - 100.0).abs() < 0.1 && (bag.groups[1].rate_hz.unwrap() - 40.0).abs() < 1e-9
    );
    assert!(bag.study_format.contains("time = { column = \"/joint_states.header.stamp\" }"), "{}", bag.study_format);
    let efforts = "torque = { columns = \"/joint_states.effort[{joint}]\" }";
    assert!(bag.study_format.contains(efforts), "{}", bag.study_format);
    let elbow = bag.channels.iter().find(|channel| channel.name == "/joint_states.position[elbow]").unwrap();
    assert_eq!((elbow.unit.as_deref(), elbow.samples, elbow.missing), (Some("rad"), 40, 0));
    // The elbow moves as 0.7 cos 5t until 0.39 s.
    assert!(elbow.range.unwrap()[1] == 0.7 && (elbow.range.unwrap()[0] - 0.7 * 1.95_f64.cos()).abs() < 1e-12);
    // The proposed format can be parsed.
    for (file, joints) in
        [("two_clocks.mcap", 2), ("packed.mat", 2), ("table.csv.gz", 2), ("bag", 2), ("packed.npz", 2)]
    {
        let proposed = of(file).study_format;
        let table: std::collections::BTreeMap<String, dynident::recording::LogFormat> =
            toml::from_str(&proposed).unwrap();
        let joints: Vec<String> = (0..joints).map(|joint| joint.to_string()).collect();
        table["format"].validate(&joints).unwrap_or_else(|error| panic!("{file}: {error}\n{proposed}"));
    }
}

#[test]
fn a_study_names_the_folder_of_a_recording() {
    let study = Study::parse("[robot]\nfile = \"arm.urdf\"\n[design]\n", Path::new("study.toml")).unwrap();
    let folders = Folders::new(&study, &repository("golden/formats/study.toml"), None);
    for recording in ["bag", "lerobot_v2", "lerobot_v3"] {
        let found = folders.find(Path::new(recording), None).unwrap();
        assert_eq!(found, repository(&format!("golden/formats/{recording}")));
    }
    // A folder without a recording.
    assert!(folders.find(Path::new("trace"), None).is_err());
}

/// A data set in a folder `speed_0.3` has this name; the extension of a file is left out.
#[test]
fn digits_after_a_dot_belong_to_the_name_of_a_log() {
    let text = "robot.file = \"arm.urdf\"\nlog = [{ file = \"runs/speed_0.3\" }, { file = \"a.b.csv\" }]\n[format]\n\
                rate_hz = 100.0\nposition = { columns = \"q{1..2}\" }\ntorque = { columns = \"tau{1..2}\" }\n";
    let study = dynident::Study::parse(text, std::path::Path::new("study.toml")).unwrap();
    assert_eq!([study.log_name(0), study.log_name(1)], ["speed_0.3", "a.b"]);
}
