//! Generated studies compared with manually written ones.

use crate::common::{recordings, repository};
use dynident::recording::LogFormat;
use dynident::recording::log::{ChannelGroup, ColumnRef};
use dynident::result::{StudyChange, Unsure};
use dynident::{Error, NewStudy, RunOptions, Silent, Study, XacroSettings, new_study};
use dynident_identification::Role;
use std::path::{Path, PathBuf};

struct Written {
    study: Study,
    unsure: Vec<String>,
    text: String,
}

fn reading_keys(study: &Study) -> ([String; 3], [String; 3]) {
    let format = study.format.as_ref().unwrap();
    (reading(&format.position).1, reading(format.torque.as_ref().unwrap()).1)
}

fn request(folder: &Path, robot: &Path, logs: &[PathBuf], rate_hz: Option<f64>) -> NewStudy {
    NewStudy {
        robot: robot.to_owned(),
        description: None,
        xacro: XacroSettings::default(),
        logs: logs.to_vec(),
        out: folder.join("study.toml"),
        rate_hz,
        stated: Vec::new(),
    }
}

fn written(robot: &Path, logs: &[PathBuf], rate_hz: Option<f64>) -> Written {
    let folder = tempfile::tempdir().unwrap();
    let request = request(folder.path(), robot, logs, rate_hz);
    let found = new_study(&request, &RunOptions { data: None, threads: 1, progress: &Silent }).unwrap();
    let study = Study::parse(&found.text, &request.out).unwrap_or_else(|error| panic!("{error}\n{}", found.text));
    let unsure = found.unsure.iter().map(Unsure::sentence).collect();
    Written { study, unsure, text: found.text }
}

/// Everything that determines the numbers of a group: columns, units, scales, signs.
fn reading(group: &ChannelGroup) -> (Vec<ColumnRef>, [String; 3], Option<PathBuf>) {
    let keys = [format!("{:?}", group.unit), format!("{:?}", group.scale), format!("{:?}", group.sign)];
    (group.column_list("columns").unwrap(), keys, group.file.clone())
}

fn by_hand(example: &str) -> Study {
    let path = repository("examples").join(example);
    Study::load(&path).unwrap()
}

/// Checks that positions, torques, clock and joints equal those of the example.
fn is_read_alike(example: &str, found: &Written) {
    let hand = by_hand(example);
    let (own, other) = (found.study.format.as_ref().unwrap(), hand.format.as_ref().unwrap());
    assert_eq!(reading(&own.position), reading(&other.position), "{example}\n{}", found.text);
    let torques = |format: &LogFormat| reading(format.torque.as_ref().unwrap());
    assert_eq!(torques(own), torques(other), "{example}\n{}", found.text);
    assert_eq!(format!("{:?}", own.time), format!("{:?}", other.time), "{example}\n{}", found.text);
    assert_eq!(own.rate_hz, other.rate_hz, "{example}\n{}", found.text);
}

#[test]
fn public_recordings_need_no_edit() {
    let Some(data) = recordings() else { return };
    let files = |names: &[&str]| names.iter().map(|name| data.join(name)).collect::<Vec<_>>();
    let lwr = ["kuka_lwr4plus/traj2.csv", "kuka_lwr4plus/traj3.csv", "kuka_lwr4plus/traj1.csv"];
    let dfki = ["00", "01", "02", "03", "04", "05", "06"];
    let dfki = dfki.map(|number| format!("dfki_double_pendulum/designC_traj{number}.csv"));
    let dfki = dfki.each_ref().map(String::as_str);
    let cases = [
        ("lwr4plus_23_to_1.toml", "kuka_lwr4plus/kuka_lwr4.urdf", &lwr[..], None),
        ("ur10.toml", "ur10_unisa/ur10_robot.urdf", &["ur10_unisa/exciting_trajectory.csv"], None),
        ("panda.toml", "panda_unisa/panda.urdf", &["panda_unisa/exciting_trajectory.csv"], None),
        ("dfki_pendulum.toml", "dfki_double_pendulum/double_pendulum_designC.urdf", &dfki[..], None),
    ];
    for (example, robot, logs, rate_hz) in cases {
        let found = written(&data.join(robot), &files(logs), rate_hz);
        assert!(found.unsure.is_empty(), "{example}: {:?}\n{}", found.unsure, found.text);
        is_read_alike(example, &found);
        let tested = |study: &Study| study.log.iter().filter(|log| log.role == Role::Validate).count();
        assert_eq!(tested(&found.study), 1, "{example}");
        let drives = |study: &Study| study.drive.drive_inertia;
        assert_eq!(drives(&found.study), drives(&by_hand(example)), "{example}\n{}", found.text);
    }
}

/// The sensors of the LBR have the opposite sign: the logs show a wrong sign, but not which. The proposed line equals
/// the manual one.
#[test]
fn a_sign_is_asked_for_and_stated() {
    let Some(data) = recordings() else { return };
    let folder = tempfile::tempdir().unwrap();
    let robot = data.join("kuka_lbr_med7/med7dock.urdf");
    let mut request = request(folder.path(), &robot, &[data.join("kuka_lbr_med7/measurements.csv")], Some(100.0));
    let options = RunOptions { data: None, threads: 1, progress: &Silent };
    let found = new_study(&request, &options).unwrap();
    let finding = found.check.iter().flat_map(|check| &check.findings).find(|finding| finding.kind == "sign").unwrap();
    assert_eq!(finding.write[0].table, "format.torque", "{}", finding.sentence());
    assert!(finding.write.iter().all(StudyChange::is_well_formed));
    assert!(found.unsure.iter().any(|unsure| unsure.sentence().contains("sign = -1")), "{:?}", found.unsure);

    let proposed: Vec<StudyChange> = found.unsure.iter().flat_map(|unsure| unsure.proposed.clone()).collect();
    assert_eq!(proposed, finding.write);
    request.stated = proposed;
    let found = new_study(&request, &options).unwrap();
    assert!(found.unsure.is_empty(), "{:?}", found.unsure);
    let study = Study::parse(&found.text, &request.out).unwrap();
    is_read_alike("lbr_med7.toml", &Written { study, unsure: Vec::new(), text: found.text });
}

/// Currents with unknown constants, positions and efforts in separate files.
#[test]
fn what_no_name_and_no_number_tells_is_marked() {
    let Some(data) = recordings() else { return };
    let files = |names: &[&str]| names.iter().map(|name| data.join(name)).collect::<Vec<_>>();
    let tx40 = files(&["staubli_tx40/pos_read_data.csv", "staubli_tx40/curr_data.csv"]);
    let found = written(&data.join("staubli_tx40/tx40_mdh_modified.urdf"), &tx40, None);
    let torque = &found.study.format.as_ref().unwrap().torque.as_ref().unwrap();
    assert_eq!(torque.file.as_deref(), Some(Path::new("curr_data.csv")), "{}", found.text);
    for key in ["scale", "rate_hz", "unit"] {
        assert!(found.unsure.iter().any(|line| line.contains(key)), "{key}: {:?}", found.unsure);
    }

    let tiago = files(&["tiago_arm/tiago_position.csv", "tiago_arm/tiago_velocity.csv", "tiago_arm/tiago_effort.csv"]);
    let found = written(&data.join("tiago_arm/tiago.urdf"), &tiago, None);
    assert_eq!(found.study.robot.joints, by_hand("tiago.toml").robot.joints, "{}", found.text);
    // Currents named as efforts: no scale of the positions is proposed that would explain them.
    let (position, ..) = reading_keys(&found.study);
    assert!(position.iter().all(|key| key == "None"), "{position:?}\n{}", found.text);
    assert!(!found.unsure.is_empty());
}

/// The simulated arm of README, from its files alone; unknowns are marked.
#[test]
fn a_recording_without_a_clock_needs_its_rate() {
    let folder = tempfile::tempdir().unwrap();
    let robot = repository("robots/ur10.urdf");
    let logs = ["train.csv", "test.csv"].map(|name| repository("examples/ur10_simulated").join(name)).to_vec();
    let found = written(&robot, &logs, None);
    assert!(found.unsure.is_empty(), "{:?}\n{}", found.unsure, found.text);
    is_read_alike("ur10_simulated.toml", &found);
    assert!(found.text.contains("drive_inertia = true"), "{}", found.text);

    let without_clock = |path: &PathBuf| {
        let text = std::fs::read_to_string(path).unwrap();
        let rows = text.lines().map(|line| line.split_once(',').unwrap().1).collect::<Vec<_>>().join("\n");
        let copy = folder.path().join(path.file_name().unwrap());
        std::fs::write(&copy, rows).unwrap();
        copy
    };
    let logs: Vec<PathBuf> = logs.iter().map(without_clock).collect();
    let found = written(&robot, &logs, None);
    assert!(found.unsure.iter().any(|line| line.contains("rate_hz")), "{:?}", found.unsure);
    assert!(found.text.contains("# UNSURE: no time column recognised"), "{}", found.text);

    // A recording with other columns is reported.
    let alien = folder.path().join("alien.csv");
    std::fs::write(&alien, "t_s,speed_of_wind\n0,1\n1,2\n").unwrap();
    let found = written(&robot, &[repository("examples/ur10_simulated/train.csv"), alien], None);
    assert!(found.unsure.iter().any(|line| line.contains("alien.csv is not in the study")), "{:?}", found.unsure);

    let other = repository("robots/panda.urdf");
    let few = folder.path().join("few.csv");
    std::fs::write(&few, "t_s,temperature\n0,20\n0.1,21\n").unwrap();
    let options = RunOptions { data: None, threads: 1, progress: &Silent };
    let refused = new_study(&request(folder.path(), &other, &[few], None), &options).unwrap_err();
    assert!(matches!(&refused, Error::NewStudy(_)) && refused.to_string().contains("temperature"), "{refused}");
}
