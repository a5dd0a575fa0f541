//! Python functions in a study: a torque, a differentiator, an estimator, a family of motions.
//!
//! An exception in such a function ends the job: it unwinds to [`guarded`] at the begin of the job, and is raised there
//! with its traceback. So does a result with a wrong shape, or one that is not finite.

use crate::arrays::{array, sample_major};
use crate::errors;
use dynident::estimation::{CustomEstimate, EstimatorRows as Rows};
use dynident::excitation::Motion;
use dynident::excitation::families::MotionFunction;
use dynident::identification::estimators::EstimatorRule;
use dynident::model::terms::{JointMotion, TorqueLaw};
use dynident::recording::{Derivatives, Differentiator, DifferentiatorSettings, FilterError, Place, SampleRanges};
use dynident::study::{Code, FamilyChoice};
use nalgebra::DMatrix;
use numpy::{PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;

type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

/// Panic payload of a Python exception.
pub(crate) struct RaisedError(pub(crate) PyErr);

/// Runs code that may call Python functions; returns their exception.
pub(crate) fn guarded<R>(work: impl FnOnce() -> R) -> PyResult<R> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| match panic.downcast::<RaisedError>() {
        Ok(thrown) => thrown.0,
        Err(panic) => resume_unwind(panic),
    })
}

/// Runs Python code with the interpreter lock; unwinds with its exception.
fn call<R>(work: impl FnOnce(Python<'_>) -> PyResult<R>) -> R {
    Python::attach(work).unwrap_or_else(|error| resume_unwind(Box::new(RaisedError(error))))
}

/// The functions of a study by the names in its sections: for each a dictionary with the key `function` and additional
/// keys of the section.
#[derive(Clone, Default)]
pub(crate) struct Callables(Option<Arc<Py<PyDict>>>);

impl Callables {
    pub(crate) fn of(functions: Option<Bound<'_, PyDict>>) -> Self {
        Self(functions.filter(|functions| !functions.is_empty()).map(|functions| Arc::new(functions.unbind())))
    }

    /// The dictionary; `None` if the study has no functions.
    pub(crate) fn dictionary(&self, py: Python<'_>) -> Option<Py<PyDict>> {
        self.0.as_ref().map(|functions| functions.clone_ref(py))
    }

    /// Attaches the functions to the sections that name them.
    pub(crate) fn attach(&self, py: Python<'_>, study: &mut dynident::Study) -> PyResult<()> {
        let Some(functions) = &self.0 else { return Ok(()) };
        let named = |name: &str| -> PyResult<Option<Bound<'_, PyDict>>> {
            functions.bind(py).get_item(name)?.map(|own| Ok(own.cast_into::<PyDict>()?)).transpose()
        };
        for torque in &mut study.torque {
            let Some(own) = torque.function.as_deref().map(named).transpose()?.flatten() else { continue };
            let law = Torque { what: format!("torque `{}`", torque.name), function: function_of(&own)? };
            torque.code = Code(Some(Arc::new(law)));
        }
        if let DifferentiatorSettings::Function { function, code } = &mut study.motion.differentiator
            && let Some(own) = named(function)?
        {
            let differentiator: Arc<dyn Differentiator> = Arc::new(PyDifferentiator::of(&own)?);
            *code = differentiator.into();
        }
        if let Some(own) = study.estimator.function.as_deref().map(named).transpose()?.flatten() {
            study.estimator.code = Code(Some(Arc::new(Rule { function: function_of(&own)? })));
        }
        if let Some(design) = &mut study.design {
            attach_family(&mut design.family, &named)?;
        }
        Ok(())
    }
}

fn attach_family<'py>(
    family: &mut FamilyChoice,
    named: &impl Fn(&str) -> PyResult<Option<Bound<'py, PyDict>>>,
) -> PyResult<()> {
    match family {
        FamilyChoice::Function(own) => {
            if let Some(code) = named(&own.function)? {
                own.code = Code(Some(Arc::new(Trajectory { function: function_of(&code)? })));
            }
            Ok(())
        }
        FamilyChoice::Joined(joined) => joined.parts.iter_mut().try_for_each(|part| attach_family(part, named)),
        _ => Ok(()),
    }
}

fn function_of(own: &Bound<'_, PyDict>) -> PyResult<Py<PyAny>> {
    let function = own.get_item("function")?.ok_or_else(|| errors::StudyError::new_err("no function"))?;
    Ok(function.unbind())
}

/// Converts a result of `what` to values in row-major order; it must have this shape and be finite.
fn numbers(answer: &Bound<'_, PyAny>, what: &str, shape: &[usize]) -> PyResult<Vec<f64>> {
    let py = answer.py();
    let settings = PyDict::new(py);
    settings.set_item("dtype", "float64")?;
    let made = py.import("numpy")?.call_method("asarray", (answer,), Some(&settings))?;
    let made = made.cast_into::<PyArrayDyn<f64>>()?;
    if made.shape() != shape {
        let shape = shown(shape);
        return Err(errors::StudyError::new_err(format!(
            "{what} gave an array of shape {}: give {shape}",
            shown(made.shape())
        )));
    }
    let values: Vec<f64> = made.readonly().as_array().iter().copied().collect();
    if let Some(place) = values.iter().position(|value| !value.is_finite()) {
        let mut left = place;
        let mut index = vec![0; shape.len()];
        for (axis, &length) in shape.iter().enumerate().rev() {
            (index[axis], left) = (left % length, left / length);
        }
        let message = format!("{what} gave {} at {}: give finite numbers", values[place], shown(&index));
        return Err(errors::StudyError::new_err(message));
    }
    Ok(values)
}

/// A shape in Python's notation: `(3,)`, `(3, 2)`.
fn shown(shape: &[usize]) -> String {
    match shape {
        [one] => format!("({one},)"),
        _ => format!("({})", shape.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    }
}

/// The parts of a result with several arrays.
fn parts<'py, const N: usize>(answer: &Bound<'py, PyAny>, what: &str, names: &str) -> PyResult<[Bound<'py, PyAny>; N]> {
    let found: Option<Vec<Bound<'py, PyAny>>> = answer.try_iter().and_then(Iterator::collect).ok();
    let found = found.and_then(|parts| <[Bound<'py, PyAny>; N]>::try_from(parts).ok());
    found.ok_or_else(|| errors::StudyError::new_err(format!("{what} must return {names}")))
}

/// `function(q, dq)`: torque per unit of its coefficient.
#[derive(Debug)]
struct Torque {
    what: String,
    function: Py<PyAny>,
}

impl TorqueLaw for Torque {
    fn fill(&self, motion: &JointMotion<'_>, out: &mut [f64]) {
        let samples = motion.samples;
        if samples == 0 {
            return;
        }
        let joints = motion.q.len() / samples;
        call(|py| {
            let rows = |values: &[f64]| array(py, &[samples], &[joints], sample_major(values, samples, joints));
            let answer = self.function.bind(py).call1((rows(motion.q)?, rows(motion.dq)?))?;
            out.copy_from_slice(&numbers(&answer, &self.what, &[samples])?);
            Ok(())
        });
    }
}

/// `function(q, rate_hz)`: position, velocity and acceleration of one joint.
#[derive(Debug)]
struct PyDifferentiator {
    function: Py<PyAny>,
    smooth: Option<Py<PyAny>>,
    context: Option<usize>,
    minimum: usize,
}

impl PyDifferentiator {
    /// Default of the smallest number of samples.
    const DEFAULT_MINIMUM_SAMPLES: usize = 5;

    fn of(own: &Bound<'_, PyDict>) -> PyResult<Self> {
        let count = |key: &str| -> PyResult<Option<usize>> {
            let given = own.get_item(key)?.map(|value| value.extract::<usize>()).transpose();
            given.map_err(|_| {
                errors::StudyError::new_err(format!("motion.differentiator.{key}: give a number of samples"))
            })
        };
        Ok(Self {
            function: function_of(own)?,
            smooth: own.get_item("smooth")?.map(Bound::unbind),
            context: count("context_samples")?,
            minimum: count("minimum_samples")?.unwrap_or(Self::DEFAULT_MINIMUM_SAMPLES).max(1),
        })
    }
}

impl Differentiator for PyDifferentiator {
    fn name(&self) -> &'static str {
        "function"
    }

    fn minimum_samples(&self) -> usize {
        self.minimum
    }

    fn context_samples(&self, _rate_hz: f64) -> Option<usize> {
        self.context
    }

    fn differentiate_at(&self, place: Place, q: &[f64], out: Derivatives<'_>) -> Result<SampleRanges, FilterError> {
        self.check_length(q.len())?;
        call(|py| {
            let what = "motion.differentiator";
            let answer = self.function.bind(py).call1((array(py, &[q.len()], &[], q.to_vec())?, place.rate_hz))?;
            let found: [_; 3] = parts(&answer, what, "three arrays, q, dq and ddq")?;
            for ((to, answer), name) in [out.q, out.dq, out.ddq].into_iter().zip(&found).zip(["q", "dq", "ddq"]) {
                to[..q.len()].copy_from_slice(&numbers(answer, &format!("{what}, {name},"), &[q.len()])?);
            }
            Ok(())
        });
        Ok(Vec::new())
    }

    fn smooth(&self, rate_hz: f64, signal: &[f64], out: &mut [f64]) -> Result<(), FilterError> {
        let Some(smooth) = &self.smooth else {
            out[..signal.len()].copy_from_slice(signal);
            return Ok(());
        };
        call(|py| {
            let answer = smooth.bind(py).call1((array(py, &[signal.len()], &[], signal.to_vec())?, rate_hz))?;
            out[..signal.len()].copy_from_slice(&numbers(&answer, "motion.differentiator, smooth,", &[signal.len()])?);
            Ok(())
        });
        Ok(())
    }
}

/// `function(rows)`: values, or values and covariance.
#[derive(Debug)]
struct Rule {
    function: Py<PyAny>,
}

impl EstimatorRule for Rule {
    fn estimate(&self, rows: &Rows) -> CustomEstimate {
        let count = rows.names.len();
        call(|py| {
            let answer = self.function.bind(py).call1((EstimatorRows(rows.clone()),))?;
            let what = "the estimator";
            let Ok(pair) = answer.cast::<PyTuple>() else {
                return Ok(CustomEstimate { values: numbers(&answer, what, &[count])?, covariance: None });
            };
            let [values, covariance]: [_; 2] = parts(pair, what, "values, or a pair of values and covariance")?;
            let covariance = numbers(&covariance, &format!("{what}, the covariance,"), &[count, count])?;
            let covariance = Some(DMatrix::from_row_slice(count, count, &covariance));
            Ok(CustomEstimate { values: numbers(&values, what, &[count])?, covariance })
        })
    }
}

/// `function(parameters, time_s)`: position, velocity, acceleration and jerk.
#[derive(Debug)]
struct Trajectory {
    function: Py<PyAny>,
}

impl MotionFunction for Trajectory {
    fn motion(&self, parameters: &[f64], times_s: &[f64], out: &mut Motion) {
        let (samples, joints) = (times_s.len(), out.joints);
        call(|py| {
            let own = array(py, &[joints], &[parameters.len() / joints.max(1)], parameters.to_vec())?;
            let answer = self.function.bind(py).call1((own, array(py, &[samples], &[], times_s.to_vec())?))?;
            let what = "design.family";
            let found: [_; 4] = parts(&answer, what, "four arrays, q, dq, ddq and the jerk dddq")?;
            let to = [&mut out.q, &mut out.dq, &mut out.ddq, &mut out.dddq];
            for ((to, answer), name) in to.into_iter().zip(&found).zip(["q", "dq", "ddq", "dddq"]) {
                let rows = numbers(answer, &format!("{what}, {name},"), &[samples, joints])?;
                *to = crate::arrays::joint_major(&rows, samples, joints);
            }
            Ok(())
        });
    }
}

/// Rows for a custom estimator: ``W @ theta`` and ``tau``.
///
/// They are the triangular factors of all rows of the logs, one block per joint: for every ``theta`` the sum of squares
/// ``‖tau - W theta‖²`` and the gradient ``Wᵀ (tau - W theta)`` of a joint's block equal those of all its samples.
/// Columns that the logs do not excite are omitted.
///
/// >>> import numpy as np
/// >>> def ridge(rows):
/// ...     W, tau = rows.W, rows.tau
/// ...     return np.linalg.solve(W.T @ W + 1e-6 * np.eye(W.shape[1]), W.T @ tau)
#[pyclass(frozen, module = "dynident")]
pub(crate) struct EstimatorRows(Rows);

#[pymethods]
impl EstimatorRows {
    /// Regressor, shape ``(rows, columns)``.
    #[getter]
    #[allow(non_snake_case, reason = "the field's name")]
    fn W<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let matrix = &self.0.regressor;
        array(py, &[matrix.nrows()], &[matrix.ncols()], matrix.transpose().as_slice().to_vec())
    }

    /// Torque, Nm (N), shape ``(rows,)``.
    #[getter]
    fn tau<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        array(py, &[self.0.torque.len()], &[], self.0.torque.as_slice().to_vec())
    }

    /// Index of the joint of each row, from 0.
    #[getter]
    fn joint(&self) -> Vec<usize> {
        self.0.joint_of_row.clone()
    }

    /// Names of the columns: the symbols of the base parameters.
    #[getter]
    fn names(&self) -> Vec<String> {
        self.0.names.clone()
    }

    /// Names of the joints.
    #[getter]
    fn joint_names(&self) -> Vec<String> {
        self.0.joints.clone()
    }

    /// Number of samples of each joint.
    #[getter]
    fn samples(&self) -> Vec<usize> {
        self.0.samples.clone()
    }

    /// Noise of each joint from weighted least squares, Nm (N), shape ``(n,)``; rows divided by it are white.
    #[getter]
    fn sigma<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        array(py, &[self.0.joint_sigma.len()], &[], self.0.joint_sigma.clone())
    }

    fn __repr__(&self) -> String {
        let (rows, columns) = self.0.regressor.shape();
        format!("EstimatorRows({rows} rows of {} joints, {columns} columns)", self.0.joints.len())
    }
}
