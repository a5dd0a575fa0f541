//! `identify` for a log of commands and positions.

use dynident::{RunOptions, Silent, Study, design_servos, identify_servos};
use dynident_servo::{Drive, Run, ServoRobot, simulate};
use std::fmt::Write;
use std::path::Path;

pub(crate) const OPTIONS: RunOptions<'_> = RunOptions { data: None, threads: 2, progress: &Silent };
const COUNT: f64 = core::f64::consts::TAU / 4096.0;

/// Writes a log of a simulated arm with two servos.
pub(crate) fn write_log(path: &Path, phase: f64) {
    let model = dynident::model::load_robot(dynident_testing::repository("robots/planar2r.urdf")).unwrap().model;
    let drive = Drive {
        stiffness: 300.0,
        damping: 25.0,
        armature: 0.8,
        coulomb: 2.0,
        load_friction: 0.0,
        stribeck: 0.0,
        stribeck_speed: 0.1,
        torque_limit: f64::INFINITY,
        profile_acceleration: f64::INFINITY,
        profile_speed: f64::INFINITY,
        delay_s: 0.02,
        read_delay_s: 0.0,
        zero: 0.0,
    };
    let robot = ServoRobot { drives: vec![drive; 2], model, floor: None };
    let times_s: Vec<f64> = (0..750).map(|k| 0.02 * f64::from(k)).collect();
    let command = |joint: f64, t: f64| 0.5 * ((1.3 + 0.4 * joint) * t + phase).sin() + 0.2 * (4.1 * t + joint).sin();
    let commands: Vec<Vec<f64>> = [0.0, 1.0].map(|joint| times_s.iter().map(|&t| command(joint, t)).collect()).into();
    let run = Run {
        name: "log".into(),
        positions: commands.clone(),
        commands,
        times_s,
        payloads: Vec::new(),
        gains: Vec::new(),
    };
    let positions = simulate(&robot, &run, 0.0025).unwrap().unwrap();
    let mut text = "t,q1,q2,c1,c2\n".to_owned();
    for (sample, time) in run.times_s.iter().enumerate() {
        let [one, two] = [0, 1].map(|joint: usize| (positions[joint][sample] / COUNT).round() * COUNT);
        let _ = writeln!(text, "{time},{one},{two},{},{}", run.commands[0][sample], run.commands[1][sample]);
    }
    std::fs::write(path, text).unwrap();
}

pub(crate) fn study(folder: &Path, extra: &str) -> Study {
    let robot = dynident_testing::repository("robots/planar2r.urdf");
    let text = format!(
        "[robot]\nfile = \"{}\"\n[format]\ntime = {{ column = \"t\" }}\nposition = {{ columns = \"q{{1..2}}\" }}\n\
         command = {{ columns = \"c{{1..2}}\" }}\n[[log]]\nfile = \"one.csv\"\n[[log]]\nfile = \"two.csv\"\n\
         role = \"validate\"\n{extra}",
        robot.display()
    );
    Study::parse(&text, &folder.join("study.toml")).unwrap()
}

#[test]
fn a_log_of_commands_gives_drives_that_predict_unseen_motion() {
    let folder = tempfile::tempdir().unwrap();
    write_log(&folder.path().join("one.csv"), 0.0);
    write_log(&folder.path().join("two.csv"), 1.0);
    let study = study(folder.path(), "[drive.servo.fit]\nalike = true\nstep_s = 0.005\n");
    assert!(study.fits_commands());
    let found = identify_servos(&study, &folder.path().join("study.toml"), &OPTIONS).unwrap();
    let result = &found.result;
    assert!(result.settled && result.problems.is_empty(), "{:?}", result.problems);
    // Rounding to counts has an error of 0.29 counts; the step differs from that of the simulated arm.
    let log = &result.validation[0];
    assert!(log.errors.iter().all(|error| *error < COUNT), "{:?}", log.errors);
    assert!(log.errors.iter().zip(&log.command_errors).all(|(error, command)| error * 20.0 < *command));
    assert!(!result.scale.determined && result.scale.anchor.contains("[[payload]]"), "{:?}", result.scale);
    let stiffness = result.drives[0].values.iter().find(|value| value.name == "stiffness").unwrap();
    assert!(stiffness.half_width_95 > 2.0 * stiffness.half_width_95_at_scale, "{stiffness:?}");
    let urdf = found.urdf.as_ref().unwrap();
    assert!(urdf.contains(&format!("damping=\"{:?}\"", result.drives[0].damping)), "{urdf}");
    let page = found.report().unwrap();
    assert!(page.contains("Simulated from commands alone") && page.len() < 3_000_000);
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    write_log(&folder.path().join("one.csv"), 0.0);
    write_log(&folder.path().join("two.csv"), 1.0);
    let study = study(folder.path(), "[drive.servo.fit]\niterations = 3\nstep_s = 0.005\n");
    let found = [1, 3].map(|threads| {
        let options = RunOptions { threads, ..OPTIONS };
        let mut result = identify_servos(&study, &folder.path().join("study.toml"), &options).unwrap().result;
        result.seconds = 0.0;
        serde_json::to_string(&result).unwrap()
    });
    assert_eq!(found[0], found[1]);
}

/// Without friction per load no fixed torque remains that would measure the scale.
#[test]
fn load_friction_that_is_switched_off_is_zero() {
    let folder = tempfile::tempdir().unwrap();
    write_log(&folder.path().join("one.csv"), 0.0);
    write_log(&folder.path().join("two.csv"), 1.0);
    let study = study(folder.path(), "[drive.servo.fit]\nload_friction = false\nstep_s = 0.005\n");
    let result = identify_servos(&study, &folder.path().join("study.toml"), &OPTIONS).unwrap().result;
    for drive in &result.drives {
        assert_eq!((drive.load_friction, drive.stribeck), (0.0, 0.0));
        // The delay is that from a command to its measurement. The held command of a step of 5 ms is averaged.
        let delay = drive.values.iter().find(|value| value.name == "delay").unwrap();
        assert!((delay.value - 0.02).abs() < delay.half_width_95 + 0.0005, "{delay:?}");
    }
    let reads: f64 = result.drives.iter().map(|drive| drive.read_delay_s).sum();
    assert!(reads.abs() < 1e-12, "{reads}");
    assert!(!result.scale.determined && result.scale.anchor.contains("[[payload]]"), "{:?}", result.scale);
    // The masses of the description decide the scale: they are right here.
    for drive in &result.drives {
        let stiffness = drive.values.iter().find(|value| value.name == "stiffness").unwrap();
        assert!((stiffness.value - 300.0).abs() < stiffness.half_width_95, "{stiffness:?}");
    }
}

#[test]
fn a_payload_of_unknown_inertia_and_a_wrong_link_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    write_log(&folder.path().join("one.csv"), 0.0);
    write_log(&folder.path().join("two.csv"), 1.0);
    let refused = |extra: &str| {
        let study = study(folder.path(), extra);
        identify_servos(&study, &folder.path().join("study.toml"), &OPTIONS).unwrap_err().to_string()
    };
    let unknown = refused("[[payload]]\nname = \"box\"\nlink = \"link2\"\n");
    assert!(unknown.contains("state mass_kg and com_m"), "{unknown}");
    let link = refused("[drive.servo.floor]\nheight_m = 0.0\npoints = [{ link = \"hand\", at_m = [0.0, 0.0, 0.0] }]\n");
    assert!(link.contains("unknown moving link `hand`") && link.contains("link2"), "{link}");
}

/// A study without logs, with these lines in `[drive.servo]`, and others.
pub(crate) fn designed(folder: &Path, drive: &str, others: &str) -> Study {
    let robot = dynident_testing::repository("robots/planar2r.urdf");
    let text = format!("[robot]\nfile = \"{}\"\n[drive.servo]\n{drive}\n{others}", robot.display());
    Study::parse(&text, &folder.join("study.toml")).unwrap()
}

pub(crate) const DRIVES: &str = "stiffness = 300.0\ndamping = 25.0\narmature = 0.8\ncoulomb = [3.0, 1.5]\n\
                      fit = { step_s = 0.005 }\n\
                      design = { duration_s = 12.0, candidates = 8, exchanges = 1, seed = 3 }\n";
pub(crate) const LIMITS: &str = "[design.defaults]\nfloor = false\nself_collision = false\n[design.limits]\njoints = [{ joint = \"joint1\", position = [-1.0, 1.2], speed = 2.0 }, \
                      { joint = \"joint2\", position = [-1.5, 1.5], speed = 3.0 }]\n";

#[test]
fn designed_commands_are_read_as_a_log_and_keep_the_limits() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("study.toml");
    let found = design_servos(&designed(folder.path(), DRIVES, LIMITS), &path, &OPTIONS).unwrap();
    let file = &found.file;
    assert!(file.feasible && file.limits.iter().all(|report| !report.violated), "{:?}", file.limits);
    assert!(found.positions[0].iter().all(|q| (-1.0..=1.2).contains(q)));
    assert!(found.positions[0].windows(2).all(|pair| (pair[1] - pair[0]).abs() * 50.0 <= 2.0));
    assert!(file.error_bars_to_chirp < 1.0 && file.log_det > file.chirp_log_det, "{}", file.error_bars_to_chirp);
    assert_eq!((file.drives.len(), found.commands[0].len()), (2, 600));
    for value in file.drives.iter().chain(&file.bodies).flat_map(|owner| &owner.values) {
        assert!(value.half_width_95_at_scale > 0.0 && value.half_width_95 <= 1.001 * value.half_width_95_before);
    }
    // The table is a log that `[format] command` reads.
    std::fs::write(folder.path().join("commands.csv"), found.csv()).unwrap();
    let format = "time = { column = \"t_s\" }\nposition = { columns = \"c{1..2}\" }\n\
                  command = { columns = \"c{1..2}\", unit = \"rad\" }\n";
    let format: dynident::recording::LogFormat = toml::from_str(format).unwrap();
    let joints = ["joint1", "joint2"].map(str::to_owned);
    let log = dynident::recording::Log::file(&folder.path().join("commands.csv"), format, &joints);
    let motion = log.commanded_motion().unwrap();
    assert_eq!(motion.joint(&motion.commands, 1).collect::<Vec<_>>(), found.commands[1]);
    // Another seed is another design; the number of threads is not.
    let again = design_servos(&designed(folder.path(), DRIVES, LIMITS), &path, &RunOptions { threads: 1, ..OPTIONS });
    assert_eq!(again.unwrap().commands, found.commands);
    let other = DRIVES.replace("seed = 3", "seed = 4");
    let other = design_servos(&designed(folder.path(), &other, LIMITS), &path, &OPTIONS).unwrap();
    assert_ne!(other.commands, found.commands);
}

#[test]
fn a_design_without_values_of_the_drives_or_without_motion_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |drive: &str, others: &str| {
        let study = designed(folder.path(), drive, others);
        design_servos(&study, &folder.path().join("study.toml"), &OPTIONS).unwrap_err().to_string()
    };
    let missing = refused("stiffness = 300.0\n", LIMITS);
    assert!(missing.contains("no damping, armature, coulomb in [drive.servo]"), "{missing}");
    let slow = LIMITS.replace("speed = 2.0", "speed = 1e-9");
    assert!(refused(DRIVES, &slow).contains("keeps all limits"), "{}", refused(DRIVES, &slow));
    let range = format!("command_range = [[2.0, 3.0], [-1.0, 1.0]]\n{DRIVES}");
    assert!(refused(&range, LIMITS).contains("command_range"), "{}", refused(&range, LIMITS));
    // Logs give the values that are not stated.
    write_log(&folder.path().join("one.csv"), 0.0);
    write_log(&folder.path().join("two.csv"), 1.0);
    let lines = "[drive.servo]\ndesign = { duration_s = 6.0, candidates = 3, exchanges = 0 }\n";
    let study = study(folder.path(), &format!("{lines}{LIMITS}"));
    let found = design_servos(&study, &folder.path().join("study.toml"), &OPTIONS).unwrap();
    assert!(found.file.drives[0].values.iter().any(|value| value.name == "stiffness" && value.value > 30.0));
}

/// A recorder stamps the commands 0.1 s late: the fit finds motion before its command, and the printed key corrects it.
#[test]
fn commands_that_are_recorded_late_are_a_problem_with_the_key() {
    let folder = tempfile::tempdir().unwrap();
    for (name, phase) in [("one.csv", 0.0), ("two.csv", 1.0)] {
        let path = folder.path().join(name);
        write_log(&path, phase);
        let text = std::fs::read_to_string(&path).unwrap();
        let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
        let late = |(at, row): (usize, &Vec<&str>)| {
            let command = &rows[at.saturating_sub(5).max(1)];
            if at == 0 { row.join(",") } else { [&row[..3], &command[3..]].concat().join(",") }
        };
        let lines: Vec<String> = rows.iter().enumerate().map(late).collect();
        std::fs::write(&path, lines.join("\n")).unwrap();
    }
    let fit = "[drive.servo.fit]\nalike = true\nstep_s = 0.005\n";
    let mut study = study(folder.path(), fit);
    let found = |study: &Study| identify_servos(study, &folder.path().join("study.toml"), &OPTIONS).unwrap().result;
    let problem = found(&study).problems.join("\n");
    let stated = problem.split("command_late_s = ").nth(1).and_then(|rest| rest.split(' ').next()).unwrap();
    // The servos need 20 ms of the 100.
    let stated: f64 = stated.parse().unwrap();
    assert!((stated - 0.08).abs() < 0.003, "{problem}");
    study.format.as_mut().unwrap().command_late_s = Some(0.1);
    let corrected = found(&study);
    assert!(corrected.problems.is_empty(), "{:?}", corrected.problems);
    let drive = &corrected.drives[0];
    assert!((drive.delay_s - drive.read_delay_s - 0.02).abs() < 0.001, "{drive:?}");
}
