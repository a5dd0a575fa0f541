//! Studies with robot and samples in memory, and jobs on results in memory.

use crate::common::repository;
use dynident::dynamics::ParametricModel;
use dynident::model::terms::JointMotion;
use dynident::model::{InertialParameters, load_robot};
use dynident::recording::MemoryLog;
use dynident::{
    Error, Folders, ResultFile, RunOptions, Silent, Study, StudyError, StudyFileError, StudyRobot, TorquePredictor,
    identify, validate, validate_result,
};
use std::path::{Path, PathBuf};

fn options() -> RunOptions<'static> {
    RunOptions { data: None, threads: 2, progress: &Silent }
}

/// The UR10 example with stated friction and drives, which needs no selection.
fn study() -> (Study, PathBuf) {
    let path = repository("examples/ur10_simulated.toml");
    let mut text = std::fs::read_to_string(&path).unwrap();
    text = text.replacen("[drive]\n", "[drive]\nfriction = \"stated\"\n", 1);
    if !text.contains("friction = \"stated\"") {
        text.push_str("\n[drive]\nfriction = \"stated\"\ndrive_inertia = true\n");
    }
    (Study::parse(&text, &path).unwrap(), path)
}

fn table(path: &Path) -> MemoryLog {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let names: Vec<String> = reader.headers().unwrap().iter().map(str::to_owned).collect();
    let rows = reader.records().map(|row| row.unwrap().iter().map(|text| text.parse::<f64>().unwrap()).collect());
    let rows: Vec<Vec<f64>> = rows.collect();
    let columns = (0..names.len()).map(|column| rows.iter().map(|row| row[column]).collect()).collect();
    MemoryLog::columns(&path.file_name().unwrap().to_string_lossy(), Some(names), columns).unwrap()
}

fn carried(study: &Study, path: &Path) -> Study {
    let mut carried = study.clone();
    let folders = Folders::new(study, path, None);
    for log in &mut carried.log {
        log.samples = Some(table(&folders.find(&log.file, None).unwrap()));
    }
    let robot = load_robot(folders.find(&study.robot.file, None).unwrap()).unwrap();
    carried.robot.description = Some(Box::new(robot));
    carried
}

#[test]
fn samples_in_memory_give_the_bits_of_the_files() {
    let (study, path) = study();
    let of_files = identify(&study, &path, &options()).unwrap();
    let carried = carried(&study, &path);
    let in_memory = identify(&carried, Path::new("<study>"), &options()).unwrap();
    let comparable = |result: &ResultFile| {
        let mut value = serde_json::to_value(result).unwrap();
        for key in ["timings_s", "provenance", "logs", "robot", "name"] {
            value.as_object_mut().unwrap().remove(key).unwrap();
        }
        // The predicted errors depend on the number of rows, which is only estimated for a text file.
        value["method"].as_object_mut().unwrap().remove("cutoff").unwrap();
        value
    };
    let [serde_json::Value::Object(a), serde_json::Value::Object(b)] =
        [&in_memory, &of_files].map(|found| comparable(&found.result))
    else {
        panic!("a result is an object")
    };
    let different: Vec<&String> = a.keys().filter(|key| a[*key] != b[*key]).collect();
    assert!(different.is_empty() && a.len() == b.len(), "{different:?}");

    // The provenance contains hashes; that of the robot description equals that of the file.
    let [a, b] = [&of_files.result, &in_memory.result].map(|result| result.provenance.as_ref().unwrap());
    let hash = |inputs: &[dynident::result::InputFile], what: &str| -> Vec<String> {
        inputs.iter().filter(|input| input.what == what).map(|input| input.sha256.clone()).collect()
    };
    assert_eq!(hash(&a.inputs, "robot"), hash(&b.inputs, "robot"));
    assert_eq!(hash(&b.inputs, "log").len(), 2);
    let mut other = carried.clone();
    other.log[0].samples = other.log[1].samples.clone();
    other.log[1].fraction = Some([0.0, 0.4]);
    other.log[0].fraction = Some([0.5, 1.0]);
    let changed = identify(&other, Path::new("<study>"), &options()).unwrap();
    assert_ne!(changed.result.provenance.unwrap().identity, b.identity);
}

#[test]
fn samples_that_are_fitted_to_are_not_tested_on() {
    let (study, path) = study();
    let mut carried = carried(&study, &path);
    // Equal numbers in another table.
    carried.log[1].samples = Some(table(&repository("examples/ur10_simulated/train.csv")));
    let refused = identify(&carried, &path, &options()).unwrap_err();
    let Error::Study(StudyFileError::Study { source, .. }) = &refused else { panic!("{refused}") };
    assert!(matches!(**source, StudyError::Overlap { .. }), "{refused}");
}

#[test]
fn studies_go_through_toml_and_json_unchanged() {
    let mut tried = 0;
    for entry in std::fs::read_dir(repository("examples")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            let study = Study::load(&path).unwrap();
            let shown = format!("{study:?}");
            assert_eq!(format!("{:?}", Study::parse(&study.to_toml().unwrap(), &path).unwrap()), shown);
            let json = serde_json::to_string(&study).unwrap();
            assert_eq!(format!("{:?}", Study::from_json(&json, &path).unwrap()), shown);
            tried += 1;
        }
    }
    assert!(tried > 20);
    let refused =
        Study::from_json(r#"{"robot": {"file": "arm.urdf", "colour": "red"}}"#, Path::new("here")).unwrap_err();
    assert!(refused.to_string().contains("unknown field `colour`"), "{refused}");
}

#[test]
fn a_result_in_memory_predicts_and_is_tested() {
    let (study, path) = study();
    let found = identify(&study, &path, &options()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("result.json");
    std::fs::write(&file, serde_json::to_vec(&found.result).unwrap()).unwrap();
    let stored = ResultFile::read(&file).unwrap();
    let [by_file, in_memory] = [
        validate(&file, &study, &path, &options()).unwrap(),
        validate_result(&stored, Path::new("<model>"), &study, &path, &options()).unwrap(),
    ];
    assert_eq!(serde_json::to_value(&by_file).unwrap(), serde_json::to_value(&in_memory).unwrap());

    // The prediction is the torque of the exported bodies and terms.
    let predictor = TorquePredictor::new(&stored, &file, &study, &path, None).unwrap();
    let (samples, joints) = (300, predictor.dof());
    let at = |shift: f64| -> Vec<f64> { (0..samples * joints).map(|k| (0.37 * k as f64 + shift).sin()).collect() };
    let (q, dq, ddq) = (at(0.0), at(1.0), at(2.0));
    let predicted = predictor.predict(&JointMotion { samples, q: &q, dq: &dq, ddq: &ddq });
    let robot = StudyRobot::new(&study, &path, &Folders::new(&study, &path, None)).unwrap();
    let bodies: Vec<InertialParameters> = found.inertials.clone();
    let model: &ParametricModel = &robot.parametric;
    let terms: Vec<f64> = model
        .terms()
        .iter()
        .map(|term| {
            let mut all = stored.joints.iter().flat_map(|joint| &joint.terms);
            all.find(|known| known.symbol == term.symbol()).unwrap().value
        })
        .collect();
    let robot = dynident::export::RobotModel::new(
        model.model().with_inertials(&bodies).unwrap(),
        model.terms().to_vec(),
        terms,
    )
    .unwrap();
    let file = dynident::export::export(&robot, dynident::export::Target::Json, &[]).unwrap();
    assert!(file.text.contains("dynident/model/1"));
    let full: Vec<f64> = bodies.iter().flat_map(|body| body.0).chain(robot.terms().map(|(_, value)| value)).collect();
    for sample in [0, 127, 128, 299] {
        let of = |values: &[f64]| -> Vec<f64> { (0..joints).map(|joint| values[joint * samples + sample]).collect() };
        let theta = model.base().values(&full);
        let one = JointMotion { samples: 1, q: &of(&q), dq: &of(&dq), ddq: &of(&ddq) };
        let mut panels = dynident::dynamics::Panels::default();
        let mut workspace = dynident::dynamics::BatchWorkspace::new(model.model());
        dynident::dynamics::regressor_panels(model.model(), &mut workspace, model.layout(), &one, &mut panels);
        for joint in 0..joints {
            let columns = model.layout().joint_columns(joint);
            let tau: f64 = columns.iter().zip(panels.joint(joint)).map(|(&column, entry)| theta[column] * entry).sum();
            let predicted = predicted.tau[joint * samples + sample];
            // Base parameters have all digits in the result; bodies are sums with rounding.
            assert!((predicted - tau).abs() < 1e-6 * (1.0 + tau.abs()), "joint {joint}: {predicted} and {tau}");
        }
    }
    assert!(predicted.half_width_95.iter().all(|half| half.is_finite() && *half > 0.0));
}
