//! `Watch`: online monitoring of a robot, sample by sample or array by array.

use crate::arrays::{Samples, array};
use crate::callables::guarded;
use crate::errors::Error;
use dynident::identification::consistent::ConsistencySettings;
use dynident::model::terms::TorqueTerm;
use dynident::online::{Contact, DriftAlarm, OnlineError, Residuals, TimeScale, Watch, WatchSettings};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::{Mutex, MutexGuard, PoisonError};

type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

fn raised(error: OnlineError) -> PyErr {
    Error::new_err(error.to_string())
}

/// Online monitor of a robot, created by ``Model.online``.
///
/// ``update`` takes one sample or an array of samples; detected events are in ``alarms``. Without velocities and
/// accelerations these are computed from the positions, and results are delayed by ``delay_s``.
#[pyclass(frozen, module = "dynident", name = "Watch")]
pub(crate) struct OnlineWatch {
    own: Mutex<Watched>,
    joints: Vec<String>,
    parameters: Vec<String>,
    rate_hz: f64,
}

struct Watched {
    watch: Watch,
    /// Whether the samples include derivatives; `None` before the first sample.
    with_derivatives: Option<bool>,
    samples: u64,
    now: Option<Contact>,
    drift: Option<DriftAlarm>,
    alarms: Vec<Alarm>,
}

#[derive(Clone, Copy)]
struct Alarm {
    time_s: f64,
    what: What,
}

#[derive(Clone, Copy)]
enum What {
    Contact(Contact),
    Drift(DriftAlarm),
}

impl OnlineWatch {
    /// Creates a monitor with the names for its alarms.
    pub(crate) fn new(watch: Watch, joints: Vec<String>, settings: &WatchSettings) -> Self {
        let parameters = watch.estimator().model().base().expressions();
        let rate_hz = settings.contact.rate_hz;
        let own = Watched { watch, with_derivatives: None, samples: 0, now: None, drift: None, alarms: Vec::new() };
        Self { own: Mutex::new(own), joints, parameters, rate_hz }
    }

    fn own(&self) -> MutexGuard<'_, Watched> {
        self.own.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Processes all samples and calls `look` after each.
    fn run(
        &self,
        py: Python<'_>,
        arrays: [&Bound<'_, PyAny>; 2],
        derivatives: Option<[&Bound<'_, PyAny>; 2]>,
        mut look: impl FnMut(&mut Watched, Option<Contact>) -> Result<(), OnlineError> + Send,
    ) -> PyResult<()> {
        let dof = self.joints.len();
        let q = Samples::of(arrays[0], "q", dof)?;
        let tau = Samples::of(arrays[1], "tau", dof)?.like(&q, "tau")?;
        let derivatives = match derivatives {
            Some([dq, ddq]) => {
                Some([Samples::of(dq, "dq", dof)?.like(&q, "dq")?, Samples::of(ddq, "ddq", dof)?.like(&q, "ddq")?])
            }
            None => None,
        };
        let (q, tau) = (q.numbers(), tau.numbers());
        let derivatives = derivatives.as_ref().map(|both| both.each_ref().map(Samples::numbers));
        let (q, tau): (&[f64], &[f64]) = (&q, &tau);
        let derivatives = derivatives.as_ref().map(|[dq, ddq]| (&**dq, &**ddq));
        let work = move || {
            let mut own = self.own();
            if *own.with_derivatives.get_or_insert(derivatives.is_some()) != derivatives.is_some() {
                return Err(Mixed::Derivatives);
            }
            for at in (0..q.len()).step_by(dof.max(1)) {
                let row = at..at + dof;
                let (q, tau) = (&q[row.clone()], &tau[row.clone()]);
                let contact = match derivatives {
                    Some((dq, ddq)) => own.watch.add(q, &dq[row.clone()], &ddq[row], tau)?,
                    None => own.watch.add_measured(q, tau)?,
                };
                own.samples += 1;
                look(&mut own, contact)?;
            }
            Ok(())
        };
        py.detach(|| guarded(work))?.map_err(|error| match error {
            Mixed::Derivatives => Error::new_err(
                "inconsistent samples: only some have velocities and accelerations; give \
                 them always or never",
            ),
            Mixed::Online(error) => raised(error),
        })
    }

    fn described<'py>(&self, py: Python<'py>, alarm: &Alarm) -> PyResult<Bound<'py, PyDict>> {
        let found = PyDict::new(py);
        found.set_item("time_s", alarm.time_s)?;
        match alarm.what {
            What::Contact(contact) => self.contact_into(&found, contact)?,
            What::Drift(drift) => self.drift_into(&found, drift)?,
        }
        Ok(found)
    }

    fn contact_into(&self, found: &Bound<'_, PyDict>, contact: Contact) -> PyResult<()> {
        let kind = match contact.look {
            TimeScale::Collision => "collision",
            TimeScale::Payload => "payload",
        };
        found.set_item("kind", kind)?;
        found.set_item("joint", &self.joints[contact.joint])?;
        found.set_item("residual_nm", contact.residual_nm)?;
        found.set_item("threshold_nm", contact.threshold_nm)
    }

    fn drift_into(&self, found: &Bound<'_, PyDict>, drift: DriftAlarm) -> PyResult<()> {
        found.set_item("kind", "drift")?;
        found.set_item("parameter", &self.parameters[drift.parameter])?;
        found.set_item("statistic", drift.statistic)?;
        found.set_item("threshold", drift.threshold)
    }
}

enum Mixed {
    Derivatives,
    Online(OnlineError),
}

impl From<OnlineError> for Mixed {
    fn from(error: OnlineError) -> Self {
        Self::Online(error)
    }
}

#[pymethods]
impl OnlineWatch {
    /// Adds a sample, ``(n,)``, or samples in the order of time, ``(..., n)``; returns the alarms that began in them.
    #[pyo3(signature = (q, tau, dq=None, ddq=None))]
    fn update<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        tau: &Bound<'py, PyAny>,
        dq: Option<&Bound<'py, PyAny>>,
        ddq: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let derivatives = match (dq, ddq) {
            (Some(dq), Some(ddq)) => Some([dq, ddq]),
            (None, None) => None,
            _ => return Err(Error::new_err("dq and ddq: give both or none")),
        };
        let before = self.own().alarms.len();
        let rate_hz = self.rate_hz;
        self.run(py, [q, tau], derivatives, |own, contact| {
            let delay = if own.with_derivatives == Some(true) { 0 } else { own.watch.delay_samples() as u64 };
            let time_s = (own.samples - 1).saturating_sub(delay) as f64 / rate_hz;
            if let Some(contact) = contact
                && own.now.is_none_or(|now| (now.look, now.joint) != (contact.look, contact.joint))
            {
                own.alarms.push(Alarm { time_s, what: What::Contact(contact) });
            }
            own.now = contact;
            if own.watch.drift_is_due()
                && let Some(drift) = own.watch.check_drift()?
            {
                if drift.is_raised() && !own.drift.is_some_and(|last| last.is_raised()) {
                    own.alarms.push(Alarm { time_s, what: What::Drift(drift) });
                }
                own.drift = Some(drift);
            }
            Ok(())
        })?;
        self.own().alarms[before..].iter().map(|alarm| self.described(py, alarm)).collect()
    }

    /// Determines the contact thresholds from motion without contact, at least ten times as long as the longest time
    /// constant: shapes ``(samples, n)``. The samples are also used for the estimate.
    #[pyo3(signature = (q, tau, dq=None, ddq=None))]
    fn calibrate(
        &self,
        py: Python<'_>,
        q: &Bound<'_, PyAny>,
        tau: &Bound<'_, PyAny>,
        dq: Option<&Bound<'_, PyAny>>,
        ddq: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let derivatives = match (dq, ddq) {
            (Some(dq), Some(ddq)) => Some([dq, ddq]),
            (None, None) => None,
            _ => return Err(Error::new_err("dq and ddq: give both or none")),
        };
        let mut residuals = Residuals { joints: vec![Vec::new(); self.joints.len()] };
        self.run(py, [q, tau], derivatives, |own, _| {
            // There are no residuals before the first window is full.
            if own.watch.estimator().samples() > 0 {
                for (all, residual) in residuals.joints.iter_mut().zip(own.watch.residuals_nm()) {
                    all.push(*residual);
                }
            }
            Ok(())
        })?;
        let mut own = self.own();
        own.watch.calibrate(&residuals).map_err(raised)?;
        own.now = None;
        Ok(())
    }

    /// Begins a new motion with the next sample.
    fn restart(&self) {
        let mut own = self.own();
        own.watch.restart();
        own.now = None;
    }

    /// All alarms, with the begin of each: dictionaries with ``time_s`` and ``kind``.
    #[getter]
    fn alarms<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let alarms = self.own().alarms.clone();
        alarms.iter().map(|alarm| self.described(py, alarm)).collect()
    }

    /// The current contact, or None.
    #[getter]
    fn contact<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(contact) = self.own().now else { return Ok(None) };
        let found = PyDict::new(py);
        self.contact_into(&found, contact)?;
        Ok(Some(found))
    }

    /// The last drift check, or None before the first.
    #[getter]
    fn drift<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(drift) = self.own().drift else { return Ok(None) };
        let found = PyDict::new(py);
        self.drift_into(&found, drift)?;
        Ok(Some(found))
    }

    /// Names of the base parameters.
    #[getter]
    fn names(&self) -> Vec<String> {
        self.parameters.clone()
    }

    /// The current base parameters; None while the samples do not determine them.
    #[getter]
    fn values<'py>(&self, py: Python<'py>) -> PyResult<Option<Array<'py>>> {
        let mut values = vec![0.0; self.parameters.len()];
        let known = self.own().watch.estimator().values(&mut values);
        known.then(|| array(py, &[values.len()], &[], values)).transpose()
    }

    /// Their covariance; None while the samples do not determine them.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Option<Array<'py>>> {
        let found = self.own().watch.estimator().covariance();
        // Symmetric, so columns and rows are equal.
        found.map(|matrix| array(py, &[matrix.nrows(), matrix.ncols()], &[], matrix.as_slice().to_vec())).transpose()
    }

    /// Physically consistent parameters of all bodies and friction: bodies ``(bodies, 10)``, and friction by symbol.
    fn consistent<'py>(&self, py: Python<'py>) -> PyResult<(Array<'py>, Bound<'py, PyDict>)> {
        // Release the interpreter lock, so that the holder of the monitor's lock never waits for it.
        let found = py.detach(|| {
            let own = self.own();
            let estimator = own.watch.estimator();
            let parameters = estimator.consistent(&ConsistencySettings::default())?.parameters;
            let symbols: Vec<String> = estimator.model().terms().iter().map(TorqueTerm::symbol).collect();
            Ok((parameters, symbols))
        });
        let (parameters, symbols) = found.map_err(raised)?;
        let (bodies, terms) = parameters.split_at(parameters.len() - symbols.len());
        let friction = PyDict::new(py);
        for (symbol, value) in symbols.iter().zip(terms) {
            friction.set_item(symbol, value)?;
        }
        Ok((array(py, &[bodies.len() / 10], &[10], bodies.to_vec())?, friction))
    }

    /// Thresholds of collision and payload, Nm (N), shape ``(n, 2)``.
    #[getter]
    fn thresholds_nm<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let thresholds = self.own().watch.contact().thresholds_nm().to_vec();
        array(py, &[thresholds.len()], &[2], thresholds.concat())
    }

    /// Residuals of the last sample, Nm (N), shape ``(n,)``.
    #[getter]
    fn residuals_nm<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let residuals = self.own().watch.residuals_nm().to_vec();
        array(py, &[residuals.len()], &[], residuals)
    }

    /// Number of samples.
    #[getter]
    fn samples(&self) -> u64 {
        self.own().samples
    }

    /// Delay of the results if derivatives are computed from positions, s.
    #[getter]
    fn delay_s(&self) -> f64 {
        self.own().watch.delay_samples() as f64 / self.rate_hz
    }

    fn __repr__(&self) -> String {
        let own = self.own();
        format!(
            "Watch({} joints at {} Hz, {} samples, {} alarms)",
            self.joints.len(),
            self.rate_hz,
            own.samples,
            own.alarms.len()
        )
    }
}
