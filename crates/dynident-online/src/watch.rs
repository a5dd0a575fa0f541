//! All of it around one robot: from what is measured to alarms.

use crate::contact::{Contact, ContactMonitor, ContactSettings, Residuals};
use crate::derivatives::{DelayedDerivatives, DelayedSample};
use crate::drift::{DriftAlarm, DriftMonitor, DriftSettings};
use crate::error::{OnlineError, check_positive};
use crate::estimator::{OnlineEstimator, OnlineSettings, StartingPoint};
use dynident_identification::RegressorModel;

/// Half-lives of the estimator from one check of drift to the next.
const CHECK_HALF_LIVES: f64 = 4.0;

/// How a robot is watched.
#[derive(Clone, Debug, PartialEq)]
pub struct WatchSettings {
    /// How contact is looked for, and the rate of samples.
    pub contact: ContactSettings,
    /// Half-life of samples in the estimate, s; none goes on with the reference for ever and looks for no drift.
    pub half_life_s: Option<f64>,
    /// Time over which residuals forget themselves, s: see [`ContactMonitor::from_band`].
    pub correlation_s: f64,
    /// Cut-off of the filter behind which the residuals' deviations were measured, Hz; none for samples as they come.
    pub band_hz: Option<f64>,
    /// Samples on each side of the one whose derivatives are taken: see [`DelayedDerivatives`].
    pub half_window: usize,
    /// False alarms of drift in an hour.
    pub drift_alarms_per_hour: f64,
}

impl WatchSettings {
    /// A half-life of 15 s, so that drift is looked for every minute; residuals that go with the motion, in a second;
    /// windows of 21 samples; one false alarm of contact in twenty hours and one of drift in ten.
    pub fn new(rate_hz: f64) -> Self {
        Self {
            contact: ContactSettings::new(rate_hz),
            half_life_s: Some(15.0),
            correlation_s: 1.0,
            band_hz: None,
            half_window: 10,
            drift_alarms_per_hour: 0.1,
        }
    }
}

/// A robot under watch: its estimate, contact and drift, from samples that come one by one.
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
/// // What an identification has found, with its covariance; the residual has 0.1 Nm.
/// let values = pendulum.nominal_base().unwrap().to_vec();
/// let reference = StartingPoint { covariance: DMatrix::identity(4, 4) * 1e-4, values };
/// let mut watch = Watch::new(pendulum, reference, &[0.1], &WatchSettings::new(500.0))?;
/// // In the loop that controls: nothing is allocated. The pendulum hangs; a hand pushes with 2 Nm from 1 s on.
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

impl Watch {
    /// A watch by a model: `reference` its base parameters with their covariance, `std_nm` the standard deviation of
    /// each joint's residual. Thresholds of contact are those of [`ContactMonitor::from_band`] until
    /// [`calibrate`](Self::calibrate).
    ///
    /// # Errors
    /// Settings that cannot be met, or a reference that is not the robot's.
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
        let online = OnlineSettings {
            half_life_samples: settings.half_life_s.map(|half| half * rate_hz),
            // Of noise with a correlation of e^(-t/τ), or white up to the filter's cut-off.
            samples_per_independent: (2.0 * settings.correlation_s * rate_hz)
                .max(settings.band_hz.map_or(1.0, |band_hz| 0.5 * rate_hz / band_hz))
                .max(1.0),
            ..OnlineSettings::new(std_nm.to_vec())
        };
        // An estimate that forgets is compared with the reference, and must not hold it.
        let start = settings.half_life_s.is_none().then_some(&reference);
        let estimator = OnlineEstimator::new(model, online, start)?;
        let columns = estimator.factor().columns();
        if reference.values.len() != columns {
            let found = reference.values.len();
            return Err(OnlineError::Length { what: "values of the reference", expected: columns, found });
        }
        let check_s = settings.half_life_s.map(|half| CHECK_HALF_LIVES * half);
        let values = reference.values.clone();
        let drift = |check_s| {
            let settings = DriftSettings { check_s, false_alarms_per_hour: settings.drift_alarms_per_hour };
            DriftMonitor::new(settings, reference)
        };
        let samples_to_check = check_s.map_or(u64::MAX, |check_s| (check_s * rate_hz).ceil() as u64);
        Ok(Self {
            derivatives: DelayedDerivatives::new(std_nm.len(), rate_hz, settings.half_window)?,
            residuals: vec![0.0; std_nm.len()],
            drift: check_s.map(drift).transpose()?,
            // The first one would still hold the start.
            next_check: samples_to_check.saturating_mul(2),
            contact_settings: settings.contact.clone(),
            reference: values,
            samples_to_check,
            estimator,
            contact,
        })
    }

    /// Takes a sample with its derivatives; gives the contact that stands out most, if any. Allocates nothing.
    ///
    /// # Errors
    /// As [`OnlineEstimator::add`]: nothing has changed then.
    pub fn add(&mut self, q: &[f64], dq: &[f64], ddq: &[f64], tau: &[f64]) -> Result<Option<Contact>, OnlineError> {
        let Self { estimator, reference, residuals, contact, .. } = self;
        look(estimator, reference, residuals, contact, [q, dq, ddq, tau])
    }

    /// Takes positions and torques as they were measured; velocities and accelerations are those of
    /// [`DelayedDerivatives`], and the answer is for the middle of their window. Allocates nothing.
    ///
    /// # Errors
    /// As [`add`](Self::add).
    pub fn add_measured(&mut self, q: &[f64], tau: &[f64]) -> Result<Option<Contact>, OnlineError> {
        let Self { derivatives, estimator, reference, residuals, contact, .. } = self;
        let Some(DelayedSample { q, dq, ddq, tau }) = derivatives.add(q, tau)? else { return Ok(None) };
        look(estimator, reference, residuals, contact, [q, dq, ddq, tau])
    }

    /// Whether it is time for [`check_drift`](Self::check_drift).
    pub fn drift_is_due(&self) -> bool {
        self.drift.is_some() && self.estimator.samples() >= self.next_check
    }

    /// Learns what is usual in the first eight checks, which hold that the reference is true of the robot, and compares
    /// with it later. None before, and where it is not time. Takes a fraction of a millisecond for 64 parameters and
    /// allocates: from another place than the loop that controls.
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

    /// Thresholds of contact by residuals of motion that nothing touched: see [`ContactMonitor::new`].
    ///
    /// # Errors
    /// As [`ContactMonitor::new`], or residuals of other joints.
    pub fn calibrate(&mut self, residuals: &Residuals) -> Result<(), OnlineError> {
        let (expected, found) = (self.residuals.len(), residuals.joints.len());
        if found != expected {
            return Err(OnlineError::Length { what: "residuals", expected, found });
        }
        self.contact = ContactMonitor::new(self.contact_settings.clone(), residuals)?;
        Ok(())
    }

    /// The next sample begins a motion.
    pub fn restart(&mut self) {
        self.derivatives.restart();
        self.estimator.restart();
        self.contact.restart();
    }

    /// The residual of the last sample, torque less what the reference explains, Nm (N).
    pub fn residuals_nm(&self) -> &[f64] {
        &self.residuals
    }

    /// The estimate.
    pub fn estimator(&self) -> &OnlineEstimator {
        &self.estimator
    }

    /// The monitor of contact.
    pub fn contact(&self) -> &ContactMonitor {
        &self.contact
    }

    /// By how many samples answers of [`add_measured`](Self::add_measured) are behind.
    pub fn delay_samples(&self) -> usize {
        self.derivatives.delay_samples()
    }
}

/// A sample for the estimate, and its residual by the reference for the monitor.
fn look(
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
