//! Studies of sections and of what lies in memory.

use crate::callables::Callables;
use crate::errors;
use dynident::Study;
use dynident::model::Robot;
use dynident::recording::MemoryLog;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::Path;

/// The study of sections in JSON, of a robot, of samples in memory (one entry for each log, None for one in a file) and
/// of code.
pub(crate) fn assembled(
    py: Python<'_>,
    sections: &str,
    path: &Path,
    robot: Option<Robot>,
    samples: Vec<Option<MemoryLog>>,
    callables: &Callables,
) -> PyResult<Study> {
    let mut study = Study::from_json(sections, path).map_err(|error| errors::job(py, &error))?;
    study.robot.description = robot.map(Box::new);
    for (log, samples) in study.log.iter_mut().zip(samples) {
        log.samples = samples;
    }
    callables.attach(py, &mut study)?;
    Ok(study)
}

/// A dictionary of keyword arguments as JSON.
pub(crate) fn json_of(py: Python<'_>, settings: &Bound<'_, PyDict>) -> PyResult<String> {
    py.import("json")?.call_method1("dumps", (settings,))?.extract()
}
