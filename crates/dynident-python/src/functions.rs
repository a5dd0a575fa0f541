//! The jobs of the command as functions: a study in, JSON and models out.

use crate::errors;
use crate::jobs::{run, threads as threads_or_all};
use crate::model::{Descriptions, FittedModel};
use crate::study::Study;
use core::ops::ControlFlow;
use dynident::excitation::DesignProgress;
use dynident::excitation::export::{ExportError, Sampled, trajectory_csv};
use dynident::{
    Error, IdentificationOutcome, RunOptions, check, design_study, identify, log_contents, simulate_study,
    validate_result,
};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

/// A value as JSON.
fn json(value: &impl serde::Serialize) -> Result<String, Error> {
    serde_json::to_string(value)
        .map_err(|error| Error::Result { path: PathBuf::from("<result>"), message: error.to_string() })
}

/// Fits a study's model to its logs and tests it on the held-out ones.
#[pyfunction]
#[pyo3(signature = (study, threads=None, progress=None))]
pub(crate) fn _identify(
    py: Python<'_>,
    study: &Bound<'_, Study>,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<FittedModel> {
    let (study, path) = study.get().owned();
    let threads = threads_or_all(threads);
    run(py, threads, progress, move |watch| {
        let outcome = identify(&study, &path, &RunOptions { data: None, threads, progress: watch })?;
        let report = outcome.report()?;
        let IdentificationOutcome { result, urdf, table, mjcf, sdf, .. } = outcome;
        FittedModel::new(study, path, json(&result)?, Descriptions { urdf, table, mjcf, sdf }, report)
    })
}

/// Examines a study against its robot and its logs: JSON.
#[pyfunction]
#[pyo3(signature = (study, threads=None, progress=None))]
pub(crate) fn _check(
    py: Python<'_>,
    study: &Bound<'_, Study>,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    let (study, path) = study.get().owned();
    let threads = threads_or_all(threads);
    run(py, threads, progress, move |watch| {
        json(&check(&study, &path, &RunOptions { data: None, threads, progress: watch })?)
    })
}

/// Tests a model on the logs of a study: JSON.
#[pyfunction]
#[pyo3(signature = (model, study, threads=None, progress=None))]
pub(crate) fn _validate(
    py: Python<'_>,
    model: &Bound<'_, FittedModel>,
    study: &Bound<'_, Study>,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    let (study, path) = study.get().owned();
    let threads = threads_or_all(threads);
    let result = model.get().result().clone();
    run(py, threads, progress, move |watch| {
        let options = RunOptions { data: None, threads, progress: watch };
        json(&validate_result(&result, Path::new("<model>"), (&study, &path), &options)?)
    })
}

/// Designs the motion that a study asks for: JSON, the trajectory as CSV and its picture as SVG, and at `rate_hz` the
/// times with position, velocity and acceleration, joint by joint.
#[pyfunction]
#[pyo3(signature = (study, rate_hz=None, threads=None))]
#[allow(clippy::type_complexity, reason = "the parts of a design")]
pub(crate) fn _design<'py>(
    py: Python<'py>,
    study: &Bound<'py, Study>,
    rate_hz: Option<f64>,
    threads: Option<usize>,
) -> PyResult<(String, String, String, Array<'py>, [Array<'py>; 3])> {
    let (study, path) = study.get().owned();
    let threads = threads_or_all(threads);
    let (file, csv, svg, times_s, motion) = run(py, threads, None, move |watch| {
        let hear =
            |_: &DesignProgress| if watch.is_cancelled() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        let outcome = design_study(&study, &path, &RunOptions { data: None, threads, progress: watch }, hear)?;
        let (times_s, motion) = outcome.sampled(rate_hz.unwrap_or(outcome.file.rate_hz));
        let cannot = |error: ExportError| Error::Result { path: path.clone(), message: error.to_string() };
        let sampled = Sampled { joints: &outcome.file.joints, times_s: &times_s, motion: &motion };
        let csv = trajectory_csv(&sampled).map_err(cannot)?;
        Ok((json(&outcome.file)?, csv, outcome.preview_svg()?, times_s, motion))
    })?;
    let (samples, joints) = (motion.samples, motion.joints);
    let rows = |values: &[f64]| {
        crate::arrays::array(py, &[samples], &[joints], crate::arrays::sample_major(values, samples, joints))
    };
    let parts = [rows(&motion.q)?, rows(&motion.dq)?, rows(&motion.ddq)?];
    Ok((file, csv, svg, crate::arrays::array(py, &[samples], &[], times_s)?, parts))
}

/// Runs a study's trajectory on its simulated robot: the truth as JSON, the log as CSV.
#[pyfunction]
#[pyo3(signature = (study, threads=None))]
pub(crate) fn _simulate(
    py: Python<'_>,
    study: &Bound<'_, Study>,
    threads: Option<usize>,
) -> PyResult<(String, String)> {
    let (study, path) = study.get().owned();
    let threads = threads_or_all(threads);
    run(py, threads, None, move |watch| {
        let hear =
            |_: &DesignProgress| if watch.is_cancelled() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        let done = simulate_study(&study, &path, &RunOptions { data: None, threads, progress: watch }, &hear)?;
        Ok((json(&done.file)?, done.log))
    })
}

/// What a recording holds: JSON.
#[pyfunction]
pub(crate) fn _log_contents(py: Python<'_>, path: PathBuf) -> PyResult<String> {
    let contents = py.detach(|| log_contents(&path).and_then(|contents| json(&contents)));
    contents.map_err(|error| errors::job(py, &error))
}

/// Runs the command line, the name of the program first, and returns its exit status.
#[pyfunction]
pub(crate) fn _command(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| dynident_cli::run(arguments))
}
