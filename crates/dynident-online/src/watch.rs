//! Complete monitoring of one robot, from measurements to alarms.

use crate::contact::{Contact, ContactMonitor, ContactSettings, ContactState, Residuals};
use crate::derivatives::{DelayedDerivatives, DelayedSample, DerivativesState};
use crate::drift::{DriftAlarm, DriftMonitor, DriftSettings};
use crate::error::{OnlineError, check, check_positive};
use crate::estimator::{EstimatorState, OnlineEstimator, OnlineSettings, StartingPoint};
use dynident_identification::RegressorModel;
use serde::{Deserialize, Serialize};

/// Settings of the monitoring.
#[derive(Clone, Debug, PartialEq)]
pub struct WatchSettings {
    /// Settings of contact detection, including the sampling rate.
    pub contact: ContactSettings,
    /// Half-life of samples in the recursive estimate, s. `None` disables forgetting and drift detection; the estimate
    /// then starts from the reference.
    pub half_life_s: Option<f64>,
    /// Correlation time of the residuals, s; see [`ContactMonitor::from_band`].
    pub correlation_s: f64,
    /// Cut-off of the low-pass after which the standard deviations of the residuals were measured, Hz; `None` without a
    /// low-pass.
    pub band_hz: Option<f64>,
    /// Number of samples before and after the middle of the derivative window; see [`DelayedDerivatives`].
    pub half_window: usize,
    /// Allowed false drift alarms per hour.
    pub drift_alarms_per_hour: f64,
    /// Time between drift checks, in half-lives of the recursive estimate. With the default of 4, successive checks are
    /// nearly independent.
    pub drift_check_half_lives: f64,
}

impl WatchSettings {
    /// Default settings: half-life of 15 s with a drift check every minute, correlation time of 1 s, derivative windows
    /// of 21 samples, one false contact alarm in twenty hours and one false drift alarm in ten hours.
    pub fn new(rate_hz: f64) -> Self {
        Self {
            contact: ContactSettings::new(rate_hz),
            half_life_s: Some(15.0),
            correlation_s: 1.0,
            band_hz: None,
            half_window: 10,
            drift_alarms_per_hour: 0.1,
            drift_check_half_lives: 4.0,
        }
    }
}

/// Monitoring of a robot: estimate, contact and drift from a stream of samples.
///
/// ```
/// use dynident_dynamics::ParametricModel;
/// use dynident_model::terms::{DriveChoice, terms_per_joint};
/// use dynident_online::{StartingPoint, Watch, WatchSettings};
/// use nalgebra::DMatrix;
/// # let text = r#"<robot name="pendulum"><link name="base"/><link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
/// #   <inertia ixx="0.2" iyy="0.2" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
/// #   <joint name="hinge" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint></robot>"#;
/// let model = dynident_model::read_urdf(text)?.model;
/// let friction = terms_per_joint(&model, |_| DriveChoice { viscous: true, ..DriveChoice::default() });
/// let pendulum = ParametricModel::new(model, friction)?;
/// // An identified estimate with its covariance; the residual has a standard deviation of 0.1 Nm.
/// let values = pendulum.nominal_base().unwrap().to_vec();
/// let reference = StartingPoint { covariance: DMatrix::identity(4, 4) * 1e-4, values };
/// let mut watch = Watch::new(pendulum, reference, &[0.1], &WatchSettings::new(500.0))?;
/// // Control loop, without allocation. The pendulum hangs; a hand pushes with 2 Nm from 1 s on.
/// let mut seen_s = None;
/// for sample in 0..1000 {
///     let time_s = f64::from(sample) / 500.0;
///     let push_nm = if time_s < 1.0 { 0.0 } else { 2.0 };
///     if let Some(contact) = watch.add(&[0.0], &[0.0], &[0.0], &[push_nm])? {
///         assert_eq!(contact.joint, 0);
///         seen_s.get_or_insert(time_s);
///     }
/// }
/// assert!((1.0..1.1).contains(&seen_s.unwrap()));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Watch {
    estimator: OnlineEstimator,
    reference: Vec<f64>,
    contact: ContactMonitor,
    contact_settings: ContactSettings,
    drift: Option<DriftMonitor>,
    derivatives: DelayedDerivatives,
    samples_to_check: u64,
    next_check: u64,
    residuals: Vec<f64>,
}

/// State of a [`Watch`], for storage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WatchState {
    estimator: EstimatorState,
    contact: ContactState,
    drift: Vec<f64>,
    derivatives: DerivativesState,
    next_check: u64,
    residuals: Vec<f64>,
}

impl Watch {
    /// Creates a monitor for a robot model: `reference` is an estimate of the base parameters with covariance, `std_nm`
    /// the standard deviation of each joint's residual. The contact thresholds are those of
    /// [`ContactMonitor::from_band`] until [`calibrate`](Self::calibrate) is called.
    ///
    /// # Errors
    /// Invalid settings, or a reference that does not match the robot.
    pub fn new(
        model: impl Into<RegressorModel>,
        reference: StartingPoint,
        std_nm: &[f64],
        settings: &WatchSettings,
    ) -> Result<Self, OnlineError> {
        let rate_hz = settings.contact.rate_hz;
        let contact =
            ContactMonitor::from_band(settings.contact.clone(), std_nm, settings.correlation_s, settings.band_hz)?;
        check_positive("half_life_s", settings.half_life_s.as_slice())?;
        check_positive("drift_check_half_lives", &[settings.drift_check_half_lives])?;
        let online = OnlineSettings {
            half_life_samples: settings.half_life_s.map(|half| half * rate_hz),
            // The larger number of the two: for noise with the correlation e^(-t/τ), and for white noise up to the
            // filter's cut-off.
            samples_per_independent: (2.0 * settings.correlation_s * rate_hz)
                .max(settings.band_hz.map_or(1.0, |band_hz| 0.5 * rate_hz / band_hz))
                .max(1.0),
            ..OnlineSettings::new(std_nm.to_vec())
        };
        // An estimate with forgetting is compared with the reference, so it must not start from the reference.
        let start = settings.half_life_s.is_none().then_some(&reference);
        let estimator = OnlineEstimator::new(model, online, start)?;
        let columns = estimator.factor().columns();
        if reference.values.len() != columns {
            let found = reference.values.len();
            return Err(OnlineError::Length { what: "values of the reference", expected: columns, found });
        }
        let check_s = settings.half_life_s.map(|half| settings.drift_check_half_lives * half);
        let values = reference.values.clone();
        let drift = |check_s| {
            let false_alarms_per_hour = settings.drift_alarms_per_hour;
            let settings = DriftSettings { false_alarms_per_hour, ..DriftSettings::new(check_s) };
            DriftMonitor::new(settings, reference)
        };
        let samples_to_check = check_s.map_or(u64::MAX, |check_s| (check_s * rate_hz).ceil() as u64);
        Ok(Self {
            derivatives: DelayedDerivatives::new(std_nm.len(), rate_hz, settings.half_window)?,
            residuals: vec![0.0; std_nm.len()],
            drift: check_s.map(drift).transpose()?,
            // An earlier first check would still depend on the initial estimate.
            next_check: samples_to_check.saturating_mul(2),
            contact_settings: settings.contact.clone(),
            reference: values,
            samples_to_check,
            estimator,
            contact,
        })
    }

    /// Adds a sample with its derivatives; returns the contact that exceeds its threshold by the largest factor, if
    /// there is one. Does not allocate memory.
    ///
    /// # Errors
    /// As [`OnlineEstimator::add`]; the state is then unchanged.
    pub fn add(&mut self, q: &[f64], dq: &[f64], ddq: &[f64], tau: &[f64]) -> Result<Option<Contact>, OnlineError> {
        let Self { estimator, reference, residuals, contact, .. } = self;
        add_sample(estimator, reference, residuals, contact, [q, dq, ddq, tau])
    }

    /// Adds measured positions and torques. Velocities and accelerations are computed by [`DelayedDerivatives`], so the
    /// result applies to the middle of their window. Does not allocate memory.
    ///
    /// # Errors
    /// As [`add`](Self::add).
    pub fn add_measured(&mut self, q: &[f64], tau: &[f64]) -> Result<Option<Contact>, OnlineError> {
        let Self { derivatives, estimator, reference, residuals, contact, .. } = self;
        let Some(DelayedSample { q, dq, ddq, tau }) = derivatives.add(q, tau)? else { return Ok(None) };
        add_sample(estimator, reference, residuals, contact, [q, dq, ddq, tau])
    }

    /// As [`add_measured`](Self::add_measured), for a sample that was measured `step_s` seconds after the previous one
    /// on the robot's clock. Lost samples then do not cause contact alarms. After a long pause there is no result until
    /// the window contains only samples after the pause, and friction with hysteresis is reset.
    ///
    /// # Errors
    /// As [`add`](Self::add), and a step that is not positive.
    pub fn add_measured_at(&mut self, step_s: f64, q: &[f64], tau: &[f64]) -> Result<Option<Contact>, OnlineError> {
        let Self { derivatives, estimator, reference, residuals, contact, contact_settings, .. } = self;
        let pause = step_s * contact_settings.rate_hz > derivatives.delay_samples() as f64;
        let found = derivatives.add_at(step_s, q, tau)?;
        if pause {
            estimator.restart();
        }
        let Some(DelayedSample { q, dq, ddq, tau }) = found else { return Ok(None) };
        add_sample(estimator, reference, residuals, contact, [q, dq, ddq, tau])
    }

    /// The state, for storage. After [`restore`](Self::restore), all results are identical, bit by bit.
    pub fn state(&self) -> WatchState {
        WatchState {
            estimator: self.estimator.state(),
            contact: self.contact.state(),
            drift: self.drift.as_ref().map(|drift| drift.statistics().to_vec()).unwrap_or_default(),
            derivatives: self.derivatives.state(),
            next_check: self.next_check,
            residuals: self.residuals.clone(),
        }
    }

    /// Continues from a stored state of a [`Watch`] with the same model and settings.
    ///
    /// # Errors
    /// A state of another model or other settings.
    pub fn restore(&mut self, state: WatchState) -> Result<(), OnlineError> {
        let WatchState { estimator, contact, drift, derivatives, next_check, residuals } = state;
        check("stored residuals", &residuals, self.residuals.len())?;
        self.estimator.restore(estimator)?;
        self.contact.restore(contact)?;
        self.derivatives.restore(derivatives)?;
        if let Some(own) = &mut self.drift {
            own.restore(drift)?;
        }
        (self.next_check, self.residuals) = (next_check, residuals);
        Ok(())
    }

    /// Whether [`check_drift`](Self::check_drift) is due.
    pub fn drift_is_due(&self) -> bool {
        self.drift.is_some() && self.estimator.samples() >= self.next_check
    }

    /// Checks for drift. The first eight checks learn the statistic without drift, under the assumption that the
    /// reference is correct. Returns `None` during these checks, and if no check is due. Needs a fraction of a
    /// millisecond for 64 parameters and allocates memory: do not call it in the control loop.
    ///
    /// # Errors
    /// As [`DriftMonitor::check`].
    pub fn check_drift(&mut self) -> Result<Option<DriftAlarm>, OnlineError> {
        if !self.drift_is_due() {
            return Ok(None);
        }
        self.next_check = self.estimator.samples() + self.samples_to_check;
        let Some(drift) = &mut self.drift else { return Ok(None) };
        if drift.is_ready() {
            return drift.check(&self.estimator);
        }
        drift.learn(&self.estimator)?;
        Ok(None)
    }

    /// Sets the contact thresholds from residuals of undisturbed motion; see [`ContactMonitor::new`].
    ///
    /// # Errors
    /// As [`ContactMonitor::new`], or residuals of a different number of joints.
    pub fn calibrate(&mut self, residuals: &Residuals) -> Result<(), OnlineError> {
        let (expected, found) = (self.residuals.len(), residuals.joints.len());
        if found != expected {
            return Err(OnlineError::Length { what: "residuals", expected, found });
        }
        self.contact = ContactMonitor::new(self.contact_settings.clone(), residuals)?;
        Ok(())
    }

    /// Starts a new motion with the next sample.
    pub fn restart(&mut self) {
        self.derivatives.restart();
        self.estimator.restart();
        self.contact.restart();
    }

    /// Residual of the last sample: measured torque minus the torque that the reference predicts, Nm (N).
    pub fn residuals_nm(&self) -> &[f64] {
        &self.residuals
    }

    /// The recursive estimator.
    pub fn estimator(&self) -> &OnlineEstimator {
        &self.estimator
    }

    /// The contact monitor.
    pub fn contact(&self) -> &ContactMonitor {
        &self.contact
    }

    /// Delay of the results of [`add_measured`](Self::add_measured), in samples.
    pub fn delay_samples(&self) -> usize {
        self.derivatives.delay_samples()
    }
}

/// Adds a sample to the estimator, and its residual to the contact monitor.
fn add_sample(
    estimator: &mut OnlineEstimator,
    reference: &[f64],
    residuals: &mut [f64],
    contact: &mut ContactMonitor,
    sample: [&[f64]; 4],
) -> Result<Option<Contact>, OnlineError> {
    let [q, dq, ddq, tau] = sample;
    estimator.add(q, dq, ddq, tau)?;
    estimator.torque(reference, residuals);
    for (residual, tau) in residuals.iter_mut().zip(tau) {
        *residual = tau - *residual;
    }
    contact.add(residuals)
}
