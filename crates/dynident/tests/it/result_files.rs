//! Output files are read back identically, also older ones, and conform to their schemas.

use crate::common::{assert_reads_back, repository};
use dynident::result::{LimitReport, RobotFault, RobotStatus};
use dynident::{ResultFile, ResultFileError, RunOptions, Silent, Study, identify, inspect};
use serde_json::Value;
use std::path::Path;
use std::sync::LazyLock;

static EXAMPLE: LazyLock<ResultFile> = LazyLock::new(|| {
    let path = repository("examples/ur10_simulated.toml");
    let study = Study::load(&path).unwrap();
    let options = RunOptions { data: None, threads: 2, progress: &Silent };
    identify(&study, &path, &options).unwrap().result
});

#[test]
fn a_result_and_an_inspection_read_back() {
    assert_reads_back(&*EXAMPLE);
    for robot in ["robots/ur10.urdf", "robots/planar2r.urdf"] {
        assert_reads_back(&inspect(&repository(robot)).unwrap());
    }
}

/// The simulated arm of README has drives; its study states only files and columns.
#[test]
fn the_example_states_nothing_of_its_drives() {
    let study = Study::load(&repository("examples/ur10_simulated.toml")).unwrap();
    assert_eq!(study.drive, dynident::study::DriveSection::default());
    assert!(EXAMPLE.drive_inertia_choice.as_ref().unwrap().seen);
    // About 1 % of the torque is noise; without drive inertia 4 % is unexplained.
    let error = EXAMPLE.validation[0].physical.as_ref().unwrap().relative_error_percent.unwrap();
    assert!(error < 1.2, "{error} %");
}

#[test]
fn a_robot_that_failed_and_a_motion_that_is_not_finite_read_back() {
    let fault = RobotFault::Hung { waiting_for: "sample".to_owned(), limit_s: 2.0 };
    assert_reads_back(&RobotStatus::Failed { fault, stopping: None });
    let report = r#"{"kind":"speed","joint":"elbow","worst_ratio":null,"at_s":1.0,"violated":true}"#;
    let read: LimitReport = serde_json::from_str(report).unwrap();
    assert!(read.worst_ratio == f64::INFINITY);
    // JSON has no infinity, so a finite number allows comparison and sorting.
    let written = serde_json::to_value(&read).unwrap();
    assert_eq!(written["worst_ratio"].as_f64(), Some(f64::MAX));
    assert_reads_back(&read);
}

#[test]
fn another_key_and_another_type_differ_from_the_schema() {
    let value = serde_json::to_value(&*EXAMPLE).unwrap();
    let differences = |change: &dyn Fn(&mut Value)| {
        let mut changed = value.clone();
        change(&mut changed);
        dynident_testing::schema::differences("result", &changed)
    };
    assert_eq!(differences(&|_| {}), [""; 0]);
    let renamed = differences(&|value| {
        let first = value["base_parameters"][0].as_object_mut().unwrap();
        let std = first.remove("std").unwrap();
        first.insert("sigma".to_owned(), std);
    });
    assert_eq!(renamed, [".base_parameters[0].std: missing", ".base_parameters[0].sigma: not in the schema"]);
    assert_eq!(differences(&|value| value["training"]["samples"] = "many".into()).len(), 1);
    assert_eq!(differences(&|value| value["robot"]["gravity_m_s2"] = vec![0.0, 9.81].into()).len(), 1);
    assert_eq!(differences(&|value| value["timings_s"] = Value::Null).len(), 1);
}

fn read(value: &Value, folder: &Path) -> Result<ResultFile, ResultFileError> {
    let path = folder.join("result.json");
    std::fs::write(&path, value.to_string()).unwrap();
    ResultFile::read(&path)
}

#[test]
fn an_older_result_reads_without_the_keys_that_came_later() {
    let folder = tempfile::tempdir().unwrap();
    let mut value = serde_json::to_value(&*EXAMPLE).unwrap();
    value["provenance"].as_object_mut().unwrap().remove("content_sha256").unwrap();
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
        "drive_inertia_choice",
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
