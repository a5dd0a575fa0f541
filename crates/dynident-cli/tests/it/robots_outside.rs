//! `iterate` with an external robot: permission, Ctrl-C, and remaining processes. The robot is a shell script with the
//! line protocol.
#![cfg(unix)]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

/// Sends hello and one sample of each run, creates its marker file, and then executes `rest`.
pub(crate) fn robot(folder: &Path, rest: &str) -> PathBuf {
    let script = folder.join("robot.sh");
    let text = format!(
        r#"printf '%s\n' '{{"type":"hello","protocol":"dynident-robot/1","name":"script","joints":["joint1","joint2"],"modes":["run"]}}'
while read -r line; do
    case "$line" in
    *'"type":"run"'*)
        printf '%s\n' '{{"type":"sample","t_s":0.0,"q":[0.0,0.0],"tau":[0.0,0.0]}}'
        {rest}
        ;;
    *'"type":"bye"'*) exit 0 ;;
    esac
done
"#
    );
    std::fs::write(&script, text).unwrap();
    script
}

/// A study of the planar arm with that robot, at rest for a second.
pub(crate) fn study(folder: &Path, further: &str) -> PathBuf {
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/planar2r.urdf");
    let mut rows = vec!["t_s,q1,q2,dq1,dq2,ddq1,ddq2".to_owned()];
    rows.extend((0..101).map(|k| format!("{},0,0,0,0,0,0", f64::from(k) * 0.01)));
    std::fs::write(folder.join("still.csv"), rows.join("\n") + "\n").unwrap();
    let script = folder.join("robot.sh");
    let text = format!(
        "[robot]\nfile = \"{urdf}\"\n[simulation]\nrate_hz = 1000.0\n[controller]\nkind = \"joint-pd\"\nkp = [200.0, 60.0]\nkd = [10.0, 1.0]\n\
         [iteration]\ntrajectory = \"still.csv\"\nmodel_free = {{ kind = \"joint-pd\", kp = [200.0, 60.0], kd = [10.0, 1.0] }}\n\
         robot = {{ kind = \"process\", command = [\"sh\", \"{script}\", \"{folder}\"]{further} }}\n",
        urdf = urdf.display(),
        script = script.display(),
        folder = folder.display()
    );
    let path = folder.join("study.toml");
    std::fs::write(&path, text).unwrap();
    path
}

fn iterate(study: &Path, further: &[&str]) -> Child {
    let out = study.with_file_name("result");
    let mut command = Command::new(env!("CARGO_BIN_EXE_dynident"));
    command.arg("iterate").arg(study).arg("--out").arg(out).args(further);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

pub(crate) fn awaited(file: &Path, program: &mut Child) {
    while !file.exists() {
        assert!(program.try_wait().unwrap().is_none(), "it ended before {}", file.display());
        std::thread::sleep(Duration::from_millis(5));
    }
}

pub(crate) fn interrupt(program: &Child) {
    assert!(Command::new("kill").args(["-INT", &program.id().to_string()]).status().unwrap().success());
}

pub(crate) fn said(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

pub(crate) fn runs(file: &Path) -> bool {
    let id = std::fs::read_to_string(file).unwrap();
    let state = Command::new("ps").args(["-o", "stat=", "-p", id.trim()]).output().unwrap();
    let state = String::from_utf8_lossy(&state.stdout).trim().to_owned();
    !state.is_empty() && !state.starts_with('Z')
}

/// Ctrl-C during a run: the robot receives a stop, the log is stored, the exit status is that of an interruption, the
/// message contains the way to continue, and no further run is commanded.
#[test]
fn an_interrupted_run_stops_the_robot() {
    let folder = tempfile::tempdir().unwrap();
    let rest = r#"printf '%s' "$$" >"$1/pid"; mv "$1/pid" "$1/begun"; read -r stop; printf '%s\n' "$stop" >>"$1/heard"
        printf '%s\n' '{"type":"end","status":"stopped","reason":"as asked"}'"#;
    robot(folder.path(), rest);
    let study = study(folder.path(), "");
    let mut program = iterate(&study, &["--allow-command"]);
    awaited(&folder.path().join("begun"), &mut program);
    interrupt(&program);
    let output = program.wait_with_output().unwrap();
    let said = said(&output);
    assert_eq!(output.status.code(), Some(130), "{said}");
    assert!(said.contains("interrupted") && said.contains("continue with run 1"), "{said}");
    let heard = std::fs::read_to_string(folder.path().join("heard")).unwrap();
    assert!(heard.lines().count() == 1 && heard.contains(r#""type":"stop""#), "{heard}");
    let result = folder.path().join("result");
    assert_eq!(std::fs::read_to_string(result.join("runs/interrupted_1/log.csv")).unwrap().lines().count(), 2);
    assert!(!result.join("runs/run_1").exists());
    let file: serde_json::Value =
        serde_json::from_slice(&std::fs::read(result.join("iterations.json")).unwrap()).unwrap();
    assert_eq!((&file["status"], &file["converged"]), (&"interrupted".into(), &false.into()));
    assert!(!runs(&folder.path().join("begun")));
}

/// A robot that does not answer: the second Ctrl-C ends everything, including its children.
#[test]
fn a_second_interruption_kills_the_robot() {
    let folder = tempfile::tempdir().unwrap();
    let rest = r#"sleep 3600 & printf '%s' "$!" >"$1/pid"; mv "$1/pid" "$1/begun"; wait"#;
    robot(folder.path(), rest);
    let study = study(folder.path(), ", limits = { stop_s = 3000.0 }");
    let mut program = iterate(&study, &["--allow-command"]);
    let begun = folder.path().join("begun");
    awaited(&begun, &mut program);
    interrupt(&program);
    // Pending signals are merged, so repeat them until both are received.
    while program.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(200));
        interrupt(&program);
    }
    let output = program.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    assert!(said(&output).contains("the robot may still be moving, check it first"), "{}", said(&output));
    assert!(!runs(&begun));
}

/// A key that is held down repeats: two interruptions within 20 ms are treated as one, and the robot has the time to
/// brake.
#[test]
fn a_repeated_key_lets_the_robot_brake() {
    let folder = tempfile::tempdir().unwrap();
    let rest = r#"printf '%s' "$$" >"$1/pid"; mv "$1/pid" "$1/begun"; read -r stop; sleep 1; touch "$1/stands"
        printf '%s\n' '{"type":"end","status":"stopped","reason":"as asked"}'"#;
    robot(folder.path(), rest);
    let study = study(folder.path(), ", limits = { stop_s = 60.0 }");
    let mut program = iterate(&study, &["--allow-command"]);
    awaited(&folder.path().join("begun"), &mut program);
    let twice = format!("kill -INT {0}; sleep 0.02; kill -INT {0}", program.id());
    assert!(Command::new("sh").args(["-c", &twice]).status().unwrap().success());
    let output = program.wait_with_output().unwrap();
    let said = said(&output);
    assert_eq!(output.status.code(), Some(130), "{said}");
    assert!(folder.path().join("stands").exists() && said.contains("the robot has stopped"), "{said}");
    assert!(!said.contains("may still be moving"), "{said}");
}

/// A study may come from somebody else: without permission nothing is started, and the message contains the command.
#[test]
fn a_studys_command_needs_permission() {
    let folder = tempfile::tempdir().unwrap();
    robot(folder.path(), r#"touch "$1/begun""#);
    let output = iterate(&study(folder.path(), ""), &[]).wait_with_output().unwrap();
    let said = said(&output);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("robot.sh") && said.contains("--allow-command"), "{said}");
    assert!(!folder.path().join("begun").exists());
    let output = iterate(&study(folder.path(), ""), &["--allow-command", "--confirm"]).wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(!folder.path().join("begun").exists());
}

/// Ctrl-C during the trajectory search ends the command: the incomplete trajectory must not be stored.
#[test]
fn an_interrupted_search_keeps_no_trajectory() {
    let folder = tempfile::tempdir().unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let text = std::fs::read_to_string(root.join("examples/iterate_ur10.toml")).unwrap();
    let urdf = root.join("robots/ur10.urdf");
    let text = text.replace("../robots/ur10.urdf", urdf.to_str().unwrap()).replace("starts = 2", "starts = 500");
    let study = folder.path().join("study.toml");
    std::fs::write(&study, text).unwrap();
    let mut program = iterate(&study, &[]);
    let result = folder.path().join("result");
    awaited(&result.join("runs"), &mut program);
    interrupt(&program);
    let output = program.wait_with_output().unwrap();
    let said = said(&output);
    assert_eq!(output.status.code(), Some(130), "{said}");
    assert!(said.contains("interrupted") && !result.join("trajectory.json").exists(), "{said}");
}

/// There are no default gains: the message contains the lines to write.
#[test]
fn a_robot_outside_has_no_default_gains() {
    let folder = tempfile::tempdir().unwrap();
    let stopped = r#"touch "$1/begun"; printf '%s\n' '{"type":"end","status":"stopped","reason":"as asked"}'"#;
    robot(folder.path(), stopped);
    let study = study(folder.path(), "");
    let text = std::fs::read_to_string(&study).unwrap();
    let text = text.replace("[controller]\nkind = \"joint-pd\"\nkp = [200.0, 60.0]\nkd = [10.0, 1.0]\n", "");
    let text = text.replace("model_free = { kind = \"joint-pd\", kp = [200.0, 60.0], kd = [10.0, 1.0] }\n", "");
    std::fs::write(&study, &text).unwrap();
    let output = iterate(&study, &["--allow-command"]).wait_with_output().unwrap();
    let said = said(&output);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("no default gains") && said.contains("bandwidth_hz"), "{said}");
    assert!(!folder.path().join("begun").exists());
    // A bandwidth is enough if the robot description has inertials.
    std::fs::write(&study, text.replace("[iteration]\n", "[iteration]\nbandwidth_hz = 2.0\n")).unwrap();
    let output = iterate(&study, &["--allow-command"]).wait_with_output().unwrap();
    assert!(folder.path().join("begun").exists(), "{}", self::said(&output));
}

/// After a correction of the command, of a time limit, or of the envelope, the iteration continues.
#[test]
fn a_corrected_command_is_no_other_iteration() {
    let folder = tempfile::tempdir().unwrap();
    let stopped = r#"touch "$1/begun"; printf '%s\n' '{"type":"end","status":"stopped","reason":"protective stop"}'"#;
    let script = robot(folder.path(), stopped);
    let study = study(folder.path(), "");
    let text = std::fs::read_to_string(&study).unwrap();
    std::fs::write(&study, text.replace("robot.sh", "robto.sh")).unwrap();
    let output = iterate(&study, &["--allow-command"]).wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert!(!folder.path().join("begun").exists() && folder.path().join("result/trajectory.json").exists());
    let corrected = text.replace("\"]", "\"], limits = { message_s = 90.0 }");
    std::fs::write(&study, format!("{corrected}[iteration.envelope]\ntracking_error = 0.25\n")).unwrap();
    let output = iterate(&study, &["--allow-command"]).wait_with_output().unwrap();
    let said = said(&output);
    // The robot stopped: a person has to check it, and the run is stored.
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("protective stop") && said.contains("ended early"), "{said}");
    assert!(folder.path().join("result/runs/run_1/run.json").exists() && script.exists());
}

/// A program without the capability `home` is not sent a run from home; a corrected home does not start another
/// iteration.
#[test]
fn a_home_needs_a_program_that_knows_it() {
    let folder = tempfile::tempdir().unwrap();
    robot(
        folder.path(),
        "printf '%s' \"$line\" >\"$1/heard\"; printf '%s\\n' '{\"type\":\"end\",\"status\":\"stopped\",\"reason\":\"seen\"}'",
    );
    let study = study(folder.path(), "");
    let text = std::fs::read_to_string(&study).unwrap();
    let soft = "home = [0.1, 0.1]\nrehearsal = { uncertainty_percent = 0.0, robots = 0 }\nenvelope = { tracking_error = 1.0 }\n";
    let with_home = text.replace("[iteration]\n", &format!("[design.defaults]\nfloor = false\n[iteration]\n{soft}"));
    std::fs::write(&study, &with_home).unwrap();
    let output = iterate(&study, &["--allow-command"]).wait_with_output().unwrap();
    let words = said(&output);
    assert!(words.contains("\"capabilities\":[\"home\"]") && words.contains("mode = \"step\""), "{words}");
    assert!(!folder.path().join("heard").exists());
    // The program now has the capability, and home differs: the folder still belongs to this iteration.
    let script = std::fs::read_to_string(folder.path().join("robot.sh")).unwrap();
    let learned = script.replace("\"modes\":[\"run\"]", "\"modes\":[\"run\"],\"capabilities\":[\"home\"]");
    std::fs::write(folder.path().join("robot.sh"), learned).unwrap();
    std::fs::write(&study, with_home.replace("[0.1, 0.1]", "[0.1, 0.2]")).unwrap();
    let output = iterate(&study, &["--allow-command"]).wait_with_output().unwrap();
    let heard = std::fs::read_to_string(folder.path().join("heard")).unwrap_or_else(|_| panic!("{}", said(&output)));
    assert!(heard.contains("\"home\":{\"approach\":") && heard.contains("return.csv"), "{heard}");
}
