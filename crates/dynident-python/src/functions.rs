//! The jobs of the command as functions: a study in, JSON and models out.

use crate::errors;
use crate::function_robot::{Raised, robot_of};
use crate::jobs::{run, run_to_its_stop, threads as threads_or_all};
use crate::model::{Descriptions, FittedModel};
use crate::study::Study;
use core::ops::ControlFlow;
use dynident::excitation::DesignProgress;
use dynident::excitation::export::{ExportError, Sampled, trajectory_csv};
use dynident::iteration::{RobotRun, RunRecord, StopSignal};
use dynident::{
    Error, IdentificationOutcome, IterationWatch, OutputSet, RunOptions, check, design_study, identify, iterate_study,
    iterate_with_robot, log_contents, simulate_study, validate_result,
};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;

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

/// Iterates a study's robot, or a function in its place, into the folder `out`: JSON. `heard` is called after every run
/// with its number and its largest tracking error, rad (m).
#[pyfunction]
#[pyo3(signature = (study, out, robot=None, resume=false, threads=None, heard=None))]
pub(crate) fn _iterate(
    py: Python<'_>,
    study: &Bound<'_, Study>,
    out: PathBuf,
    robot: Option<Py<PyAny>>,
    resume: bool,
    threads: Option<usize>,
    heard: Option<Py<PyAny>>,
) -> PyResult<String> {
    let (study, path) = study.get().owned();
    let threads = threads_or_all(threads);
    let (stop, raised) = (StopSignal::default(), Raised::default());
    let (asked, kept) = (stop.clone(), raised.clone());
    let found = run_to_its_stop(py, threads, &stop, move |watch| {
        let options = RunOptions { data: None, threads, progress: watch };
        let design =
            |_: &DesignProgress| if asked.is_requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        let mut made = |record: &RunRecord, _: &[RobotRun]| {
            if let Some(heard) = &heard {
                kept.keep(Python::attach(|py| {
                    heard
                        .call1(py, (record.run, record.max_tracking_error_rad.iter().copied().fold(0.0, f64::max)))
                        .map(|_| ())
                }));
            }
        };
        let mut watch = IterationWatch { design: &design, run: &mut made, stop: asked.clone(), allow: None };
        let file = match robot {
            None => iterate_study(&study, &path, &out, resume, &options, &mut watch),
            Some(function) => {
                let function = Arc::new(function);
                let mut make = |joints: &[String]| robot_of(&function, joints, &kept);
                iterate_with_robot(&study, &path, (&out, resume), &options, &mut watch, &mut make)
            }
        };
        json(&file?)
    });
    match raised.taken() {
        // What the robot's own code raised says more than what became of the iteration.
        Some(error) => Err(error),
        None => found,
    }
}

/// What a recording holds: JSON.
#[pyfunction]
pub(crate) fn _log_contents(py: Python<'_>, path: PathBuf) -> PyResult<String> {
    let contents = py.detach(|| log_contents(&path).and_then(|contents| json(&contents)));
    contents.map_err(|error| errors::job(py, &error))
}

/// Writes texts into a folder, all or none; files of None are taken away.
#[pyfunction]
pub(crate) fn _write_files(py: Python<'_>, folder: PathBuf, texts: BTreeMap<String, Option<String>>) -> PyResult<()> {
    let set = texts.into_iter().fold(OutputSet::new(&folder), |set, (name, text)| match text {
        Some(text) => set.file(&name, text),
        None => set.absent(&name),
    });
    set.write().map_err(|error| errors::job(py, &error))
}

/// Runs the command line, the name of the program first, and returns its exit status.
#[pyfunction]
pub(crate) fn _command(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| dynident_cli::run(arguments))
}
