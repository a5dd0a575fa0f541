//! `FittedModel`: the result of an identification, with its study.

use crate::arrays::{Motion, array, joint_major, sample_major};
use crate::callables::{Callables, guarded};
use crate::errors;
use crate::jobs;
use crate::study::Study;
use crate::watch::OnlineWatch;
use crate::watch_settings::OnlineSettings;
use dynident::export::{ControllerBrand, Target};
use dynident::identification::examination::LogTrace;
use dynident::model::terms::JointMotion;
use dynident::{
    Error, Figure, IdentificationOutcome, IterationsFile, PrintStyle, ResultFile, RobotAppearance, RunOptions,
    TorquePredictor, export_payload, export_result, export_simulator, identification_report, validation_traces,
};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

pub(crate) const RESULT: &str = "<model>";

type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

/// The robot description with the new values: URDF, D-H table, MJCF, SDF, if available.
type Descriptions = [Option<String>; 4];

type Reduced<'py> = (Bound<'py, PyAny>, (String, Study, Descriptions, String));

/// A result with its study: the basis of ``dynident.Model``. The report and the predictor are created when first
/// needed.
#[pyclass(frozen, module = "dynident._native")]
pub(crate) struct FittedModel {
    study: dynident::Study,
    path: PathBuf,
    callables: Callables,
    result: ResultFile,
    descriptions: Descriptions,
    page: Page,
    predictor: OnceLock<TorquePredictor>,
}

/// Writes the files of a figure, and returns it as SVG.
fn drawn(figure: &Figure, out: &[PathBuf], style: &PrintStyle) -> Result<String, Error> {
    figure.write(out, style)?;
    Ok(figure.svg(style)?)
}

/// Writes the convergence figure of the file `iterations.json`, and returns it as SVG.
#[pyfunction]
pub(crate) fn _plot_convergence(
    py: Python<'_>,
    iterations: PathBuf,
    out: Vec<PathBuf>,
    width_mm: f64,
    font_pt: f64,
    dpi: f64,
) -> PyResult<String> {
    jobs::run(py, 1, None, move |_| {
        let figure = Figure::convergence(&IterationsFile::read(&iterations)?);
        drawn(&figure, &out, &PrintStyle { width_mm, font_pt, dpi })
    })
}

enum Page {
    /// To be generated from the torques over time, which the result does not contain.
    Of(Vec<LogTrace>, Box<RobotAppearance>),
    Written(String),
}

impl FittedModel {
    /// Creates the model from the outcome of an identification.
    pub(crate) fn found(
        study: dynident::Study,
        path: PathBuf,
        callables: Callables,
        outcome: IdentificationOutcome,
    ) -> Self {
        let IdentificationOutcome { result, urdf, table, mjcf, sdf, traces, robot, .. } = outcome;
        let descriptions = [urdf, table, mjcf, sdf];
        Self {
            study,
            path,
            callables,
            result,
            descriptions,
            page: Page::Of(traces, Box::new(robot)),
            predictor: OnceLock::new(),
        }
    }

    pub(crate) fn result(&self) -> &ResultFile {
        &self.result
    }

    /// Creates an online monitor of the robot.
    pub(crate) fn watched(
        &self,
        py: Python<'_>,
        model: &Bound<'_, Self>,
        settings: OnlineSettings,
    ) -> PyResult<OnlineWatch> {
        let watch = self.predictor(py)?.watch(&settings.of_watch());
        let watch = watch.map_err(|error| errors::Error::new_err(error.to_string()))?;
        Ok(OnlineWatch::new(watch, model.clone().into_any().unbind(), self.joint_names(), settings))
    }

    fn predictor(&self, py: Python<'_>) -> PyResult<&TorquePredictor> {
        if self.predictor.get().is_none() {
            // Python functions may be called, so the interpreter lock is released.
            let made = py.detach(|| {
                guarded(|| TorquePredictor::new(&self.result, Path::new(RESULT), &self.study, &self.path, None))
            })?;
            // Another thread may have stored the same already.
            let _ = self.predictor.set(made.map_err(|error| errors::job(py, &error))?);
        }
        self.predictor.get().ok_or_else(|| errors::Error::new_err("the model has no predictor"))
    }
}

#[pymethods]
impl FittedModel {
    /// Creates the model from a result of `identify` with its study, the robot description with the new values (URDF,
    /// D-H table, MJCF, SDF) and the report.
    #[staticmethod]
    fn of(
        py: Python<'_>,
        json: &str,
        study: &Bound<'_, Study>,
        descriptions: Descriptions,
        report: String,
    ) -> PyResult<Self> {
        let callables = study.get().callables.clone();
        let (study, path) = study.get().owned();
        let result = ResultFile::parse(json.as_bytes(), Path::new(RESULT));
        let result = result.map_err(|error| errors::job(py, &error.into()))?;
        let page = Page::Written(report);
        let made = Self { study, path, callables, result, descriptions, page, predictor: OnceLock::new() };
        // Checks that study and result belong together.
        made.predictor(py)?;
        Ok(made)
    }

    /// Pickles the model without the samples of its logs.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Reduced<'py>> {
        let (py, own) = (slf.py(), slf.get());
        let mut study = own.study();
        study.study.log.iter_mut().for_each(|log| log.samples = None);
        let state = (own.json()?, study, own.descriptions.clone(), own.report(py)?.into_owned());
        Ok((slf.get_type().getattr("of")?, state))
    }

    /// `result.json`.
    #[getter]
    fn json(&self) -> PyResult<String> {
        dynident::text::json::to_string(&self.result).map_err(|error| errors::Error::new_err(error.to_string()))
    }

    /// The report, HTML.
    #[getter]
    fn report(&self, py: Python<'_>) -> PyResult<Cow<'_, str>> {
        match &self.page {
            Page::Written(text) => Ok(Cow::Borrowed(text)),
            Page::Of(traces, robot) => {
                let made = identification_report(&self.result, traces, Some(robot));
                made.map(Cow::Owned).map_err(|error| errors::job(py, &error))
            }
        }
    }

    /// The study of the result.
    #[getter]
    fn study(&self) -> Study {
        let (study, path, callables) = (self.study.clone(), self.path.clone(), self.callables.clone());
        Study { study, path, callables }
    }

    /// The robot description with the new values, URDF, D-H table, MJCF and SDF; None if not available.
    #[getter]
    fn descriptions(&self) -> Descriptions {
        self.descriptions.clone()
    }

    /// Names of the joints.
    #[getter]
    fn joint_names(&self) -> Vec<String> {
        self.result.joints.iter().map(|joint| joint.name.clone()).collect()
    }

    /// Torque along a motion, shape ``(..., n)``.
    #[pyo3(signature = (q, dq=None, ddq=None))]
    fn torque<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        dq: Option<&Bound<'py, PyAny>>,
        ddq: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Array<'py>> {
        let predictor = self.predictor(py)?;
        let dof = predictor.dof();
        let motion = Motion::of(dof, q, dq, ddq)?;
        let samples = motion.count();
        let tau = motion.compute(py, 0, |numbers| {
            let [q, dq, ddq] = numbers.map(|rows| joint_major(rows, samples, dof));
            guarded(|| predictor.torque(&JointMotion { samples, q: &q, dq: &dq, ddq: &ddq }))
        })?;
        array(py, motion.lead(), &[dof], sample_major(&tau, samples, dof))
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
        let predictor = self.predictor(py)?;
        let dof = predictor.dof();
        let motion = Motion::of(dof, q, dq, ddq)?;
        let samples = motion.count();
        let found = motion.compute(py, 0, |numbers| {
            let [q, dq, ddq] = numbers.map(|rows| joint_major(rows, samples, dof));
            guarded(|| predictor.predict(&JointMotion { samples, q: &q, dq: &dq, ddq: &ddq }))
        })?;
        let rows = |values: &[f64]| array(py, motion.lead(), &[dof], sample_major(values, samples, dof));
        Ok((rows(&found.tau)?, rows(&found.half_width_95)?))
    }

    /// Creates an online monitor of the robot; missing settings have their defaults.
    #[pyo3(signature = (rate_hz, forgetting_s=None, correlation_s=None, collision_s=None, payload_s=None, contact_alarms_per_hour=None, drift_alarms_per_hour=None, half_window=None))]
    #[allow(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn online(
        slf: &Bound<'_, Self>,
        rate_hz: f64,
        forgetting_s: Option<f64>,
        correlation_s: Option<f64>,
        collision_s: Option<f64>,
        payload_s: Option<f64>,
        contact_alarms_per_hour: Option<f64>,
        drift_alarms_per_hour: Option<f64>,
        half_window: Option<usize>,
    ) -> PyResult<OnlineWatch> {
        let settings = OnlineSettings {
            rate_hz,
            forgetting_s,
            correlation_s,
            collision_s,
            payload_s,
            contact_alarms_per_hour,
            drift_alarms_per_hour,
            half_window,
        };
        slf.get().watched(slf.py(), slf, settings)
    }

    /// Exports the model in the format `target`: its text, and notes.
    fn export(&self, py: Python<'_>, target: &str) -> PyResult<(String, Vec<String>)> {
        let wanted = Target::ALL.into_iter().find(|form| form.name() == target).ok_or_else(|| {
            let known: Vec<&str> = Target::ALL.iter().map(|form| form.name()).collect();
            errors::ResultError::new_err(format!("no form `{target}`: give one of {}", known.join(", ")))
        })?;
        let of = (&self.study, &*self.path);
        let made = || guarded(|| export_result(&self.result, Path::new(RESULT), of.0, of.1, None, wanted));
        let exported = py.detach(made)?.map_err(|error| errors::job(py, &error))?;
        Ok((exported.text, exported.notes))
    }

    /// Writes a figure, and returns it as SVG.
    #[pyo3(signature = (figure, out, width_mm, font_pt, dpi, threads=None))]
    #[allow(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn plot(
        &self,
        py: Python<'_>,
        figure: &str,
        out: Vec<PathBuf>,
        width_mm: f64,
        font_pt: f64,
        dpi: f64,
        threads: Option<usize>,
    ) -> PyResult<String> {
        let (result, study, path) = (self.result.clone(), self.study.clone(), self.path.clone());
        let style = PrintStyle { width_mm, font_pt, dpi };
        let place = Path::new(RESULT);
        let threads = jobs::threads(threads);
        match figure {
            "parameters" => jobs::run(py, threads, None, move |_| drawn(&Figure::parameters(&result), &out, &style)),
            "friction" => {
                jobs::run(py, threads, None, move |_| drawn(&Figure::friction(&result, place)?, &out, &style))
            }
            "residuals" => jobs::run(py, threads, None, move |watch| {
                let options = RunOptions { data: None, threads, progress: watch };
                let traces = validation_traces(&result, place, &study, &path, &options)?;
                drawn(&Figure::residuals(&result, &traces), &out, &style)
            }),
            _ => Err(errors::ResultError::new_err(format!(
                "no figure `{figure}`: give one of residuals, parameters, friction"
            ))),
        }
    }

    /// Drive parameters in the conventions of simulators: JSON and a Markdown table.
    fn simulator(&self, py: Python<'_>) -> PyResult<(String, String)> {
        let of = (&self.study, &*self.path);
        let made = py.detach(|| guarded(|| export_simulator(&self.result, Path::new(RESULT), of.0, of.1, None)))?;
        let made = made.map_err(|error| errors::job(py, &error))?;
        let json = made.json().map_err(|error| errors::ResultError::new_err(error.to_string()))?;
        Ok((json.text, made.table().text))
    }

    /// A payload in the format of the controller `reader`: its text, and notes.
    #[pyo3(signature = (reader, name=None))]
    fn payload(&self, py: Python<'_>, reader: &str, name: Option<&str>) -> PyResult<(String, Vec<String>)> {
        const KNOWN: [(&str, ControllerBrand); 4] = [
            ("ur", ControllerBrand::UniversalRobots),
            ("franka", ControllerBrand::Franka),
            ("kuka", ControllerBrand::Kuka),
            ("abb", ControllerBrand::Abb),
        ];
        let wanted = KNOWN.into_iter().find(|(known, _)| *known == reader).ok_or_else(|| {
            let known = KNOWN.map(|(known, _)| known).join(", ");
            errors::ResultError::new_err(format!("no controller `{reader}`: give one of {known}"))
        })?;
        let made = export_payload(&self.result, Path::new(RESULT), name, wanted.1);
        let made = made.map_err(|error| errors::job(py, &error))?;
        Ok((made.text, made.notes))
    }
}
