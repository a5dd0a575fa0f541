//! Arrays of Python as numbers, and back.
//!
//! Vectors over joints stand in the last axis; whatever axes come before it count samples. What comes back has the same
//! axes before its own, so that one posture gives a vector and a thousand give a table.

use numpy::{IntoPyArray, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::borrow::Cow;

/// Numbers of an array, row-major, and its axes before the last.
pub(crate) struct Samples<'py> {
    array: PyReadonlyArrayDyn<'py, f64>,
    lead: Vec<usize>,
}

impl<'py> Samples<'py> {
    /// Anything that NumPy makes an array of, with `joints` entries in the last axis.
    pub(crate) fn of(object: &Bound<'py, PyAny>, name: &str, joints: usize) -> PyResult<Self> {
        let array = match object.cast::<PyArrayDyn<f64>>() {
            Ok(array) => array.clone(),
            Err(_) => {
                let py = object.py();
                let settings = PyDict::new(py);
                settings.set_item("dtype", "float64")?;
                let made = py.import("numpy")?.call_method("asarray", (object,), Some(&settings))?;
                made.cast_into::<PyArrayDyn<f64>>()
                    .map_err(|_| PyValueError::new_err(format!("{name}: give an array of numbers")))?
            }
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

    /// The same axes as another array's.
    pub(crate) fn like(self, other: &Self, name: &str) -> PyResult<Self> {
        if self.lead == other.lead {
            return Ok(self);
        }
        let (found, expected) = (&self.lead, &other.lead);
        Err(PyValueError::new_err(format!("{name} has samples in {found:?}, where the first array has {expected:?}")))
    }

    /// The axes before the last.
    pub(crate) fn lead(&self) -> &[usize] {
        &self.lead
    }

    /// Number of samples.
    pub(crate) fn count(&self) -> usize {
        self.lead.iter().product()
    }

    /// All numbers, row-major; copied only where the array is not.
    pub(crate) fn numbers(&self) -> Cow<'_, [f64]> {
        match self.array.as_slice() {
            Ok(numbers) => Cow::Borrowed(numbers),
            Err(_) => Cow::Owned(self.array.as_array().iter().copied().collect()),
        }
    }
}

/// An array with the samples' axes and its own.
pub(crate) fn array<'py>(
    py: Python<'py>,
    lead: &[usize],
    own: &[usize],
    numbers: Vec<f64>,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let shape: Vec<usize> = lead.iter().chain(own).copied().collect();
    numbers.into_pyarray(py).reshape(shape)
}
