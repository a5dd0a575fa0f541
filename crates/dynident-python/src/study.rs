//! `Study`: robot, drives, logs and settings of a job, from a file or from memory.

use crate::arrays::array;
use crate::assembled::assembled;
use crate::callables::Callables;
use crate::errors;
use crate::jobs::interruptible;
use crate::robot::Robot;
use dynident::ProgramPermission;
use dynident::model::read_robot;
use dynident::recording::{LogSource, MemoryLog};
use numpy::{PyArrayDyn, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use std::path::{Path, PathBuf};

/// Samples of one log: names of the columns, and the columns.
pub(crate) type Samples<'py> = (Vec<String>, Vec<PyReadonlyArray1<'py, f64>>);

type Columns<'py> = (Vec<String>, Vec<Bound<'py, PyArrayDyn<f64>>>);

/// A study: robot, drives, logs and settings, as ``[robot]``, ``[drive]``, ``[[log]]`` and so on of a study file.
///
/// Read with ``Study.load(path)`` or ``Study.parse(text)``, or created from objects with ``dynident.study(...)``.
///
/// >>> import dynident
/// >>> dynident.Study.load("examples/ur10_simulated.toml").log_names
/// ['train', 'test']
#[pyclass(frozen, module = "dynident")]
#[allow(clippy::struct_field_names, reason = "the wrapped study")]
pub(crate) struct Study {
    pub(crate) study: dynident::Study,
    pub(crate) path: PathBuf,
    pub(crate) callables: Callables,
}

impl Study {
    /// A study as read. Its robot file is expanded if it has macros and that is permitted; otherwise the job that needs
    /// the robot reports it.
    fn read(py: Python<'_>, mut study: dynident::Study, path: PathBuf, allow_command: bool) -> PyResult<Self> {
        if allow_command {
            interruptible(py, |is_stopped| {
                study.expand_robot(&path, None, ProgramPermission::Allow, Some(is_stopped))
            })?;
        }
        Ok(Self { study, path, callables: Callables::default() })
    }

    /// Copies of the study and its path, for jobs on another thread.
    pub(crate) fn owned(&self) -> (dynident::Study, PathBuf) {
        (self.study.clone(), self.path.clone())
    }
}

#[pymethods]
impl Study {
    /// Reads a study file. With ``allow_command=True`` the program ``xacro`` expands a robot file with macros; xacro
    /// runs Python code of the file.
    #[staticmethod]
    #[pyo3(signature = (path, *, allow_command=false))]
    fn load(py: Python<'_>, path: PathBuf, allow_command: bool) -> PyResult<Self> {
        let study = dynident::Study::load(&path).map_err(|error| errors::job(py, &error.into()))?;
        Self::read(py, study, path, allow_command)
    }

    /// Reads the text of a study. Its files are relative to the folder of ``path``, which need not exist.
    /// ``allow_command`` as for ``load``.
    #[staticmethod]
    #[pyo3(signature = (text, path=PathBuf::from("<study>"), *, allow_command=false))]
    fn parse(py: Python<'_>, text: &str, path: PathBuf, allow_command: bool) -> PyResult<Self> {
        let study = dynident::Study::parse(text, &path).map_err(|error| errors::job(py, &error.into()))?;
        Self::read(py, study, path, allow_command)
    }

    /// Creates a study from sections in JSON, a robot, and samples in memory: one entry per log, None for a log in a
    /// file.
    #[staticmethod]
    #[pyo3(signature = (sections, path, robot, samples, functions=None))]
    fn _assemble(
        py: Python<'_>,
        sections: &str,
        path: PathBuf,
        robot: Option<&Bound<'_, Robot>>,
        samples: Vec<Option<(String, Samples<'_>)>>,
        functions: Option<Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let description = robot.map(|robot| robot.get().description().clone());
        let callables = Callables::of(functions);
        let study = assembled(py, sections, &path, description, tables(py, samples)?, &callables)?;
        Ok(Self { study, path, callables })
    }

    /// The inverse of ``__reduce__``.
    #[staticmethod]
    #[pyo3(signature = (sections, path, description, samples, functions=None))]
    fn _restore(
        py: Python<'_>,
        sections: &str,
        path: PathBuf,
        description: Option<(String, PathBuf)>,
        samples: Vec<Option<(String, Samples<'_>)>>,
        functions: Option<Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let robot = description.map(|(text, path)| read_robot(text, &path)).transpose();
        let robot = robot.map_err(|error| errors::robot(py, &error))?;
        let callables = Callables::of(functions);
        Ok(Self { study: assembled(py, sections, &path, robot, tables(py, samples)?, &callables)?, path, callables })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (py, own) = (slf.py(), slf.get());
        let description = own.study.robot.description.as_ref().map(|robot| (robot.text.clone(), robot.path.clone()));
        let mut samples = Vec::new();
        for log in &own.study.log {
            samples.push(log.samples.as_ref().map(|table| columns(py, table)).transpose()?);
        }
        // Python pickles functions by their module and name.
        let state = (own.to_json()?, own.path.clone(), description, samples, own.callables.dictionary(py));
        Ok((slf.get_type().getattr("_restore")?, state.into_pyobject(py)?))
    }

    /// The file that it was read from; ``<study>`` for one in memory. Its files are relative to the folder of this
    /// path.
    #[getter]
    fn path(&self) -> &Path {
        &self.path
    }

    /// Name in reports; None for the file's name.
    #[getter]
    fn name(&self) -> Option<&str> {
        self.study.name.as_deref()
    }

    /// Names of the logs.
    #[getter]
    fn log_names(&self) -> Vec<String> {
        (0..self.study.log.len()).map(|index| self.study.log_name(index)).collect()
    }

    /// The same robot with other sections: JSON, and samples as for ``_assemble``.
    fn _with_sections(
        &self,
        py: Python<'_>,
        sections: &str,
        samples: Vec<Option<(String, Samples<'_>)>>,
    ) -> PyResult<Self> {
        let robot = self.study.robot.description.as_deref().cloned();
        let study = assembled(py, sections, &self.path, robot, tables(py, samples)?, &self.callables)?;
        Ok(Self { study, path: self.path.clone(), callables: self.callables.clone() })
    }

    /// Whether the logs contain commands, so that `identify_servos` applies.
    #[getter]
    fn _fits_commands(&self) -> bool {
        self.study.fits_commands()
    }

    /// All sections as JSON.
    fn to_json(&self) -> PyResult<String> {
        serde_json::to_string(&self.study).map_err(|error| errors::Error::new_err(error.to_string()))
    }

    /// The Python functions of the study, each with its section: ``estimator: ridge``.
    #[getter]
    fn functions(&self) -> Vec<String> {
        self.study.functions()
    }

    /// The study as TOML. Samples and robot descriptions in memory are only named in it; a study with functions raises
    /// ``StudyError``.
    fn to_toml(&self) -> PyResult<String> {
        if let [first, ..] = &self.study.functions()[..] {
            let message = format!(
                "{first} is a function of Python, which cannot be written to a file: pickle the study, or remove the function"
            );
            return Err(errors::StudyError::new_err(message));
        }
        self.study.to_toml().map_err(|error| errors::StudyError::new_err(error.to_string()))
    }

    fn __repr__(&self) -> String {
        format!("Study({:?}, {} logs)", self.path.display().to_string(), self.study.log.len())
    }
}

fn tables(py: Python<'_>, samples: Vec<Option<(String, Samples<'_>)>>) -> PyResult<Vec<Option<MemoryLog>>> {
    samples.into_iter().map(|table| table.map(|(label, table)| memory_log(py, &label, table)).transpose()).collect()
}

/// A table of columns. Each is copied once, because a job runs in parallel to the owner of the arrays.
pub(crate) fn memory_log(py: Python<'_>, label: &str, (names, columns): Samples<'_>) -> PyResult<MemoryLog> {
    let columns = columns
        .iter()
        .map(|column| match column.as_slice() {
            Ok(numbers) => numbers.to_vec(),
            Err(_) => column.as_array().iter().copied().collect(),
        })
        .collect();
    MemoryLog::columns(label, Some(names), columns).map_err(|error| errors::log(py, &error))
}

fn columns<'py>(py: Python<'py>, table: &MemoryLog) -> PyResult<(String, Columns<'py>)> {
    let names = table.names().map(<[String]>::to_vec).unwrap_or_default();
    let (width, numbers): (usize, Vec<f64>) = (names.len().max(1), table.numbers().collect());
    let of = |column: usize| {
        let own: Vec<f64> = numbers.iter().skip(column).step_by(width).copied().collect();
        array(py, &[own.len()], &[], own)
    };
    Ok((table.label(), (names.clone(), (0..names.len()).map(of).collect::<PyResult<Vec<_>>>()?)))
}
