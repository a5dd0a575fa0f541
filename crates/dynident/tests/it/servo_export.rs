//! Files of drives from commands, and designed commands as data sets.

use crate::servo::{DRIVES, LIMITS, OPTIONS, designed, study, write_log};
use dynident::excitation::export::{LeRobotEpisode, lerobot_episode};
use dynident::recording::{Log, LogFormat};
use dynident::result::ServoFile;
use dynident::{ServoOutcome, ServoTarget, Study, design_servos, export_servos, identify_servos, lerobot_actions};
use dynident_model::load_robot;
use dynident_servo::{Drive, DriveLaw, Run, ServoRobot, errors, simulate_with_law};
use serde_json::Value;
use std::path::Path;

/// The identified drives of a simulated arm with a torque limit, and the study.
fn identified(folder: &Path) -> (ServoOutcome, Study) {
    write_log(&folder.join("one.csv"), 0.0);
    write_log(&folder.join("two.csv"), 1.0);
    let study =
        study(folder, "[drive.servo]\ntorque_limit = 400.0\nfit = { alike = true, step_s = 0.005, iterations = 12 }\n");
    (identify_servos(&study, &folder.join("study.toml"), &OPTIONS).unwrap(), study)
}

/// The held-out log as the fit reads it.
fn held_out(folder: &Path) -> Run {
    let format =
        "time = { column = \"t\" }\nposition = { columns = \"q{1..2}\" }\ncommand = { columns = \"c{1..2}\" }\n";
    let format: LogFormat = toml::from_str(format).unwrap();
    let joints = ["joint1", "joint2"].map(str::to_owned);
    let motion = Log::file(&folder.join("two.csv"), format, &joints).commanded_motion().unwrap();
    let columns = |values: &[f64]| [0, 1].map(|joint| motion.joint(values, joint).collect()).to_vec();
    Run {
        name: "two".into(),
        times_s: motion.times_s.clone(),
        positions: columns(&motion.positions),
        commands: columns(&motion.commands),
        payloads: Vec::new(),
        gains: Vec::new(),
    }
}

#[test]
fn each_form_has_the_error_of_its_own_drives() {
    let folder = tempfile::tempdir().unwrap();
    let (found, _) = identified(folder.path());
    let result = &found.result;
    let names: Vec<&str> = result.forms.iter().map(|form| form.form.as_str()).collect();
    assert_eq!(names, ["isaac-lab-implicit", "isaac-lab-delayed", "mjcf"]);
    let run = held_out(folder.path());
    for (form, law) in result.forms.iter().zip([DriveLaw::Implicit, DriveLaw::Explicit, DriveLaw::Identified]) {
        // The drives by the numbers of result.json, and the delay by the documentation of the form.
        let drive = |(joint, stored): (usize, &dynident::result::ServoDrive)| {
            let delay_s = (stored.delay_s - stored.read_delay_s).max(0.0);
            Drive {
                torque_limit: stored.torque_limit.unwrap(),
                delay_s: match law {
                    DriveLaw::Implicit => 0.0,
                    DriveLaw::Explicit => f64::from(form.delay_steps[joint]) * 0.005,
                    DriveLaw::Identified => delay_s,
                },
                ..Drive::typical(stored.stiffness, stored.damping, stored.armature, stored.mean_friction)
            }
        };
        let drives: Vec<Drive> = result.drives.iter().enumerate().map(drive).collect();
        let drives = drives.into_iter().map(|drive| Drive { load_friction: 0.0, stribeck: 0.0, ..drive }).collect();
        let model = load_robot(dynident_testing::repository("robots/planar2r.urdf")).unwrap().model;
        let bodies: Vec<_> =
            result.bodies.iter().map(|body| dynident_model::InertialParameters(body.parameters)).collect();
        let robot = ServoRobot { model: model.with_inertials(&bodies).unwrap(), drives, floor: None };
        let log = form.logs.iter().find(|log| log.held_out).unwrap();
        let motion = simulate_with_law(&robot, &run, form.step_s, law).unwrap().unwrap();
        for (own, expected) in log.errors.as_ref().unwrap().iter().zip(errors(&run, &motion)) {
            // The same numbers after the CSV and the result: rounding of some thousand steps.
            assert!((own - expected).abs() < 1e-9, "{}: {own} {expected}", form.form);
        }
        assert_eq!(log.model_errors, result.validation[0].errors);
    }
    // The simulated arm has a delay of 20 ms: four physics steps, and a large error without it.
    assert_eq!(result.forms[1].delay_steps, [4, 4]);
    let [implicit, delayed] = [0, 1].map(|form: usize| result.forms[form].mean_errors().unwrap());
    assert!(implicit[0] > 5.0 * delayed[1] && implicit[0] > 2.0 * delayed[0], "{implicit:?} {delayed:?}");
    assert!(result.forms[0].lost[0].contains("without the delay"), "{:?}", result.forms[0].lost);
}

/// The dictionary of drives in an exported module, by joint: one line each, JSON but for `None`.
fn drives(module: &str) -> serde_json::Map<String, Value> {
    let body = module.split_once("DRIVES = {\n").unwrap().1.split_once("\n}\n").unwrap().0;
    let text = format!("{{{}}}", body.trim_end().trim_end_matches(',').replace("None", "null"));
    serde_json::from_str(&text).unwrap()
}

#[test]
fn exported_numbers_are_those_of_the_result_and_descriptions_those_of_identify() {
    let folder = tempfile::tempdir().unwrap();
    let (found, study) = identified(folder.path());
    let path = folder.path().join("result.json");
    std::fs::write(&path, serde_json::to_string(&found.result).unwrap()).unwrap();
    let stored = ServoFile::read(&path).unwrap().unwrap();
    let made = export_servos(&stored, &path, ServoTarget::IsaacLab, None, None).unwrap();
    let written = drives(&made.exported.text);
    assert_eq!(written.len(), 2);
    for (joint, drive) in stored.joints.iter().zip(&found.result.drives) {
        let expected = [
            ("stiffness", Some(drive.stiffness)),
            ("damping", Some(drive.damping)),
            ("armature", Some(drive.armature)),
            ("friction", Some(drive.mean_friction)),
            ("effort_limit", drive.torque_limit),
            ("velocity_limit", drive.velocity_limit),
            ("delay_s", Some((drive.delay_s - drive.read_delay_s).max(0.0))),
        ];
        for (key, value) in expected {
            assert_eq!(written[joint][key].as_f64(), value, "{key} of {joint}");
        }
    }
    assert_eq!(made.forms[..], found.result.forms[..2]);
    for words in ["PHYSICS_STEP_S = 0.005", "# implicit(): without the delay", "held-out logs: joint1"] {
        assert!(made.exported.text.contains(words), "{words}\n{}", made.exported.text);
    }
    let at = folder.path().join("study.toml");
    let urdf = export_servos(&stored, &path, ServoTarget::Urdf, Some((&study, &at)), None).unwrap();
    assert_eq!(Some(&urdf.exported.text), found.urdf.as_ref());
    let refused = |target, study| export_servos(&stored, &path, target, study, None).unwrap_err().to_string();
    assert!(refused(ServoTarget::Urdf, None).contains("--study"), "{}", refused(ServoTarget::Urdf, None));
    let other = refused(ServoTarget::Mjcf, Some((&study, &at)));
    assert!(other.contains("use --to urdf"), "{other}");
}

#[test]
fn a_result_with_wrong_numbers_or_another_schema_is_not_exported() {
    let path = Path::new("result.json");
    assert!(ServoFile::parse(br#"{"schema": "dynident/result/1"}"#, path).unwrap().is_none());
    let drive = dynident::result::ServoDrive { stiffness: -1.0, ..Default::default() };
    let mut file = ServoFile {
        schema: dynident::result::SERVO_SCHEMA.to_owned(),
        joints: vec!["a".to_owned()],
        rotary: vec![true],
        drives: vec![drive],
        ..ServoFile::default()
    };
    let refused = |file: &ServoFile| {
        ServoFile::parse(serde_json::to_string(file).unwrap().as_bytes(), path).unwrap_err().to_string()
    };
    assert!(refused(&file).contains("stiffness = -1 of the drive of joint `a`"), "{}", refused(&file));
    file.drives.clear();
    assert!(refused(&file).contains("drives has 0 entries for 1 joints"), "{}", refused(&file));
}

const LEROBOT: &str = "[format]\ntime = { column = \"time\" }\n\
    position = { columns = [\"observation.state[one.pos]\", \"observation.state[two.pos]\"], unit = \"deg\" }\n\
    command = { columns = [\"action[one.pos]\", \"action[two.pos]\"], unit = [\"deg\", \"rad\"], scale = [1.0, 0.02], \
    sign = [-1, 1], offset = [0.1, -0.5] }\n";

#[test]
fn designed_commands_are_a_lerobot_data_set_that_is_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("study.toml");
    let others = format!("{LEROBOT}{LIMITS}");
    for (others, names) in [(&others[..], ["one.pos", "two.pos"]), (LIMITS, ["joint1.pos", "joint2.pos"])] {
        let study = designed(folder.path(), DRIVES, others);
        let found = design_servos(&study, &path, &OPTIONS).unwrap();
        let actions = lerobot_actions(&study, &path, &found.robot, &found.commands).unwrap();
        assert_eq!((&actions.names[..], actions.notes.len()), (&names.map(str::to_owned)[..], 1));
        let episode = LeRobotEpisode {
            robot_type: "planar",
            task: "excitation",
            rate_hz: found.file.rate_hz,
            names: &actions.names,
            actions: &actions.values,
        };
        for (name, contents) in lerobot_episode(&episode).unwrap() {
            let at = folder.path().join(name);
            std::fs::create_dir_all(at.parent().unwrap()).unwrap();
            std::fs::write(at, contents).unwrap();
        }
        // Dynident's reader, with the columns of the study's format in SI and with raw columns.
        let data_set = folder.path().join("lerobot");
        let read = |command: &str| {
            let position = command.replace(", offset = [0.1, -0.5]", "");
            let text =
                format!("time = {{ column = \"time\" }}\nposition = {{ {position} }}\ncommand = {{ {command} }}\n");
            let joints = ["joint1", "joint2"].map(str::to_owned);
            Log::file(&data_set, toml::from_str(&text).unwrap(), &joints).commanded_motion().unwrap()
        };
        let raw = read(&format!("columns = [\"action[{}]\", \"action[{}]\"]", names[0], names[1]));
        for (joint, values) in actions.values.iter().enumerate() {
            let expected: Vec<f64> = values.iter().map(|value| f64::from(*value as f32)).collect();
            assert_eq!(raw.joint(&raw.commands, joint).collect::<Vec<_>>(), expected, "{}", names[joint]);
        }
        for (frame, time) in raw.times_s.iter().enumerate() {
            assert!((time - found.times_s[frame]).abs() < 1e-6, "{time}");
        }
        let format = if others == LIMITS {
            "columns = [\"action[joint1.pos]\", \"action[joint2.pos]\"], unit = \"deg\"".to_owned()
        } else {
            LEROBOT.split_once("command = { ").unwrap().1.split_once(" }").unwrap().0.to_owned()
        };
        let motion = read(&format);
        for (joint, commands) in found.commands.iter().enumerate() {
            for (read, command) in motion.joint(&motion.commands, joint).zip(commands) {
                // 32-bit numbers of up to some hundred degrees: 2^-24 of 3 rad.
                assert!((read - command).abs() < 4e-7, "{read} {command}");
            }
        }
    }
}

#[test]
fn a_servo_gain_in_a_study_of_torque_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let log = "[[log]]\nfile = \"half.csv\"\nservo_gain = 0.5\n";
    let format = |columns: &str| {
        format!(
            "[robot]\nfile = \"arm.urdf\"\n[format]\nposition = {{ columns = \"q{{1..2}}\" }}\nrate_hz = 100.0\n{columns}\n{log}"
        )
    };
    let read = |text: &str| Study::parse(text, &folder.path().join("study.toml"));
    let torque = format("torque = { columns = \"tau{1..2}\" }");
    let refused = read(&torque).unwrap_err().to_string();
    assert!(refused.contains("servo_gain of the log half.csv") && refused.contains("remove servo_gain"), "{refused}");
    // The drives of this study are fitted to its commands; the torque is not used.
    let both = format("torque = { columns = \"tau{1..2}\" }\ncommand = { columns = \"c{1..2}\" }");
    assert!(read(&both).is_err());
    read(&format!("{both}\n[drive.servo]\nstiffness = 10.0\n")).unwrap();
    read(&format("command = { columns = \"c{1..2}\" }")).unwrap();
}
