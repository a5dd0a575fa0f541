//! What the runs of an iteration depend on, as text that two calls compare.

use crate::jobs::options::RunOptions;
use crate::study::{Study, StudyRobot};
use fnv::FnvHasher;
use std::hash::Hasher;

/// Everything that runs depend on, in one number: study, robot, and the version of the program (FNV-1a, 64 bits); then
/// a number of each table, so that words can name the one that differs.
pub(super) fn fingerprint(study: &Study, robot: &StudyRobot, options: &RunOptions<'_>) -> String {
    let mut study = study.clone();
    // It is called otherwise, and is the same.
    study.name = None;
    study.iteration = study.iteration.map(|section| section.of_runs());
    let (model, version) = (format!("{:?}", robot.model()), env!("CARGO_PKG_VERSION"));
    let all = number(&format!("{study:?} {model} {:?} {version}", options.data));
    let mut parts = vec![format!("{all:016x}"), format!("description:{:08x}", number(&model) as u32)];
    if let Ok(serde_json::Value::Object(tables)) = serde_json::to_value(&study) {
        let stated = tables.iter().filter(|(_, value)| !value.is_null());
        parts.extend(stated.map(|(name, value)| format!("{name}:{:08x}", number(&value.to_string()) as u32)));
    }
    parts.push(format!("version:{version}"));
    parts.join(" ")
}

fn number(text: &str) -> u64 {
    let mut hasher = FnvHasher::default();
    hasher.write(text.as_bytes());
    hasher.finish()
}
