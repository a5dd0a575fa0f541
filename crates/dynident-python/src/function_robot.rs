//! A robot that is a function of Python.

use crate::arrays::{array, sample_major};
use crate::errors::StopRun;
use dynident::iteration::Robot;
use dynident::iteration::robot::{ControlledRun, FunctionRobot};
use numpy::{PyArrayDyn, PyReadonlyArray1};
use pyo3::prelude::*;
use std::sync::{Arc, Mutex};

type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

/// The first exception of code that was called on the way.
#[derive(Clone, Default)]
pub(crate) struct Raised(Arc<Mutex<Option<PyErr>>>);

impl Raised {
    /// Keeps an exception, the first of all.
    pub(crate) fn keep(&self, outcome: PyResult<()>) {
        if let (Err(error), Ok(mut kept)) = (outcome, self.0.lock()) {
            kept.get_or_insert(error);
        }
    }

    /// The exception, if there was one.
    pub(crate) fn taken(&self) -> Option<PyErr> {
        self.0.lock().ok().and_then(|mut kept| kept.take())
    }
}

/// One run of a robot: what it has to follow, and the controller that it asks for torque.
///
/// The function brings its robot to ``q[0]`` and at every sample asks ``torque`` with the measured state, applies what
/// it gets, and returns after the last sample. It runs at ``rate_hz``.
#[pyclass(frozen, module = "dynident")]
pub(crate) struct Run {
    /// Lent for as long as the function runs.
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

    /// Samples a second.
    #[getter]
    fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Samples of the run.
    #[getter]
    fn samples(&self) -> usize {
        self.samples
    }

    /// Positions to follow, rad (m), shape ``(samples, n)``.
    #[getter]
    fn q<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        self.rows(py, 0)
    }

    /// Velocities to follow, rad/s (m/s), shape ``(samples, n)``.
    #[getter]
    fn dq<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        self.rows(py, 1)
    }

    /// Accelerations to follow, rad/s² (m/s²), shape ``(samples, n)``.
    #[getter]
    fn ddq<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        self.rows(py, 2)
    }

    /// The drives' torques for the next sample, Nm (N), shape ``(n,)``, by the measured state at ``time_s`` of the
    /// robot's own clock. Raises ``StopRun`` where the robot has to be stopped at once: let it pass, or stop and
    /// return.
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

/// The robot that `function(run)` is; what it raises is kept.
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
                // Memory for one object that is not there.
                Err(error) => panic!("{error}"),
            };
            let outcome = function.call1(py, (&shown,));
            let run = shown.get().controlled.lock().ok().and_then(|mut run| run.take());
            let run = run.unwrap_or_else(|| panic!("a run that is lent comes back"));
            let said = match outcome {
                Ok(_) => Ok(()),
                Err(error) if error.is_instance_of::<StopRun>(py) => Ok(()),
                Err(error) => {
                    let message = error.to_string();
                    raised.keep(Err(error));
                    Err(message)
                }
            };
            (run, said)
        })
    };
    Box::new(FunctionRobot::new(joints.to_vec(), call))
}
