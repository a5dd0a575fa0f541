//! Studies from sections and objects in memory.

use crate::callables::Callables;
use crate::errors;
use dynident::Study;
use dynident::model::Robot;
use dynident::recording::MemoryLog;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::Path;

/// Creates a study from sections in JSON, a robot, samples in memory (one entry per log, None for a log in a file) and
/// Python functions.
pub(crate) fn assembled(
    py: Python<'_>,
    sections: &str,
    path: &Path,
    robot: Option<Robot>,
    samples: Vec<Option<MemoryLog>>,
    callables: &Callables,
) -> PyResult<Study> {
    let mut study = Study::from_json(sections, path).map_err(|error| errors::job(py, &error.into()))?;
    study.robot.description = robot.map(Box::new);
    for (log, samples) in study.log.iter_mut().zip(samples) {
        log.samples = samples;
    }
    callables.attach(py, &mut study)?;
    Ok(study)
}

pub(crate) fn json_of(py: Python<'_>, settings: &Bound<'_, PyDict>) -> PyResult<String> {
    py.import("json")?.call_method1("dumps", (settings,))?.extract()
}
