//! Files that jobs write: read back as they were written, older ones too, and no key renamed.

use crate::common::{assert_reads_back, repository};
use dynident::result::{LimitReport, RobotFault, RobotStatus};
use dynident::{Error, ResultFile, RunOptions, Silent, Study, identify, inspect};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::LazyLock;

/// The example that the repository holds, identified.
static EXAMPLE: LazyLock<ResultFile> = LazyLock::new(|| {
    let path = repository("examples/ur10_simulated.toml");
    let study = Study::load(&path).unwrap();
    let options = RunOptions { data: None, threads: 2, progress: &Silent };
    identify(&study, &path, &options).unwrap().result
});

/// Every path of keys, entries of a list alike.
fn key_paths(value: &Value, path: &str, paths: &mut BTreeSet<String>) {
    match value {
        Value::Object(entries) => {
            for (key, value) in entries {
                let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                paths.insert(path.clone());
                key_paths(value, &path, paths);
            }
        }
        Value::Array(values) => values.iter().for_each(|value| key_paths(value, &format!("{path}[]"), paths)),
        _ => {}
    }
}

#[test]
fn keys_of_a_result_are_those_of_the_list() {
    let mut found = BTreeSet::new();
    key_paths(&serde_json::to_value(&*EXAMPLE).unwrap(), "", &mut found);
    let list = repository("crates/dynident/tests/it/result_keys.txt");
    if std::env::var_os("DYNIDENT_WRITE_KEYS").is_some() {
        let lines: Vec<&str> = found.iter().map(String::as_str).collect();
        std::fs::write(&list, lines.join("\n") + "\n").unwrap();
    }
    let listed = std::fs::read_to_string(list).unwrap();
    let listed: BTreeSet<&str> = listed.lines().collect();
    let lost: Vec<&&str> = listed.iter().filter(|key| !found.contains(**key)).collect();
    let new: Vec<&String> = found.iter().filter(|key| !listed.contains(key.as_str())).collect();
    assert!(lost.is_empty(), "keys are added, never renamed, within a version; these are gone: {lost:?}");
    assert!(new.is_empty(), "add to result_keys.txt (DYNIDENT_WRITE_KEYS=1 writes it): {new:?}");
}

#[test]
fn a_result_and_an_inspection_read_back() {
    assert_reads_back(&*EXAMPLE);
    for robot in ["robots/ur10.urdf", "robots/planar2r.urdf"] {
        assert_reads_back(&inspect(&repository(robot)).unwrap());
    }
}

#[test]
fn a_robot_that_failed_and_a_motion_that_is_not_finite_read_back() {
    let fault = RobotFault::Hung { waiting_for: "sample".to_owned(), limit_s: 2.0 };
    assert_reads_back(&RobotStatus::Failed { fault });
    let report = r#"{"kind":"speed","joint":"elbow","worst_ratio":null,"at_s":1.0,"violated":true}"#;
    let read: LimitReport = serde_json::from_str(report).unwrap();
    assert!(read.worst_ratio == f64::INFINITY);
    assert_reads_back(&read);
}

fn read(value: &Value, folder: &Path) -> Result<ResultFile, Error> {
    let path = folder.join("result.json");
    std::fs::write(&path, value.to_string()).unwrap();
    ResultFile::read(&path)
}

#[test]
fn an_older_result_reads_without_the_keys_that_came_later() {
    let folder = tempfile::tempdir().unwrap();
    let mut value = serde_json::to_value(&*EXAMPLE).unwrap();
    for key in [
        "noise_in_regressor",
        "gross_errors",
        "noise_correlation",
        "noise_levels",
        "periodic",
        "simulated",
        "base_parameter_covariance",
        "possible_intervals",
        "essential",
        "friction_choice",
        "payloads",
        "offsets",
        "drive_gains",
        "couplings",
        "torque_band",
        "no_urdf",
    ] {
        assert!(value.as_object_mut().unwrap().remove(key).is_some(), "{key}");
    }
    for parameter in value["base_parameters"].as_array_mut().unwrap() {
        parameter.as_object_mut().unwrap().remove("half_width_95");
        parameter.as_object_mut().unwrap().remove("physical");
    }
    let older = read(&value, folder.path()).unwrap();
    assert_eq!(older.base_parameters.len(), EXAMPLE.base_parameters.len());
    assert!(older.payloads.is_empty() && older.base_parameter_covariance.is_empty());
    value["schema"] = "dynident/result/2".into();
    let message = read(&value, folder.path()).unwrap_err().to_string();
    assert!(message.contains("dynident/result/2") && message.contains("identify again"), "{message}");
    value["schema"] = "dynident/result/1".into();
    value.as_object_mut().unwrap().remove("base_parameters");
    let message = read(&value, folder.path()).unwrap_err().to_string();
    assert!(message.contains("base_parameters"), "{message}");
}
