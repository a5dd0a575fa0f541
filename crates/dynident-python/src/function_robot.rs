//! A robot that is a Python function.

use crate::arrays::{array, sample_major};
use crate::errors::StopRun;
use dynident::iteration::Robot;
use dynident::iteration::robot::{ControlledRun, FunctionRobot};
use numpy::{PyArrayDyn, PyReadonlyArray1};
use pyo3::prelude::*;
use std::sync::{Arc, Mutex};

type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

/// The first exception of the called Python code.
#[derive(Clone, Default)]
pub(crate) struct Raised(Arc<Mutex<Option<PyErr>>>);

impl Raised {
    pub(crate) fn keep(&self, outcome: PyResult<()>) {
        if let (Err(error), Ok(mut kept)) = (outcome, self.0.lock()) {
            kept.get_or_insert(error);
        }
    }

    pub(crate) fn taken(&self) -> Option<PyErr> {
        self.0.lock().ok().and_then(|mut kept| kept.take())
    }
}

/// One run of a robot: the motion to follow, and the controller that computes the torque.
///
/// The function moves its robot to ``q[0]``. At every sample it calls ``torque`` with the measured state and applies
/// the result; it returns after the last sample. It runs at ``rate_hz``.
#[pyclass(frozen, module = "dynident")]
pub(crate) struct Run {
    /// Borrowed while the function runs.
    controlled: Mutex<Option<ControlledRun>>,
    number: usize,
    joints: Vec<String>,
    rate_hz: f64,
    samples: usize,
    motion: [Vec<f64>; 3],
}

impl Run {
    fn rows<'py>(&self, py: Python<'py>, which: usize) -> PyResult<Array<'py>> {
        let joints = self.joints.len();
        array(py, &[self.samples], &[joints], sample_major(&self.motion[which], self.samples, joints))
    }
}

#[pymethods]
impl Run {
    /// Number of the run, from 1.
    #[getter]
    fn number(&self) -> usize {
        self.number
    }

    /// Names of the joints, in the order of all vectors.
    #[getter]
    fn joint_names(&self) -> Vec<String> {
        self.joints.clone()
    }

    /// Sample rate, Hz.
    #[getter]
    fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Number of samples of the run.
    #[getter]
    fn samples(&self) -> usize {
        self.samples
    }

    /// Reference positions, rad (m), shape ``(samples, n)``.
    #[getter]
    fn q<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        self.rows(py, 0)
    }

    /// Reference velocities, rad/s (m/s), shape ``(samples, n)``.
    #[getter]
    fn dq<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        self.rows(py, 1)
    }

    /// Reference accelerations, rad/s² (m/s²), shape ``(samples, n)``.
    #[getter]
    fn ddq<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        self.rows(py, 2)
    }

    /// Drive torques for the next sample, Nm (N), shape ``(n,)``, given the measured state at ``time_s`` by the robot's
    /// clock. Raises ``StopRun`` if the robot has to be stopped at once: do not catch it, or stop and return.
    fn torque<'py>(
        &self,
        py: Python<'py>,
        time_s: f64,
        q: PyReadonlyArray1<'py, f64>,
        dq: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Array<'py>> {
        let numbers = |values: &PyReadonlyArray1<'py, f64>| -> Vec<f64> { values.as_array().iter().copied().collect() };
        let (q, dq) = (numbers(&q), numbers(&dq));
        let over = || StopRun::new_err("the run is over: stop the robot");
        let mut run = self.controlled.lock().map_err(|_| over())?;
        let tau = run.as_mut().and_then(|run| run.torque(time_s, &q, &dq)).ok_or_else(over)?;
        array(py, &[tau.len()], &[], tau.to_vec())
    }

    fn __repr__(&self) -> String {
        format!("Run({}, {} samples at {} Hz)", self.number, self.samples, self.rate_hz)
    }
}

/// A robot that calls `function(run)`; exceptions are stored in `raised`.
pub(crate) fn robot_of(function: &Arc<Py<PyAny>>, joints: &[String], raised: &Raised) -> Box<dyn Robot> {
    let (function, raised, names) = (Arc::clone(function), raised.clone(), joints.to_vec());
    let call = move |run: ControlledRun| {
        Python::attach(|py| {
            let motion = run.reference().motion();
            let shown = Run {
                number: run.run(),
                joints: names.clone(),
                rate_hz: run.reference().rate_hz(),
                samples: run.reference().samples(),
                motion: [motion.q.clone(), motion.dq.clone(), motion.ddq.clone()],
                controlled: Mutex::new(Some(run)),
            };
            let shown = match Py::new(py, shown) {
                Ok(shown) => shown,
                // Out of memory.
                Err(error) => panic!("{error}"),
            };
            let outcome = function.call1(py, (&shown,));
            let run = shown.get().controlled.lock().ok().and_then(|mut run| run.take());
            let run = run.unwrap_or_else(|| panic!("the borrowed run is returned"));
            let result = match outcome {
                Ok(_) => Ok(()),
                Err(error) if error.is_instance_of::<StopRun>(py) => Ok(()),
                Err(error) => {
                    let message = error.to_string();
                    raised.keep(Err(error));
                    Err(message)
                }
            };
            (run, result)
        })
    };
    Box::new(FunctionRobot::new(joints.to_vec(), call))
}
