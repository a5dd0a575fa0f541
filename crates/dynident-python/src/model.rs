//! `FittedModel`: what an identification found, with its study.

use crate::arrays::{Motion, array, joint_major, sample_major};
use crate::assembled::assembled;
use crate::errors;
use crate::study::Study;
use dynident::export::Target;
use dynident::model::read_robot;
use dynident::model::terms::JointMotion;
use dynident::{ResultFile, TorquePredictor, export_result};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use std::path::{Path, PathBuf};

/// What messages call a result in memory.
const RESULT: &str = "<model>";

type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

/// The description with the new values, in the forms that the result has.
#[derive(Clone, Default)]
pub(crate) struct Descriptions {
    pub(crate) urdf: Option<String>,
    pub(crate) table: Option<String>,
    pub(crate) mjcf: Option<String>,
    pub(crate) sdf: Option<String>,
}

/// A result with its study: what ``dynident.Model`` stands on.
#[pyclass(frozen, module = "dynident._native")]
pub(crate) struct FittedModel {
    study: dynident::Study,
    path: PathBuf,
    result: ResultFile,
    /// The result as it is written.
    json: String,
    descriptions: Descriptions,
    report: String,
    predictor: TorquePredictor,
}

impl FittedModel {
    pub(crate) fn new(
        study: dynident::Study,
        path: PathBuf,
        json: String,
        descriptions: Descriptions,
        report: String,
    ) -> Result<Self, dynident::Error> {
        let name = Path::new(RESULT);
        let result = ResultFile::parse(json.as_bytes(), name)?;
        let predictor = TorquePredictor::new(&result, name, (&study, &path), None)?;
        Ok(Self { study, path, result, json, descriptions, report, predictor })
    }

    pub(crate) fn result(&self) -> &ResultFile {
        &self.result
    }
}

#[pymethods]
impl FittedModel {
    /// A result of `identify` with the study that it was made with, the description with the new values (URDF, D-H
    /// table, MJCF, SDF) and the page.
    #[staticmethod]
    fn of(
        py: Python<'_>,
        json: String,
        study: &Bound<'_, Study>,
        descriptions: [Option<String>; 4],
        report: String,
    ) -> PyResult<Self> {
        let (study, path) = study.get().owned();
        let [urdf, table, mjcf, sdf] = descriptions;
        let descriptions = Descriptions { urdf, table, mjcf, sdf };
        Self::new(study, path, json, descriptions, report).map_err(|error| errors::job(py, &error))
    }

    /// The inverse of ``__reduce__``.
    #[staticmethod]
    fn _restore(
        py: Python<'_>,
        study: (String, PathBuf, Option<(String, PathBuf)>),
        json: String,
        descriptions: [Option<String>; 4],
        report: String,
    ) -> PyResult<Self> {
        let ((sections, path, description), [urdf, table, mjcf, sdf]) = (study, descriptions);
        let robot = description.map(|(text, path)| read_robot(text, &path)).transpose().map_err(errors::robot)?;
        let study = assembled(py, &sections, &path, robot, Vec::new())?;
        let descriptions = Descriptions { urdf, table, mjcf, sdf };
        Self::new(study, path, json, descriptions, report).map_err(|error| errors::job(py, &error))
    }

    /// Without the samples that it was fitted to.
    #[allow(clippy::type_complexity, reason = "what `_restore` takes")]
    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(
        Bound<'py, PyAny>,
        ((String, PathBuf, Option<(String, PathBuf)>), String, [Option<String>; 4], String),
    )> {
        let own = slf.get();
        let description = own.study.robot.description.as_ref().map(|robot| (robot.text.clone(), robot.path.clone()));
        let sections = serde_json::to_string(&own.study).map_err(|error| errors::Error::new_err(error.to_string()))?;
        let Descriptions { urdf, table, mjcf, sdf } = own.descriptions.clone();
        let state =
            ((sections, own.path.clone(), description), own.json.clone(), [urdf, table, mjcf, sdf], own.report.clone());
        Ok((slf.get_type().getattr("_restore")?, state))
    }

    /// `result.json`.
    #[getter]
    fn json(&self) -> &str {
        &self.json
    }

    /// The page with all figures, HTML.
    #[getter]
    fn report(&self) -> &str {
        &self.report
    }

    /// The study that it was made with.
    #[getter]
    fn study(&self) -> Study {
        Study { study: self.study.clone(), path: self.path.clone() }
    }

    /// The URDF with the new values, or None.
    #[getter]
    fn urdf(&self) -> Option<&str> {
        self.descriptions.urdf.as_deref()
    }

    /// The user's D-H table with the new values, or None.
    #[getter]
    fn table(&self) -> Option<&str> {
        self.descriptions.table.as_deref()
    }

    /// The user's MJCF with the new values, or None.
    #[getter]
    fn mjcf(&self) -> Option<&str> {
        self.descriptions.mjcf.as_deref()
    }

    /// The user's SDF with the new values, or None.
    #[getter]
    fn sdf(&self) -> Option<&str> {
        self.descriptions.sdf.as_deref()
    }

    /// Names of the joints.
    #[getter]
    fn joint_names(&self) -> Vec<String> {
        self.predictor.joint_names()
    }

    /// Torque along a motion and half the width of its 95 % band, both of shape ``(..., n)``.
    #[pyo3(signature = (q, dq=None, ddq=None))]
    fn predict<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        dq: Option<&Bound<'py, PyAny>>,
        ddq: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<(Array<'py>, Array<'py>)> {
        let dof = self.predictor.dof();
        let motion = Motion::of(dof, q, dq, ddq)?;
        let samples = motion.count();
        let found = motion.compute(py, 0, |numbers| {
            let [q, dq, ddq] = numbers.map(|rows| joint_major(rows, samples, dof));
            self.predictor.predict(&JointMotion { samples, q: &q, dq: &dq, ddq: &ddq })
        });
        let rows = |values: &[f64]| array(py, motion.lead(), &[dof], sample_major(values, samples, dof));
        Ok((rows(&found.tau)?, rows(&found.half_width_95)?))
    }

    /// The model in the form `target`: its text, and what has to be known of it.
    fn export(&self, py: Python<'_>, target: &str) -> PyResult<(String, Vec<String>)> {
        let wanted = Target::ALL.into_iter().find(|form| form.name() == target).ok_or_else(|| {
            let known: Vec<&str> = Target::ALL.iter().map(|form| form.name()).collect();
            errors::ResultError::new_err(format!("no form `{target}`: give one of {}", known.join(", ")))
        })?;
        let exported = export_result(&self.result, Path::new(RESULT), (&self.study, &self.path), (None, wanted))
            .map_err(|error| errors::job(py, &error))?;
        Ok((exported.text, exported.notes))
    }
}
