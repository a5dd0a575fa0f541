//! Conversion between NumPy arrays and slices.
//!
//! Vectors over joints are in the last axis; all axes before it are samples. Results have the same leading axes: one
//! posture gives a vector, a thousand postures give a table.

use crate::pool::pool;
use numpy::{IntoPyArray, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::borrow::Cow;

/// Smallest number of result values for which several threads are used.
const MIN_PARALLEL_VALUES: usize = 50_000;

/// Values of an array, row-major, and its leading axes.
pub(crate) struct Samples<'py> {
    array: PyReadonlyArrayDyn<'py, f64>,
    lead: Vec<usize>,
}

impl<'py> Samples<'py> {
    /// Converts any array-like object with `joints` entries in the last axis.
    pub(crate) fn of(object: &Bound<'py, PyAny>, name: &str, joints: usize) -> PyResult<Self> {
        let array = if let Ok(array) = object.cast::<PyArrayDyn<f64>>() {
            array.clone()
        } else {
            let py = object.py();
            let settings = PyDict::new(py);
            settings.set_item("dtype", "float64")?;
            let made = py.import("numpy")?.call_method("asarray", (object,), Some(&settings))?;
            made.cast_into::<PyArrayDyn<f64>>()
                .map_err(|_| PyValueError::new_err(format!("{name}: give an array of numbers")))?
        };
        let shape = array.shape();
        match shape.split_last() {
            Some((&last, lead)) if last == joints => {
                let lead = lead.to_vec();
                Ok(Self { array: array.readonly(), lead })
            }
            _ => Err(PyValueError::new_err(format!(
                "{name} has the shape {shape:?}: the last axis needs {joints} entries, one for each joint"
            ))),
        }
    }

    /// The values of an array-like object with `count` entries, in any shape.
    pub(crate) fn values(object: &Bound<'py, PyAny>, name: &str, count: usize) -> PyResult<Vec<f64>> {
        let settings = PyDict::new(object.py());
        settings.set_item("dtype", "float64")?;
        let made = object.py().import("numpy")?.call_method("asarray", (object,), Some(&settings))?;
        let made = made.call_method1("reshape", (-1,))?;
        let values: Vec<f64> = made.extract()?;
        if values.len() == count {
            return Ok(values);
        }
        Err(PyValueError::new_err(format!("{name} has {} values for {count} samples: give one for each", values.len())))
    }

    /// Checks that the leading axes equal those of another array.
    pub(crate) fn like(self, other: &Self, name: &str) -> PyResult<Self> {
        if self.lead == other.lead {
            return Ok(self);
        }
        let (found, expected) = (&self.lead, &other.lead);
        Err(PyValueError::new_err(format!("{name} has samples in {found:?}, where the first array has {expected:?}")))
    }

    pub(crate) fn lead(&self) -> &[usize] {
        &self.lead
    }

    /// The values of one sample.
    pub(crate) fn one(&self, name: &str) -> PyResult<Cow<'_, [f64]>> {
        if self.lead.is_empty() {
            return Ok(self.numbers());
        }
        Err(PyValueError::new_err(format!("{name} has {} samples: give one", self.count())))
    }

    pub(crate) fn count(&self) -> usize {
        self.lead.iter().product()
    }

    /// All values, row-major; copied only if the array is not.
    pub(crate) fn numbers(&self) -> Cow<'_, [f64]> {
        match self.array.as_slice() {
            // `as_slice` also accepts contiguous column-major arrays.
            Ok(numbers) if self.array.is_c_contiguous() => Cow::Borrowed(numbers),
            _ => Cow::Owned(self.array.as_array().iter().copied().collect()),
        }
    }
}

/// An array with the leading axes of the samples and its own axes.
pub(crate) fn array<'py>(
    py: Python<'py>,
    lead: &[usize],
    own: &[usize],
    numbers: Vec<f64>,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let shape: Vec<usize> = lead.iter().chain(own).copied().collect();
    numbers.into_pyarray(py).reshape(shape)
}

/// A motion of `(..., n)` arrays; missing velocity and acceleration are zero.
pub(crate) struct Motion<'py> {
    q: Samples<'py>,
    dq: Option<Samples<'py>>,
    ddq: Option<Samples<'py>>,
}

impl<'py> Motion<'py> {
    pub(crate) fn of(
        dof: usize,
        q: &Bound<'py, PyAny>,
        dq: Option<&Bound<'py, PyAny>>,
        ddq: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let q = Samples::of(q, "q", dof)?;
        let other = |array: Option<&Bound<'py, PyAny>>, name: &str| {
            array.map(|array| Samples::of(array, name, dof)?.like(&q, name)).transpose()
        };
        let (dq, ddq) = (other(dq, "dq")?, other(ddq, "ddq")?);
        Ok(Self { q, dq, ddq })
    }

    pub(crate) fn lead(&self) -> &[usize] {
        self.q.lead()
    }

    pub(crate) fn count(&self) -> usize {
        self.q.count()
    }

    /// Creates an array with the leading axes of the samples and the axes `own`. `work` fills it row by row, without
    /// the interpreter lock, on several threads if it is large. NumPy allocates the memory, because it requests large
    /// pages.
    pub(crate) fn fill(
        &self,
        py: Python<'py>,
        own: &[usize],
        work: impl FnOnce([&[f64]; 3], &mut [f64]) + Send,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let array = PyArrayDyn::<f64>::zeros(py, self.shape(own), false);
        self.fill_into(py, &array, work)?;
        Ok(array)
    }

    /// Shape of an array with the leading axes of the samples and the axes `own`.
    pub(crate) fn shape(&self, own: &[usize]) -> Vec<usize> {
        self.lead().iter().chain(own).copied().collect()
    }

    /// As [`fill`](Self::fill), into an existing array with any content.
    pub(crate) fn fill_into(
        &self,
        py: Python<'py>,
        array: &Bound<'py, PyArrayDyn<f64>>,
        work: impl FnOnce([&[f64]; 3], &mut [f64]) + Send,
    ) -> PyResult<()> {
        let wrong = |error: String| PyValueError::new_err(format!("out: {error}"));
        let mut lent = array.try_readwrite().map_err(|error| wrong(error.to_string()))?;
        let out = lent.as_slice_mut().map_err(|error| wrong(error.to_string()))?;
        self.compute(py, out.len(), |motion| work(motion, out));
        Ok(())
    }

    /// Checks an output array of the caller: float64, of this shape, row-major.
    pub(crate) fn given(&self, out: &Bound<'py, PyAny>, own: &[usize]) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let shape = self.shape(own);
        match out.cast::<PyArrayDyn<f64>>() {
            Ok(array) if array.shape() == shape && array.is_c_contiguous() => Ok(array.clone()),
            _ => Err(PyValueError::new_err(format!("out: give an array of float64, row by row, of shape {shape:?}"))),
        }
    }

    /// Runs `work`, which computes `results` values, without the interpreter lock, on several threads if there are many
    /// values.
    pub(crate) fn compute<R: Send>(
        &self,
        py: Python<'py>,
        results: usize,
        work: impl FnOnce([&[f64]; 3]) -> R + Send,
    ) -> R {
        let q = self.q.numbers();
        let rest = vec![0.0; if self.dq.is_none() || self.ddq.is_none() { q.len() } else { 0 }];
        let dq = self.dq.as_ref().map(Samples::numbers);
        let ddq = self.ddq.as_ref().map(Samples::numbers);
        let (q, dq, ddq) = (&*q, dq.as_deref().unwrap_or(&rest), ddq.as_deref().unwrap_or(&rest));
        let pool = if results < MIN_PARALLEL_VALUES { None } else { pool(py) };
        py.detach(move || match pool {
            Some(pool) => pool.install(|| work([q, dq, ddq])),
            None => work([q, dq, ddq]),
        })
    }
}

pub(crate) fn joint_major(rows: &[f64], samples: usize, joints: usize) -> Vec<f64> {
    let mut out = vec![0.0; rows.len()];
    for (sample, row) in rows.chunks_exact(joints.max(1)).enumerate() {
        for (joint, value) in row.iter().enumerate() {
            out[joint * samples + sample] = *value;
        }
    }
    out
}

pub(crate) fn sample_major(rows: &[f64], samples: usize, joints: usize) -> Vec<f64> {
    joint_major(rows, joints, samples)
}
