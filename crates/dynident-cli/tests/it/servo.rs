//! Drives from commands in the command line: designs for robots, exported results.

use super::common::{CommandOutcome, repository, run_in};
use dynident::result::{SERVO_SCHEMA, ServoDrive, ServoFile, ServoForm, ServoFormLog};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

fn study(folder: &Path) {
    let robot = repository("robots/planar2r.urdf").canonicalize().unwrap();
    let text = format!(
        "[robot]\nfile = {:?}\n[drive.servo]\nstiffness = 300.0\ndamping = 25.0\narmature = 0.8\ncoulomb = 2.0\n\
         fit = {{ step_s = 0.01 }}\ndesign = {{ duration_s = 6.0, candidates = 4, exchanges = 0 }}\n\
         [design.defaults]\nfloor = false\nself_collision = false\n[design.limits]\n\
         joints = [{{ joint = \"joint1\", position = [-1.0, 1.2], speed = 2.0 }}, \
         {{ joint = \"joint2\", position = [-1.5, 1.5], speed = 3.0 }}]\n",
        robot.display().to_string()
    );
    std::fs::write(folder.join("study.toml"), text).unwrap();
}

fn design(folder: &Path, further: &[&str]) -> CommandOutcome {
    run_in(folder, &[&["design", "study.toml", "--out", "out"], further].concat())
}

/// The columns of a table with its header.
fn table(path: &Path) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(path).unwrap();
    text.lines().skip(1).map(|row| row.split(',').map(|number| number.parse().unwrap()).collect()).collect()
}

#[test]
fn designed_commands_are_written_for_ros_and_lerobot_and_removed_by_the_next_design() {
    let folder = tempfile::tempdir().unwrap();
    study(folder.path());
    let ran = design(folder.path(), &["--to", "ros2", "--to", "lerobot"]);
    assert_eq!(ran.status, 0, "{}\n{}", ran.stdout, ran.stderr);
    assert!(ran.stderr.contains("degrees"), "{}", ran.stderr);
    let out = folder.path().join("out");
    let rows = table(&out.join("commands.csv"));
    let yaml = std::fs::read_to_string(out.join("commands.ros2.yaml")).unwrap();
    let points: Vec<&str> = yaml.lines().filter_map(|line| line.strip_prefix("  - positions: ")).collect();
    assert_eq!((points.len(), rows.len()), (300, 300));
    for (point, row) in points.iter().zip(&rows) {
        assert_eq!(serde_json::from_str::<Vec<f64>>(point).unwrap(), row[1..]);
    }
    let info = std::fs::read_to_string(out.join("lerobot/meta/info.json")).unwrap();
    let info: Value = serde_json::from_str(&info).unwrap();
    assert_eq!(
        (&info["codebase_version"], &info["fps"], &info["total_frames"]),
        (&"v2.1".into(), &50.into(), &300.into())
    );
    assert_eq!(info["features"]["action"]["names"], serde_json::json!(["joint1.pos", "joint2.pos"]));
    pyarrow_reads(&out, &rows);
    let refused = design(folder.path(), &["--to", "urscript"]);
    assert!(refused.status == 2 && refused.stderr.contains("--to urscript"), "{}", refused.stderr);
    let ran = design(folder.path(), &["--quiet"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    assert!(!out.join("commands.ros2.yaml").exists() && !out.join("lerobot/meta/info.json").exists());
}

/// Another reader of Parquet: types, and all values to the last bit of 32.
#[allow(clippy::print_stdout, reason = "a test that is skipped says so")]
fn pyarrow_reads(out: &Path, rows: &[Vec<f64>]) {
    let script = "import json, sys\nimport pyarrow.parquet as pq\n\
        table = pq.read_table(sys.argv[1])\n\
        print(json.dumps({'types': [str(field.type) for field in table.schema], **table.to_pydict()}))\n";
    let table = "lerobot/data/chunk-000/episode_000000.parquet";
    let output = Command::new("python3").args(["-c", script, table]).current_dir(out).output();
    let Some(output) = output.ok().filter(|output| output.status.success()) else {
        println!("skipped: there is no `python3` with pyarrow");
        return;
    };
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    let types = ["list<element: float>", "float", "int64", "int64", "int64", "int64"];
    assert_eq!(found["types"], serde_json::json!(types));
    for (frame, row) in rows.iter().enumerate() {
        let degrees = |joint: usize| f64::from((row[joint + 1] * (180.0 / core::f64::consts::PI)) as f32);
        assert_eq!(found["action"][frame], serde_json::json!([degrees(0), degrees(1)]));
        assert_eq!(found["timestamp"][frame].as_f64(), Some(f64::from((frame as f64 / 50.0) as f32)));
        assert_eq!((&found["frame_index"][frame], &found["index"][frame]), (&frame.into(), &frame.into()));
        assert_eq!((&found["episode_index"][frame], &found["task_index"][frame]), (&0.into(), &0.into()));
    }
}

#[test]
fn a_design_with_torque_is_written_for_lerobot() {
    let folder = tempfile::tempdir().unwrap();
    let robot = repository("robots/planar2r.urdf").canonicalize().unwrap();
    let text = format!(
        "[robot]\nfile = {:?}\n[design]\nduration_s = 4.0\n[design.search]\nstarts = 1\nrounds = 0\nrate_hz = 50.0\n\
         evaluations_per_start = 20\npolish_evaluations = 20\n[design.defaults]\nfloor = false\nself_collision = false\n\
         [design.limits]\njoints = [{{ joint = \"joint1\", position = [-1.0, 1.2], speed = 0.5, acceleration = 1.0, torque = 1e4 }}, \
         {{ joint = \"joint2\", position = [-1.5, 1.5], speed = 0.5, acceleration = 1.0, torque = 1e4 }}]\n",
        robot.display().to_string()
    );
    std::fs::write(folder.path().join("study.toml"), text).unwrap();
    let ran = design(folder.path(), &["--to", "lerobot"]);
    assert_eq!(ran.status, 0, "{}\n{}", ran.stdout, ran.stderr);
    let out = folder.path().join("out");
    let rows: Vec<Vec<f64>> =
        table(&out.join("trajectory.csv")).into_iter().map(|row| row.into_iter().take(3).collect()).collect();
    assert_eq!(rows.len(), 201);
    pyarrow_reads(&out, &rows);
}

/// A result with two joints and the errors of its files.
fn result(folder: &Path) {
    let drive = |stiffness: f64| ServoDrive {
        stiffness,
        damping: 0.7,
        armature: 0.02,
        mean_friction: 0.3,
        delay_s: 0.01,
        ..ServoDrive::default()
    };
    let log = |errors| ServoFormLog { name: "held".into(), held_out: true, errors, model_errors: vec![0.003, 0.004] };
    let form = |name: &str, errors| ServoForm {
        form: name.to_owned(),
        step_s: 0.005,
        lost: vec![format!("{name} lacks something")],
        logs: vec![log(errors)],
        ..ServoForm::default()
    };
    let file = ServoFile {
        schema: SERVO_SCHEMA.to_owned(),
        study: "arm".into(),
        joints: vec!["joint1".into(), "joint2".into()],
        rotary: vec![true, true],
        drives: vec![drive(10.0), drive(12.0)],
        forms: vec![form("isaac-lab-implicit", Some(vec![0.012, 0.02])), form("isaac-lab-delayed", None)],
        ..ServoFile::default()
    };
    std::fs::write(folder.join("result.json"), serde_json::to_string(&file).unwrap()).unwrap();
}

#[test]
fn an_exported_result_states_what_is_lost_on_the_terminal_in_json_and_in_the_file() {
    let folder = tempfile::tempdir().unwrap();
    result(folder.path());
    let words = [
        "isaac-lab-implicit lacks something",
        "joint1 12.0 mrad (3.0), joint2 20.0 mrad (4.0)",
        "fails with steps of 5 ms",
    ];
    let ran = run_in(folder.path(), &["export", "result.json", "--to", "isaac-lab", "--out", "drives.py"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let file = std::fs::read_to_string(folder.path().join("drives.py")).unwrap();
    let terminal = ran.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
    for words in words {
        assert!(file.contains(words) && terminal.contains(words), "{words}\n{file}\n{terminal}");
    }
    let validation = std::fs::read_to_string(folder.path().join("drives.py.validation.json")).unwrap();
    let validation: Value = serde_json::from_str(&validation).unwrap();
    assert_eq!(validation["servo_forms"][0]["logs"][0]["errors"], serde_json::json!([0.012, 0.02]));
    let ran = run_in(folder.path(), &["--json", "export", "result.json", "--to", "isaac-lab"]);
    let json: Value = serde_json::from_str(&ran.stdout).unwrap();
    assert_eq!((&json["target"], json["text"].as_str().unwrap()), (&"isaac-lab".into(), &file[..]));
    assert_eq!(json["servo_forms"], validation["servo_forms"]);
    // The problem is shown even with --quiet.
    let ran = run_in(folder.path(), &["--quiet", "export", "result.json", "--to", "isaac-lab", "--out", "drives.py"]);
    assert!(ran.stderr.contains("PROBLEM") && !ran.stderr.contains("lacks"), "{}", ran.stderr);
}

#[test]
fn forms_that_need_torque_or_the_study_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    result(folder.path());
    for (arguments, words) in [
        (&["--to", "python"][..], "use --to isaac-lab, mjcf or urdf"),
        (&["--to", "urdf"], "--study STUDY.toml"),
        (&["--to", "isaac-lab", "--float32"], "omit it"),
    ] {
        let ran = run_in(folder.path(), &[&["export", "result.json"], arguments].concat());
        assert_eq!(ran.status, 2, "{}", ran.stderr);
        let terminal = ran.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(terminal.contains(words), "{terminal}");
    }
}
