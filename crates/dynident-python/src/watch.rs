//! `Watch`: online monitoring of a robot, sample by sample or array by array.

use crate::arrays::{Samples, array};
use crate::callables::guarded;
use crate::errors::Error;
use crate::watch_settings::OnlineSettings;
use dynident::identification::consistent::ConsistencySettings;
use dynident::model::terms::TorqueTerm;
use dynident::online::{Contact, DriftAlarm, OnlineError, Residuals, TimeScale, Watch, WatchState};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

/// A function, and the model and state as its arguments.
type Reduced<'py> = (Bound<'py, PyAny>, (Py<PyAny>, String));

fn raised(error: OnlineError) -> PyErr {
    Error::new_err(error.to_string())
}

/// Online monitor of a robot, created by ``Model.online``.
///
/// ``update`` takes one sample or an array of samples; detected events are in ``alarms``. Without velocities and
/// accelerations these are computed from the positions, and results are delayed by ``delay_s``. Give ``time_s`` if
/// samples may be lost: otherwise a lost sample looks like a jump of the acceleration. A pickled monitor continues
/// with the same results.
///
/// >>> import dynident
/// >>> given = dynident.example()
/// >>> model = dynident.identify(given.robot, given.logs)
/// >>> watch, test = model.online(rate_hz=125.0), given.logs[1]
/// >>> for t, q, tau in zip(test.time_s, test.q, test.tau):
/// ...     for alarm in watch.update(q, tau, time_s=t):
/// ...         print(alarm["kind"])
/// >>> watch.contact is None
/// True
#[pyclass(frozen, module = "dynident", name = "Watch")]
pub(crate) struct OnlineWatch {
    own: Mutex<Watched>,
    /// The model that made the monitor.
    model: Py<PyAny>,
    settings: OnlineSettings,
    joints: Vec<String>,
    parameters: Vec<String>,
}

/// A monitor in storage.
#[derive(Serialize, Deserialize)]
struct StoredWatch {
    settings: OnlineSettings,
    watch: WatchState,
    progress: Progress,
}

struct Watched {
    watch: Watch,
    progress: Progress,
}

/// What the samples contain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Given {
    derivatives: bool,
    times: bool,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Progress {
    /// `None` before the first sample.
    given: Option<Given>,
    samples: u64,
    /// The newest time stamps, as many as the results are delayed, and the newest one.
    times_s: VecDeque<f64>,
    now: Option<Contact>,
    drift: Option<DriftAlarm>,
    alarms: Vec<Alarm>,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Alarm {
    time_s: f64,
    what: What,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
enum What {
    Contact(Contact),
    Drift(DriftAlarm),
}

/// Samples of a call: positions, torques, and what else is given.
struct Arrays<'a, 'py> {
    measured: [&'a Bound<'py, PyAny>; 2],
    derivatives: Option<[&'a Bound<'py, PyAny>; 2]>,
    times_s: Option<&'a Bound<'py, PyAny>>,
}

impl<'a, 'py> Arrays<'a, 'py> {
    fn of(
        [q, tau]: [&'a Bound<'py, PyAny>; 2],
        [dq, ddq]: [Option<&'a Bound<'py, PyAny>>; 2],
        times_s: Option<&'a Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let derivatives = match (dq, ddq) {
            (Some(dq), Some(ddq)) => Some([dq, ddq]),
            (None, None) => None,
            _ => return Err(Error::new_err("dq and ddq: give both or none")),
        };
        Ok(Self { measured: [q, tau], derivatives, times_s })
    }
}

/// A processed sample.
struct Seen {
    /// Whether it gave a result; there is none before the first window is full, and during a pause.
    has_result: bool,
    contact: Option<Contact>,
    /// Time of the result, s.
    time_s: f64,
}

impl OnlineWatch {
    /// Creates a monitor with the names for its alarms.
    pub(crate) fn new(watch: Watch, model: Py<PyAny>, joints: Vec<String>, settings: OnlineSettings) -> Self {
        let parameters = watch.estimator().model().base().expressions();
        let own = Mutex::new(Watched { watch, progress: Progress::default() });
        Self { own, model, settings, joints, parameters }
    }

    fn own(&self) -> MutexGuard<'_, Watched> {
        self.own.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Processes all samples and calls `look` after each.
    fn run(
        &self,
        py: Python<'_>,
        arrays: &Arrays<'_, '_>,
        mut look: impl FnMut(&mut Watched, Seen) -> Result<(), OnlineError> + Send,
    ) -> PyResult<()> {
        let dof = self.joints.len();
        let q = Samples::of(arrays.measured[0], "q", dof)?;
        let tau = Samples::of(arrays.measured[1], "tau", dof)?.like(&q, "tau")?;
        let derivatives = match arrays.derivatives {
            Some([dq, ddq]) => {
                Some([Samples::of(dq, "dq", dof)?.like(&q, "dq")?, Samples::of(ddq, "ddq", dof)?.like(&q, "ddq")?])
            }
            None => None,
        };
        let times_s = arrays.times_s.map(|times| Samples::values(times, "time_s", q.count())).transpose()?;
        let (q, tau) = (q.numbers(), tau.numbers());
        let derivatives = derivatives.as_ref().map(|both| both.each_ref().map(Samples::numbers));
        let (q, tau): (&[f64], &[f64]) = (&q, &tau);
        let derivatives = derivatives.as_ref().map(|[dq, ddq]| (&**dq, &**ddq));
        let rate_hz = self.settings.rate_hz;
        let work = move || {
            let mut own = self.own();
            let given = Given { derivatives: derivatives.is_some(), times: times_s.is_some() };
            let known = *own.progress.given.get_or_insert(given);
            if known.derivatives != given.derivatives {
                return Err(Mixed::Derivatives);
            }
            if known.times != given.times {
                return Err(Mixed::Times);
            }
            let delay = if given.derivatives { 0 } else { own.watch.delay_samples() };
            for (sample, at) in (0..q.len()).step_by(dof.max(1)).enumerate() {
                let row = at..at + dof;
                let (q, tau) = (&q[row.clone()], &tau[row.clone()]);
                let (before, last_s) = (own.watch.estimator().samples(), own.progress.times_s.back().copied());
                let stamp_s = times_s.as_ref().map(|times| times[sample]);
                let step_s = match (stamp_s, last_s) {
                    (Some(time_s), _) if !time_s.is_finite() => return Err(Mixed::Time { time_s, last_s }),
                    (Some(time_s), Some(last)) if time_s <= last => return Err(Mixed::Time { time_s, last_s }),
                    (Some(time_s), Some(last)) => time_s - last,
                    _ => 1.0 / rate_hz,
                };
                let contact = match derivatives {
                    Some((dq, ddq)) => own.watch.add(q, &dq[row.clone()], &ddq[row], tau)?,
                    None if stamp_s.is_some() => own.watch.add_measured_at(step_s, q, tau)?,
                    None => own.watch.add_measured(q, tau)?,
                };
                let has_result = own.watch.estimator().samples() > before;
                let progress = &mut own.progress;
                progress.samples += 1;
                let time_s = match stamp_s {
                    Some(time_s) => {
                        progress.times_s.push_back(time_s);
                        if progress.times_s.len() > delay + 1 {
                            progress.times_s.pop_front();
                        }
                        progress.times_s[0]
                    }
                    None => (progress.samples - 1).saturating_sub(delay as u64) as f64 / rate_hz,
                };
                look(&mut own, Seen { has_result, contact, time_s })?;
            }
            Ok(())
        };
        py.detach(|| guarded(work))?.map_err(|error| match error {
            Mixed::Derivatives => Error::new_err(
                "inconsistent samples: only some have velocities and accelerations; give \
                 them always or never",
            ),
            Mixed::Times => {
                Error::new_err("inconsistent samples: only some have time stamps; give time_s always or never")
            }
            Mixed::Time { time_s, last_s } => {
                let last = last_s.map_or_else(String::new, |last| format!(" after {last} s"));
                let fix = "give the times of measurement by the robot's clock, in ascending order; call restart() before \
                           a new recording";
                Error::new_err(format!("time_s: {time_s} s{last}: {fix}"))
            }
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
    Times,
    Time { time_s: f64, last_s: Option<f64> },
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
    /// ``time_s`` are the times of measurement by the robot's clock, one per sample: lost samples and pauses then raise
    /// no alarm, and alarms have these times. After a pause of more than half a window there are no results until the
    /// window is full again.
    #[pyo3(signature = (q, tau, dq=None, ddq=None, *, time_s=None))]
    fn update<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        tau: &Bound<'py, PyAny>,
        dq: Option<&Bound<'py, PyAny>>,
        ddq: Option<&Bound<'py, PyAny>>,
        time_s: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let before = self.own().progress.alarms.len();
        self.run(py, &Arrays::of([q, tau], [dq, ddq], time_s)?, |own, seen| {
            if !seen.has_result {
                return Ok(());
            }
            let progress = &mut own.progress;
            let Seen { contact, time_s, .. } = seen;
            if let Some(contact) = contact
                && progress.now.is_none_or(|now| (now.look, now.joint) != (contact.look, contact.joint))
            {
                progress.alarms.push(Alarm { time_s, what: What::Contact(contact) });
            }
            progress.now = contact;
            if own.watch.drift_is_due()
                && let Some(drift) = own.watch.check_drift()?
            {
                if drift.is_raised() && !progress.drift.is_some_and(|last| last.is_raised()) {
                    progress.alarms.push(Alarm { time_s, what: What::Drift(drift) });
                }
                progress.drift = Some(drift);
            }
            Ok(())
        })?;
        self.own().progress.alarms[before..].iter().map(|alarm| self.described(py, alarm)).collect()
    }

    /// Determines the contact thresholds from motion without contact, at least ten times as long as the longest time
    /// constant: shapes ``(samples, n)``. The samples are also used for the estimate. ``time_s`` as in ``update``.
    #[pyo3(signature = (q, tau, dq=None, ddq=None, *, time_s=None))]
    fn calibrate(
        &self,
        py: Python<'_>,
        q: &Bound<'_, PyAny>,
        tau: &Bound<'_, PyAny>,
        dq: Option<&Bound<'_, PyAny>>,
        ddq: Option<&Bound<'_, PyAny>>,
        time_s: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let mut residuals = Residuals { joints: vec![Vec::new(); self.joints.len()] };
        self.run(py, &Arrays::of([q, tau], [dq, ddq], time_s)?, |own, seen| {
            if seen.has_result {
                for (all, residual) in residuals.joints.iter_mut().zip(own.watch.residuals_nm()) {
                    all.push(*residual);
                }
            }
            Ok(())
        })?;
        let mut own = self.own();
        own.watch.calibrate(&residuals).map_err(raised)?;
        own.progress.now = None;
        Ok(())
    }

    /// Begins a new motion with the next sample, which may have any time stamp.
    fn restart(&self) {
        let mut own = self.own();
        own.watch.restart();
        own.progress.now = None;
        own.progress.times_s.clear();
    }

    /// The inverse of ``__reduce__``.
    #[staticmethod]
    fn _restore<'py>(model: &Bound<'py, PyAny>, state: &str) -> PyResult<Bound<'py, Self>> {
        let wrong = |error: &dyn core::fmt::Display| Error::new_err(format!("a stored monitor: {error}"));
        let StoredWatch { settings, watch, progress } = serde_json::from_str(state).map_err(|error| wrong(&error))?;
        let made = model.call_method1("online", settings.arguments())?.cast_into::<Self>()?;
        {
            let mut own = made.get().own();
            own.watch.restore(watch).map_err(|error| wrong(&error))?;
            own.progress = progress;
        }
        Ok(made)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Reduced<'py>> {
        let (py, own) = (slf.py(), slf.get());
        let stored = {
            let watched = own.own();
            let progress = watched.progress.clone();
            StoredWatch { settings: own.settings.clone(), watch: watched.watch.state(), progress }
        };
        let state = serde_json::to_string(&stored).map_err(|error| Error::new_err(error.to_string()))?;
        Ok((slf.get_type().getattr("_restore")?, (own.model.clone_ref(py), state)))
    }

    /// All alarms, with the begin of each: dictionaries with ``time_s`` and ``kind``.
    #[getter]
    fn alarms<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let alarms = self.own().progress.alarms.clone();
        alarms.iter().map(|alarm| self.described(py, alarm)).collect()
    }

    /// The current contact, or None.
    #[getter]
    fn contact<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(contact) = self.own().progress.now else { return Ok(None) };
        let found = PyDict::new(py);
        self.contact_into(&found, contact)?;
        Ok(Some(found))
    }

    /// The last drift check, or None before the first.
    #[getter]
    fn drift<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(drift) = self.own().progress.drift else { return Ok(None) };
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
        self.own().progress.samples
    }

    /// Delay of the results if derivatives are computed from positions, s.
    #[getter]
    fn delay_s(&self) -> f64 {
        self.own().watch.delay_samples() as f64 / self.settings.rate_hz
    }

    fn __repr__(&self) -> String {
        let own = self.own();
        format!(
            "Watch({} joints at {} Hz, {} samples, {} alarms)",
            self.joints.len(),
            self.settings.rate_hz,
            own.progress.samples,
            own.progress.alarms.len()
        )
    }
}
