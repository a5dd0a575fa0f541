//! SAGE recordings, as published: values compared with an independent reading of the two files.

use dynident_recording::command_check::Side;
use dynident_recording::log::LogFormat;
use dynident_recording::{CommandCheckSettings, CommandFinding, CommandedMotion, Log, RecordingError, check_commands};
use dynident_testing::recordings;
use std::path::{Path, PathBuf};

const JOINTS: [&str; 6] = ["Rotation", "Pitch", "Elbow", "Wrist_Pitch", "Wrist_Roll", "Jaw"];
const OF_FOLDER: &str = r#"
    time = { column = "timestamp", unit = "us" }
    position = { columns = "state_motor.positions[{joint}]" }
    command = { columns = "control.positions[{joint}]" }
"#;
const OF_TWO_FILES: &str = r#"
    time = { column = "timestamp", unit = "us" }
    position = { columns = "positions[{0..5}]" }
    command = { columns = "positions[{0..5}]", file = "control.csv" }
"#;

fn motion(file: &Path, format: &str) -> Result<CommandedMotion, RecordingError> {
    let format: LogFormat = toml::from_str(format).unwrap();
    Log::file(file, format, &JOINTS.map(str::to_owned)).commanded_motion()
}

/// Stamp and first list of each line, by splitting the text at its quotes.
fn lines(file: &Path) -> Vec<(f64, Vec<f64>)> {
    let text = std::fs::read_to_string(file).unwrap();
    let number = |text: &str| text.trim().parse::<f64>().unwrap();
    let of_line = |line: &str| {
        let parts: Vec<&str> = line.split('"').collect();
        let stamp = number(parts[0].split(',').nth(1).unwrap());
        (stamp, parts[1].trim_matches(['[', ']']).split(',').map(number).collect())
    };
    text.lines().skip(1).map(of_line).collect()
}

fn folders() -> Option<Vec<PathBuf>> {
    let entries = std::fs::read_dir(recordings()?.join("so101_sage")).ok()?;
    Some(entries.map(|entry| entry.unwrap().path()).filter(|path| path.is_dir()).collect())
}

#[test]
fn all_published_recordings_are_read_exactly() {
    let Some(folders) = folders() else { return };
    assert!(!folders.is_empty());
    for folder in folders {
        let [commands, states] = ["control.csv", "state_motor.csv"].map(|file| lines(&folder.join(file)));
        let of_folder = motion(&folder, OF_FOLDER).unwrap();
        let of_files = motion(&folder.join("state_motor.csv"), OF_TWO_FILES).unwrap();
        assert!(of_folder.samples() > 2000 && of_folder.samples() == states.len(), "{}", folder.display());
        for motion in [of_folder, of_files] {
            let times: Vec<f64> = states.iter().map(|(stamp, _)| (stamp - states[0].0) * 1e-6).collect();
            assert_eq!(motion.times_s, times, "{}", folder.display());
            let values = |rows: &[(f64, Vec<f64>)]| rows.iter().flat_map(|(_, row)| row.clone()).collect::<Vec<_>>();
            assert!(
                motion.positions == values(&states) && motion.commands == values(&commands),
                "{}",
                folder.display()
            );
            // Five of the joints turn with 4096 counts; the gripper's unit is its range.
            let count = core::f64::consts::TAU / 4096.0;
            for found in motion.encoder_counts().into_iter().take(5).flatten() {
                assert!((found / count - 1.0).abs() < 1e-3, "{}: {found}", folder.display());
            }
        }
    }
}

/// The description of the data names one fault: in this recording the servo clamps the commands of the wrist.
#[test]
fn the_clamped_command_is_the_only_finding_in_the_published_recordings() {
    let Some(folders) = folders() else { return };
    let settings = CommandCheckSettings::default();
    for folder in folders {
        let found = check_commands(&motion(&folder, OF_FOLDER).unwrap(), &[], &settings);
        if folder.ends_with("single_joint_wrist_roll") {
            let is_clamped = matches!(found[..], [CommandFinding::Clamped { joint: 4, side: Side::Lower, .. }]);
            assert!(is_clamped, "{found:?}");
        } else {
            assert!(found.is_empty(), "{}: {found:?}", folder.display());
        }
    }
}

/// A recording with two joints and these rows: stamp and values of each joint.
fn written(commands: &[(f64, f64)], states: &[(f64, f64)], joints: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let table = |kind: &str, rows: &[(f64, f64)]| {
        let line = |(stamp, q): &(f64, f64)| format!("{kind},{stamp},\"[{q}, {}]\"\n", -q);
        format!("type,timestamp,positions\n{}", rows.iter().map(line).collect::<String>())
    };
    std::fs::write(folder.path().join("control.csv"), table("CONTROL", commands)).unwrap();
    std::fs::write(folder.path().join("state_motor.csv"), table("STATE_MOTOR", states)).unwrap();
    if !joints.is_empty() {
        std::fs::write(folder.path().join("joint_list.txt"), joints).unwrap();
    }
    folder
}

fn two_joints(folder: &Path, columns: &str) -> Result<CommandedMotion, RecordingError> {
    let format = format!(
        "time = {{ column = \"timestamp\", unit = \"us\" }}\n\
         position = {{ columns = \"state_motor.positions[{columns}]\" }}\n\
         command = {{ columns = \"control.positions[{columns}]\" }}\n"
    );
    let format: LogFormat = toml::from_str(&format).unwrap();
    Log::file(folder, format, &["pan", "lift"].map(str::to_owned)).commanded_motion()
}

#[test]
fn commands_are_joined_by_their_stamps() {
    let commands = [(100.0, 1.0), (200.0, 2.0), (400.0, 3.0)];
    let states = [(50.0, 9.0), (100.0, 0.1), (150.0, 0.2), (399.0, 0.3), (400.0, 0.4), (401.0, 9.0)];
    let folder = written(&commands, &states, "pan\nlift\n");
    let motion = two_joints(folder.path(), "{joint}").unwrap();
    assert_eq!(motion.times_s, [0.0, 50.0 * 1e-6, 299.0 * 1e-6, 300.0 * 1e-6]);
    assert_eq!(motion.positions, [0.1, -0.1, 0.2, -0.2, 0.3, -0.3, 0.4, -0.4]);
    assert_eq!(motion.commands, [1.0, -1.0, 1.0, -1.0, 2.0, -2.0, 3.0, -3.0]);
    // Without names, entries have indices.
    let unnamed = written(&commands, &states, "");
    assert_eq!(two_joints(unnamed.path(), "{0..1}").unwrap().commands, motion.commands);
}

#[test]
fn damaged_recordings_are_refused_with_their_place() {
    let rows = [(100.0, 1.0), (200.0, 2.0)];
    let refused = |folder: &Path| two_joints(folder, "{joint}").unwrap_err().to_string();
    let twice = written(&rows, &rows, "pan\npan\n");
    assert!(refused(twice.path()).contains("joint_list.txt") && refused(twice.path()).contains("listed twice"));
    let unordered = written(&[(200.0, 1.0), (100.0, 2.0)], &[(150.0, 1.0), (250.0, 1.0)], "pan\nlift\n");
    assert!(refused(unordered.path()).contains("control.csv"), "{}", refused(unordered.path()));
    let apart = written(&[(500.0, 1.0)], &rows, "pan\nlift\n");
    assert!(refused(apart.path()).contains("no data rows"), "{}", refused(apart.path()));
    let without_stamps = written(&rows, &rows, "pan\nlift\n");
    std::fs::write(without_stamps.path().join("control.csv"), "type,positions\nCONTROL,\"[1, 2]\"\n").unwrap();
    assert!(refused(without_stamps.path()).contains("control.csv:1: no column `timestamp`"));
    let empty = written(&rows, &rows, "pan\nlift\n");
    std::fs::write(empty.path().join("state_motor.csv"), "").unwrap();
    assert!(refused(empty.path()).contains("state_motor.csv"), "{}", refused(empty.path()));
}

/// The command file of another recording has the same columns and rows.
#[test]
fn two_files_of_different_recordings_are_refused() {
    let rows = |offset: f64, missing: usize| -> Vec<(f64, f64)> {
        (0..200).filter(|k| *k != missing).map(|k| (offset + 20_000.0 * k as f64, 0.01 * k as f64)).collect()
    };
    let read = |commands: &[(f64, f64)], states: &[(f64, f64)], extra: &str| {
        let folder = written(commands, states, "");
        let format = format!(
            "time = {{ column = \"timestamp\", unit = \"us\"{extra} }}\n\
             position = {{ columns = \"positions[{{0..1}}]\" }}\n\
             command = {{ columns = \"positions[{{0..1}}]\", file = \"control.csv\" }}\n"
        );
        let format: LogFormat = toml::from_str(&format).unwrap();
        let log = Log::file(&folder.path().join("state_motor.csv"), format, &["pan", "lift"].map(str::to_owned));
        log.commanded_motion()
    };
    let states = &rows(0.0, 200)[..199];
    // A command is logged some milliseconds before its measurement.
    assert_eq!(read(&rows(-4_000.0, 200)[..199], states, "").unwrap().samples(), 199);
    // One missing row is a difference of 20 ms.
    assert!(read(&rows(-1_000.0, 50), states, "").is_ok());
    let other = &rows(1e6, 200)[..199];
    let error = read(other, states, "").unwrap_err();
    assert!(matches!(error, RecordingError::ForeignFile { row: 0, .. }), "{error}");
    assert!(error.to_string().contains("control.csv") && error.to_string().contains("max_difference_s"), "{error}");
    assert!(read(other, states, ", max_difference_s = 2.0").is_ok());
    // Ten missing rows are 0.2 s.
    let mut late = rows(0.0, 200);
    late.drain(100..110);
    let error = read(&late, &rows(0.0, 200)[..190], "").unwrap_err();
    assert!(matches!(error, RecordingError::ForeignFile { row: 100, .. }), "{error}");
}
