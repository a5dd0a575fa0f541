//! Fingerprint of all inputs of an iteration's runs.

use crate::jobs::options::RunOptions;
use crate::study::{Study, StudyRobot};
use fnv::FnvHasher;
use std::hash::Hasher;

/// Hash of study, robot and program version (FNV-1a, 64 bits), followed by a hash of each table so that messages can
/// name the table that differs.
pub(super) fn fingerprint(study: &Study, robot: &StudyRobot, options: &RunOptions<'_>) -> String {
    let mut study = study.clone();
    // The name does not affect the runs.
    study.name = None;
    study.iteration = study.iteration.map(|section| section.without_unrelated_settings());
    let (model, version) = (format!("{:?}", robot.model()), env!("CARGO_PKG_VERSION"));
    let all = number(&format!("{study:?} {model} {:?} {version}", options.data));
    let mut parts = vec![format!("{all:016x}"), format!("description:{:08x}", number(&model) as u32)];
    if let Ok(serde_json::Value::Object(tables)) = study.to_json() {
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
