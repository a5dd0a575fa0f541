//! A robot that is a Python function.

use crate::arrays::{Samples, array, sample_major};
use crate::errors::StopRun;
use dynident::iteration::Robot;
use dynident::iteration::robot::{ControlledRun, FunctionRobot, FunctionStop};
use numpy::PyArrayDyn;
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
///
/// >>> def robot(run):
/// ...     driver.move_to(run.q[0])
/// ...     for sample in range(run.samples):
/// ...         time_s, q, dq = driver.state()
/// ...         driver.apply(run.torque(time_s, q, dq))
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
    /// clock: ``q``, rad (m), and ``dq``, rad/s (m/s), as arrays or lists of n numbers. Raises ``StopRun`` with the
    /// reason if the robot has to be stopped at once: do not catch it, or stop and return.
    fn torque<'py>(
        &self,
        py: Python<'py>,
        time_s: f64,
        q: &Bound<'py, PyAny>,
        dq: &Bound<'py, PyAny>,
    ) -> PyResult<Array<'py>> {
        let numbers = |values: &Bound<'py, PyAny>, name: &str| -> PyResult<Vec<f64>> {
            Ok(Samples::of(values, name, self.joints.len())?.one(name)?.to_vec())
        };
        let (q, dq) = (numbers(q, "q")?, numbers(dq, "dq")?);
        let over = |reason: Option<String>| {
            let reason = reason.unwrap_or_else(|| "the run is over".to_owned());
            StopRun::new_err(format!("{reason}: stop the robot"))
        };
        let mut run = self.controlled.lock().map_err(|_| over(None))?;
        let Some(run) = run.as_mut() else { return Err(over(None)) };
        let tau = run.torque(time_s, &q, &dq).map(<[f64]>::to_vec);
        let tau = tau.ok_or_else(|| over(run.end_reason()))?;
        array(py, &[tau.len()], &[], tau)
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
                // Raised by `torque`, or by the function because the robot has stopped.
                Err(error) if error.is_instance_of::<StopRun>(py) => {
                    let reason = error.value(py).to_string();
                    if run.end_reason().is_some() { Ok(()) } else { Err(FunctionStop::Robot { reason }) }
                }
                Err(error) => {
                    let reason = error.to_string();
                    raised.keep(Err(error));
                    Err(FunctionStop::Function { reason })
                }
            };
            (run, result)
        })
    };
    Box::new(FunctionRobot::new(joints.to_vec(), call))
}
