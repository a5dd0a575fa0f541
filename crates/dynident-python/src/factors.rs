//! `Factors`: logs reduced to factors, and statistics of a fleet of robots.

use crate::callables::Callables;
use crate::errors;
use crate::functions::of_study;
use crate::jobs::{run, threads as threads_or_all};
use crate::model::{FittedModel, RESULT};
use crate::study::Study;
use dynident::estimation::fleet::{self, Member};
use dynident::{FactorLog, ReduceSettings, RunOptions, factors_errors, identify_factors, reduce};
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyTuple};
use std::path::Path;

/// Logs as factors: small files that contain all information for a fit, and can be merged in any order.
///
/// Created by ``dynident.fleet.reduce``, combined by ``merged``, identified by ``dynident.fleet.identify``. The bytes
/// are those of the file: versioned, with a hash at the end.
///
/// >>> import dynident
/// >>> dynident.Factors.from_bytes(b"damaged")
/// Traceback (most recent call last):
/// dynident.ResultError: ...
#[pyclass(frozen, module = "dynident")]
pub(crate) struct Factors(dynident::Factors);

/// Name, robot, time, hash, and number of rows of a log.
type Entry = (String, Option<String>, Option<f64>, String, u64);

#[pymethods]
impl Factors {
    /// Reads the output of ``to_bytes``; raises ``ResultError`` for other content.
    #[staticmethod]
    fn from_bytes(py: Python<'_>, bytes: Vec<u8>) -> PyResult<Self> {
        py.detach(|| dynident::Factors::from_bytes(&bytes)).map(Self).map_err(errors::factors)
    }

    /// The bytes of a factor file.
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = py.detach(|| self.0.to_bytes()).map_err(errors::factors)?;
        Ok(PyBytes::new(py, &bytes))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let bytes = slf.get().to_bytes(slf.py())?;
        Ok((slf.get_type().getattr("from_bytes")?, (bytes,).into_pyobject(slf.py())?))
    }

    /// Merges logs, in an order that does not depend on the order of the parts; duplicate logs are removed.
    #[staticmethod]
    fn merged(py: Python<'_>, parts: Vec<Bound<'_, Self>>) -> PyResult<Self> {
        let parts: Vec<dynident::Factors> = parts.iter().map(|part| part.get().0.clone()).collect();
        py.detach(|| dynident::Factors::merged(parts)).map(Self).map_err(errors::factors)
    }

    /// Selects logs by their indices in ``_logs``.
    fn _at(&self, places: Vec<usize>) -> PyResult<Self> {
        let chosen = places.iter().map(|&place| self.0.logs().get(place).map(|log| log.sha256.clone()));
        let chosen: Option<Vec<String>> = chosen.collect();
        let chosen = chosen.ok_or_else(|| pyo3::exceptions::PyIndexError::new_err("no such log"))?;
        Ok(Self(self.0.only(|log: &FactorLog| chosen.contains(&log.sha256))))
    }

    /// Name, robot, seconds since 1970, hash and rows of every log, in order.
    #[getter]
    fn _logs(&self) -> Vec<Entry> {
        let entry = |log: &FactorLog| {
            let rows = log.log.statistics.filtered_rows;
            (log.log.name.clone(), log.arm.clone(), log.recorded_at_s, log.sha256.clone(), rows)
        };
        self.0.logs().iter().map(entry).collect()
    }

    /// Robot, drives, filters and estimator; a study without logs.
    #[getter]
    fn study(&self) -> Study {
        let (study, path) = (self.0.study().clone(), self.0.study_path().to_owned());
        Study { study, path, callables: Callables::default() }
    }

    fn __len__(&self) -> usize {
        self.0.logs().len()
    }
}

#[pyfunction]
#[pyo3(signature = (study, like=None, arm=None, recorded_at_s=None, segments=16, threads=None, progress=None))]
pub(crate) fn _reduce(
    study: &Bound<'_, Study>,
    like: Option<&Bound<'_, FittedModel>>,
    arm: Option<String>,
    recorded_at_s: Option<f64>,
    segments: usize,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Factors> {
    let like = like.map(|model| model.get().result().clone());
    let settings = ReduceSettings { arm, recorded_at_s, segments };
    of_study(study, threads, progress, move |study, path, options, _| {
        reduce(&study, &path, like.as_ref(), &settings, options).map(Factors)
    })
}

#[pyfunction]
#[pyo3(signature = (factors, threads=None, progress=None))]
pub(crate) fn _identify_factors(
    factors: &Bound<'_, Factors>,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<FittedModel> {
    let (own, threads) = (factors.get().0.clone(), threads_or_all(threads));
    run(factors.py(), threads, progress, move |watch| {
        let outcome = identify_factors(&own, &RunOptions { data: None, threads, progress: watch })?;
        Ok(FittedModel::found(own.study().clone(), own.study_path().to_owned(), Callables::default(), outcome))
    })
}

/// Unexplained torque of a model for every log, percent.
#[pyfunction]
pub(crate) fn _factors_errors(
    factors: &Bound<'_, Factors>,
    model: &Bound<'_, FittedModel>,
) -> PyResult<Vec<Option<f64>>> {
    let (own, result) = (factors.get().0.clone(), model.get().result().clone());
    run(factors.py(), 1, None, move |_| factors_errors(&own, &result, Path::new(RESULT)))
}

/// Estimates with their standard deviations, shapes ``(members, parameters)``.
fn members(
    names: Vec<String>,
    values: &PyReadonlyArray2<'_, f64>,
    std: &PyReadonlyArray2<'_, f64>,
) -> PyResult<Vec<Member>> {
    let (values, std) = (values.as_array(), std.as_array());
    if values.shape() != std.shape() || values.nrows() != names.len() {
        let message = "values and std must have the shape (estimates, parameters), with one name for each estimate";
        return Err(pyo3::exceptions::PyValueError::new_err(message));
    }
    let rows = values.outer_iter().zip(std.outer_iter());
    let member = |(name, (values, std)): (String, (_, _))| {
        let (values, std): (numpy::ndarray::ArrayView1<'_, f64>, numpy::ndarray::ArrayView1<'_, f64>) = (values, std);
        Member { name, values: values.to_vec(), std: std.to_vec() }
    };
    Ok(names.into_iter().zip(rows).map(member).collect())
}

fn json(value: &impl serde::Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(|error| errors::Error::new_err(error.to_string()))
}

/// Variation between the estimates of several robots: JSON.
#[pyfunction]
pub(crate) fn _spread(
    names: Vec<String>,
    values: PyReadonlyArray2<'_, f64>,
    std: PyReadonlyArray2<'_, f64>,
    false_alarm: f64,
) -> PyResult<String> {
    let found = fleet::spread(&members(names, &values, &std)?, false_alarm);
    json(&found.map_err(|error| errors::Error::new_err(error.to_string()))?)
}

/// Changes of the estimates of one robot over time: JSON.
#[pyfunction]
pub(crate) fn _drift(
    names: Vec<String>,
    values: PyReadonlyArray2<'_, f64>,
    std: PyReadonlyArray2<'_, f64>,
    times: Vec<f64>,
    false_alarm: f64,
) -> PyResult<String> {
    let found = fleet::drift(&members(names, &values, &std)?, &times, false_alarm);
    json(&found.map_err(|error| errors::Error::new_err(error.to_string()))?)
}
