//! The jobs of the command as functions: studies as input, JSON and models as output.

use crate::arrays::{array, sample_major};
use crate::description::described;
use crate::errors;
use crate::function_robot::{Raised, robot_of};
use crate::jobs::{Watch, run, run_to_its_stop, threads as threads_or_all};
use crate::model::{FittedModel, RESULT};
use crate::robot::Robot;
use crate::study::{Samples as StudySamples, Study, memory_log};
use core::ops::ControlFlow;
use dynident::excitation::DesignProgress;
use dynident::excitation::export::{ExportError, Sampled, trajectory_csv};
use dynident::identification::examination::{JointTrace, LogTrace};
use dynident::iteration::{RobotRun, RunRecord, StopSignal};
use dynident::recording::{LogReader, RawBlock, RecordingError};
use dynident::result::{ServoFile, StudyChange};
use dynident::study::{LogSection, StudyLogSource};
use dynident::{
    CorrectedDescription, Error, InspectSettings, IterationWatch, NewStudy, OutputSet, ProgramPermission, RunOptions,
    ServoTarget, XacroSettings, check, design_study, export_servos, identify, identify_servos, inspect_robot,
    iterate_study, iterate_with_robot, log_contents, mended_robot, new_study, simulate_study, validate_result,
    validation_traces,
};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;

type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

fn json(value: &impl serde::Serialize) -> Result<String, Error> {
    dynident::text::json::to_string(value)
        .map_err(|error| Error::Result { path: PathBuf::from("<result>"), message: error.to_string() })
}

/// Runs the job of a study in a separate thread.
pub(crate) fn of_study<T: Send + 'static>(
    study: &Bound<'_, Study>,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
    job: impl FnOnce(dynident::Study, PathBuf, &RunOptions<'_>, &Watch) -> Result<T, Error> + Send + 'static,
) -> PyResult<T> {
    let (own, path) = study.get().owned();
    let threads = threads_or_all(threads);
    run(study.py(), threads, progress, move |watch| {
        job(own, path, &RunOptions { data: None, threads, progress: watch }, watch)
    })
}

fn unless(is_over: bool) -> ControlFlow<()> {
    if is_over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}

/// Fits a study's model to its logs and validates it on the held-out logs.
#[pyfunction]
#[pyo3(signature = (study, threads=None, progress=None))]
pub(crate) fn _identify(
    study: &Bound<'_, Study>,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<FittedModel> {
    let callables = study.get().callables.clone();
    of_study(study, threads, progress, |study, path, options, _| {
        let outcome = identify(&study, &path, options)?;
        Ok(FittedModel::found(study, path, callables, outcome))
    })
}

/// Drives and bodies from commands: JSON, the report, and the robot description with the new values as MJCF or URDF.
type FoundServos = (String, String, Option<String>, Option<String>);

/// Fits a study's drives and bodies to commands and positions, and simulates the held-out logs.
#[pyfunction]
#[pyo3(signature = (study, threads=None, progress=None))]
pub(crate) fn _identify_servos(
    study: &Bound<'_, Study>,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<FoundServos> {
    of_study(study, threads, progress, |study, path, options, _| {
        let outcome = identify_servos(&study, &path, options)?;
        Ok((json(&outcome.result)?, outcome.report()?, outcome.mjcf, outcome.urdf))
    })
}

/// Actuators of Isaac Lab for a result of commands and positions: the text of a Python module.
#[pyfunction]
pub(crate) fn _isaac_lab(py: Python<'_>, result: &str) -> PyResult<String> {
    let path = Path::new(RESULT);
    let wrong = |message: String| Error::Result { path: path.to_owned(), message };
    let exported = || {
        let file = ServoFile::parse(result.as_bytes(), path).map_err(|error| wrong(error.to_string()))?;
        let file = file.ok_or_else(|| wrong("not a result of commands and positions".to_owned()))?;
        export_servos(&file, path, ServoTarget::IsaacLab, None, None)
    };
    exported().map(|made| made.exported.text).map_err(|error| errors::job(py, &error))
}

#[pyfunction]
#[pyo3(signature = (study, threads=None, progress=None))]
pub(crate) fn _check(
    study: &Bound<'_, Study>,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    of_study(study, threads, progress, |study, path, options, _| json(&check(&study, &path, options)?))
}

#[pyfunction]
#[pyo3(signature = (model, study, threads=None, progress=None))]
pub(crate) fn _validate(
    model: &Bound<'_, FittedModel>,
    study: &Bound<'_, Study>,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    let result = model.get().result().clone();
    of_study(study, threads, progress, move |study, path, options, _| {
        json(&validate_result(&result, Path::new(RESULT), &study, &path, options)?)
    })
}

/// Torque of a log over time: its name, the times in s, whether later rows are left out, measured and predicted torque.
type TracedLog<'py> = (String, Array<'py>, bool, Array<'py>, Array<'py>);

/// Measured and predicted torque over time of the logs that `_validate` uses, filtered as for its errors.
#[pyfunction]
#[pyo3(signature = (model, study, threads=None, progress=None))]
pub(crate) fn _residuals<'py>(
    model: &Bound<'py, FittedModel>,
    study: &Bound<'py, Study>,
    threads: Option<usize>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Vec<TracedLog<'py>>> {
    let result = model.get().result().clone();
    let traces = of_study(study, threads, progress, move |study, path, options, _| {
        validation_traces(&result, Path::new(RESULT), &study, &path, options)
    })?;
    let rows = |log: &LogTrace, of: fn(&JointTrace) -> &[f64]| {
        let samples = log.joints.iter().map(|joint| of(joint).len()).min().unwrap_or(0);
        let numbers: Vec<f64> =
            (0..samples).flat_map(|row| log.joints.iter().map(move |joint| of(joint)[row])).collect();
        array(study.py(), &[samples], &[log.joints.len()], numbers)
    };
    let one = |log: LogTrace| {
        let times = array(study.py(), &[log.time_s.len()], &[], log.time_s.clone())?;
        let measured = rows(&log, |joint| &joint.measured_nm)?;
        let predicted = rows(&log, |joint| &joint.predicted_nm)?;
        Ok((log.log, times, log.cut, measured, predicted))
    };
    traces.into_iter().map(one).collect()
}

/// A designed motion: JSON, the trajectory as CSV, its figure as SVG, the times, and position, velocity and
/// acceleration.
type Designed<'py> = (String, String, String, Array<'py>, [Array<'py>; 3]);

#[pyfunction]
#[pyo3(signature = (study, rate_hz=None, threads=None, progress=None))]
pub(crate) fn _design<'py>(
    study: &Bound<'py, Study>,
    rate_hz: Option<f64>,
    threads: Option<usize>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Designed<'py>> {
    let (file, csv, svg, times_s, motion) = of_study(study, threads, progress, move |study, path, options, watch| {
        let outcome = design_study(&study, &path, options, |now| {
            watch.show(&format!("design: {}", now.round), now.evaluations);
            unless(watch.is_cancelled())
        })?;
        let (times_s, motion) = outcome.sampled(rate_hz.unwrap_or(outcome.file.rate_hz));
        let cannot = |error: ExportError| Error::Result { path: path.clone(), message: error.to_string() };
        let sampled = Sampled { joints: &outcome.file.joints, times_s: &times_s, motion: &motion };
        let csv = trajectory_csv(&sampled).map_err(cannot)?;
        Ok((json(&outcome.file)?, csv, outcome.preview_svg()?, times_s, motion))
    })?;
    let (py, samples, joints) = (study.py(), motion.samples, motion.joints);
    let rows = |values: &[f64]| array(py, &[samples], &[joints], sample_major(values, samples, joints));
    let parts = [rows(&motion.q)?, rows(&motion.dq)?, rows(&motion.ddq)?];
    Ok((file, csv, svg, array(py, &[samples], &[], times_s)?, parts))
}

/// Simulates a study's trajectory: the truth as JSON, the log as CSV.
#[pyfunction]
#[pyo3(signature = (study, threads=None))]
pub(crate) fn _simulate(study: &Bound<'_, Study>, threads: Option<usize>) -> PyResult<(String, String)> {
    of_study(study, threads, None, |study, path, options, watch| {
        let done = simulate_study(&study, &path, options, &|_| unless(watch.is_cancelled()))?;
        Ok((json(&done.file)?, done.log))
    })
}

/// Iterates with a study's robot, or with a function instead of it, into the folder `out`: JSON. `heard` is called
/// after every run with its number and its largest tracking error, rad (m).
#[pyfunction]
#[pyo3(signature = (study, out, robot=None, resume=false, allow_command=false, threads=None, heard=None, progress=None))]
#[allow(clippy::too_many_arguments, reason = "keyword arguments of Python")]
pub(crate) fn _iterate(
    py: Python<'_>,
    study: &Bound<'_, Study>,
    out: PathBuf,
    robot: Option<Py<PyAny>>,
    resume: bool,
    allow_command: bool,
    threads: Option<usize>,
    heard: Option<Py<PyAny>>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    let (study, path) = study.get().owned();
    let threads = threads_or_all(threads);
    let (stop, raised) = (StopSignal::default(), Raised::default());
    let (asked, kept) = (stop.clone(), raised.clone());
    let found = run_to_its_stop(py, threads, progress, &stop, move |watch| {
        let options = RunOptions { data: None, threads, progress: watch };
        let design = |now: &DesignProgress| {
            watch.show(&format!("design: {}", now.round), now.evaluations);
            unless(asked.is_requested())
        };
        let mut made = |record: &RunRecord, _: &[RobotRun]| {
            watch.show(&format!("after run {}", record.run), record.run as u64);
            if let Some(heard) = &heard {
                kept.keep(Python::attach(|py| {
                    heard
                        .call1(py, (record.run, record.max_tracking_error_rad.iter().copied().fold(0.0, f64::max)))
                        .map(|_| ())
                }));
            }
        };
        let programs = ProgramPermission::from_flag(allow_command);
        let mut watch = IterationWatch { stop: asked.clone(), programs, ..IterationWatch::new(&design, &mut made) };
        let file = match robot {
            None => iterate_study(&study, &path, &out, resume, &options, &mut watch),
            Some(function) => {
                let function = Arc::new(function);
                let mut make = |joints: &[String]| robot_of(&function, joints, &kept);
                iterate_with_robot(&study, &path, &out, resume, &options, &mut watch, &mut make)
            }
        };
        json(&file?)
    });
    match raised.taken() {
        // An exception of the robot's code explains more than the status of the iteration.
        Some(error) => Err(error),
        None => found,
    }
}

/// Audits a robot description: JSON, and the text with corrected mistakes, if their correct numbers are known.
#[pyfunction]
#[pyo3(signature = (robot, total_mass_kg=None))]
pub(crate) fn _inspect(
    py: Python<'_>,
    robot: &Bound<'_, Robot>,
    total_mass_kg: Option<f64>,
) -> PyResult<(String, Option<String>)> {
    let (description, settings) = (robot.get().description(), InspectSettings { total_mass_kg });
    let found = py.detach(|| {
        let text = match mended_robot(description, &settings)? {
            CorrectedDescription::Urdf(text) => Some(text),
            CorrectedDescription::NothingToMend | CorrectedDescription::NoUrdf => None,
        };
        Ok((json(&inspect_robot(description, &settings)?)?, text))
    });
    found.map_err(|error: Error| errors::job(py, &error))
}

/// Creates the text of a study from a robot file and recordings, with paths relative to `out`: JSON. `stated` are lines
/// stated by a person: JSON.
#[pyfunction]
#[pyo3(signature = (robot, logs, out, rate_hz=None, stated=None, xacro=None, allow_command=false, threads=None, progress=None))]
#[allow(clippy::too_many_arguments, reason = "keyword arguments of Python")]
pub(crate) fn _new(
    py: Python<'_>,
    robot: PathBuf,
    logs: Vec<PathBuf>,
    out: PathBuf,
    rate_hz: Option<f64>,
    stated: Option<&str>,
    xacro: Option<BTreeMap<String, String>>,
    allow_command: bool,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    let stated: Option<Vec<StudyChange>> = stated.map(serde_json::from_str).transpose().map_err(|error| {
        errors::StudyError::new_err(format!("stated: {error}; use the format of `proposed` in `unsure`"))
    })?;
    let xacro = XacroSettings { arguments: xacro.unwrap_or_default(), ..XacroSettings::default() };
    let description = Some(Box::new(described(py, &robot, xacro.clone(), allow_command)?));
    let request = NewStudy { robot, description, xacro, logs, out, rate_hz, stated: stated.unwrap_or_default() };
    let threads = threads_or_all(threads);
    run(py, threads, progress, move |watch| {
        json(&new_study(&request, &RunOptions { data: None, threads, progress: watch })?)
    })
}

/// Times, positions, torques, velocities and commands of a log in SI: `section` is its `[[log]]` as JSON, `joints` are
/// the names of the robot's joints. Quantities that the log does not have are None; without time stamps the times are
/// those of the stated rate.
#[pyfunction]
#[pyo3(signature = (section, samples, joints=None))]
pub(crate) fn _log_arrays<'py>(
    py: Python<'py>,
    section: &str,
    samples: Option<(String, StudySamples<'_>)>,
    joints: Option<Vec<String>>,
) -> PyResult<(Array<'py>, [Option<Array<'py>>; 4])> {
    let wrong = |error: &dyn core::fmt::Display| errors::LogError::new_err(error.to_string());
    let section: LogSection = serde_json::from_str(section).map_err(|error| wrong(&error))?;
    let Some(format) = section.format_or(None) else { return Err(wrong(&"the log has no format")) };
    let joints = if let Some(joints) = joints {
        joints
    } else {
        let columns = format.position.column_list("position").map_err(|error| wrong(&error))?;
        (1..=format.position.matrix.as_ref().map_or(columns.len(), Vec::len)).map(|k| format!("joint {k}")).collect()
    };
    let source = match samples {
        Some((label, table)) => StudyLogSource::Memory(memory_log(py, &label, table)?),
        None => StudyLogSource::File(section.file),
    };
    let log = source.log(format, &joints);
    let read = || -> Result<_, RecordingError> {
        let (mut times_s, mut all): (Vec<f64>, [Vec<Vec<f64>>; 4]) = Default::default();
        let mut reader = LogReader::open(&log)?;
        let mut block = RawBlock::default();
        while reader.next_block(&mut block)? {
            times_s.extend_from_slice(&block.time_s);
            for (all, own) in all.iter_mut().zip([&block.q, &block.tau, &block.dq, &block.command]) {
                all.resize(own.len(), Vec::new());
                all.iter_mut().zip(own).for_each(|(all, own)| all.extend_from_slice(own));
            }
        }
        Ok((times_s, all))
    };
    let (times_s, all) = py.detach(read).map_err(|error| errors::log(py, &error))?;
    let rows = |columns: Vec<Vec<f64>>| {
        let (samples, joints) = (times_s.len(), columns.len());
        (joints > 0)
            .then(|| array(py, &[samples], &[joints], sample_major(&columns.concat(), samples, joints)))
            .transpose()
    };
    let [q, tau, dq, command] = all;
    let found = [rows(q)?, rows(tau)?, rows(dq)?, rows(command)?];
    Ok((array(py, &[times_s.len()], &[], times_s)?, found))
}

/// Content of a recording: JSON.
#[pyfunction]
pub(crate) fn _log_contents(py: Python<'_>, path: PathBuf) -> PyResult<String> {
    let contents = py.detach(|| log_contents(&path).and_then(|contents| json(&contents)));
    contents.map_err(|error| errors::job(py, &error))
}

/// Writes texts into a folder, all or none; files with None are removed.
#[pyfunction]
pub(crate) fn _write_files(py: Python<'_>, folder: PathBuf, texts: BTreeMap<String, Option<String>>) -> PyResult<()> {
    let set = texts.into_iter().fold(OutputSet::new(&folder), |set, (name, text)| match text {
        Some(text) => set.file(&name, text),
        None => set.absent(&name),
    });
    set.write().map_err(|error| errors::job(py, &error))
}

/// Runs the command line, beginning with the program name, and returns its exit status.
#[pyfunction]
pub(crate) fn _command(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| dynident_cli::run(arguments))
}
