//! Simulated sensors.

use crate::error::{SimulationError, require};
use crate::per_joint::PerJoint;
use dynident_model::sample::Random;
use serde::{Deserialize, Serialize};

/// Source of the controller's velocities.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum VelocitySource {
    /// The true velocities.
    #[default]
    True,
    /// Differences of the measured positions between samples, with a first-order low-pass filter.
    Differences {
        /// Cut-off frequency of the filter, Hz.
        cutoff_hz: f64,
    },
}

/// Sensors of a robot and of its log. The default is perfect: no noise, no quantisation, no delay, recorded at the
/// controller's rate.
///
/// ```
/// use dynident_simulation::SensorSettings;
/// let settings: SensorSettings = toml::from_str("encoder_steps = 131072\ntorque_std = 0.05\nseed = 3").unwrap();
/// assert_eq!(settings.position_std, 0.0.into());
/// settings.validate(6)?;
/// # Ok::<(), dynident_simulation::SimulationError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct SensorSettings {
    /// Encoder steps per turn of the joint (per metre). Default none: not quantised.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub encoder_steps: Option<PerJoint>,
    /// Standard deviation of the white noise of positions, rad (m), before quantisation. Default 0.
    pub position_std: PerJoint,
    /// Standard deviation of the noise of recorded torques, Nm (N). Default 0.
    pub torque_std: PerJoint,
    /// Correlation of the torque noise of consecutive recorded samples (first-order autoregression); default 0, white
    /// noise.
    pub torque_correlation: f64,
    /// Quantisation step of recorded torques, Nm (N). Default none: not quantised.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_step: Option<PerJoint>,
    /// Source of the controller's velocities. Default true velocities.
    pub speed: VelocitySource,
    /// Delay of the controller's positions and velocities, samples. Default 0.
    pub feedback_delay_samples: usize,
    /// Rate of the record, Hz. Default the controller's rate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub record_rate_hz: Option<f64>,
    /// Standard deviation of the sampling instants of the record (jitter) relative to its clock, s. Default 0.
    pub jitter_std_s: f64,
    /// Delay of recorded positions, s. Default 0.
    pub position_delay_s: PerJoint,
    /// Delay of recorded torques, s. Default 0.
    pub torque_delay_s: PerJoint,
    /// Clock drift of the record, parts per million: sample `k` is taken at `k/rate · (1 + 1e-6 · drift)`. Default 0.
    pub clock_drift_ppm: f64,
    /// Seed of all noise. Default 1.
    pub seed: u64,
}

impl Default for SensorSettings {
    fn default() -> Self {
        Self {
            encoder_steps: None,
            position_std: 0.0.into(),
            torque_std: 0.0.into(),
            torque_correlation: 0.0,
            torque_step: None,
            speed: VelocitySource::True,
            feedback_delay_samples: 0,
            record_rate_hz: None,
            jitter_std_s: 0.0,
            position_delay_s: 0.0.into(),
            torque_delay_s: 0.0.into(),
            clock_drift_ppm: 0.0,
            seed: 1,
        }
    }
}

impl SensorSettings {
    /// Standard noise of BIRDy's protocol: positions 1e-3 degrees, torques 0.05 Nm, recorded at 1 kHz (Leboutet et al.,
    /// Applied Sciences 11 (2021) 4303).
    pub fn birdy_standard(seed: u64) -> Self {
        Self {
            position_std: 1e-3_f64.to_radians().into(),
            torque_std: 0.05.into(),
            record_rate_hz: Some(1000.0),
            seed,
            ..Self::default()
        }
    }

    /// Checks the settings for a number of joints.
    ///
    /// # Errors
    /// Values that are negative or not finite, lists of the wrong length, steps that are not positive, a correlation
    /// outside [0, 1), delays above 10 s or 1000 samples, a drift of more than 10 %.
    pub fn validate(&self, joints: usize) -> Result<(), SimulationError> {
        let none_or_more = "give zero or a finite positive number";
        for (what, values) in [("position_std", &self.position_std), ("torque_std", &self.torque_std)] {
            values.gains(what, joints)?;
        }
        for (what, values) in [("position_delay_s", &self.position_delay_s), ("torque_delay_s", &self.torque_delay_s)] {
            values.values(what, joints, "give 0 to 10 s", |x| (0.0..=10.0).contains(&x))?;
        }
        for (what, values) in [("encoder_steps", &self.encoder_steps), ("torque_step", &self.torque_step)] {
            if let Some(values) = values {
                values.values(what, joints, "give a finite positive number", |x| x > 0.0 && x.is_finite())?;
            }
        }
        let fix = "give 0 or more, below 1";
        require((0.0..1.0).contains(&self.torque_correlation), "torque_correlation", self.torque_correlation, fix)?;
        if let VelocitySource::Differences { cutoff_hz } = self.speed {
            require(cutoff_hz > 0.0 && cutoff_hz.is_finite(), "speed.cutoff_hz", cutoff_hz, "give a positive cut-off")?;
        }
        let delay = self.feedback_delay_samples;
        require(delay <= 1000, "feedback_delay_samples", delay as f64, "give at most 1000")?;
        if let Some(rate) = self.record_rate_hz {
            require((1e-3..=1e6).contains(&rate), "record_rate_hz", rate, "give 0.001 to 1e6 samples a second")?;
        }
        require((0.0..=1.0).contains(&self.jitter_std_s), "jitter_std_s", self.jitter_std_s, none_or_more)?;
        let drift = self.clock_drift_ppm;
        require(drift.abs() <= 1e5, "clock_drift_ppm", drift, "give -100000 to 100000")
    }

    /// Whether the controller measures the true state.
    pub(crate) fn are_perfect(&self, joints: usize) -> bool {
        self.encoder_steps.is_none()
            && (0..joints).all(|joint| self.position_std.of(joint) == 0.0)
            && self.speed == VelocitySource::True
            && self.feedback_delay_samples == 0
    }

    #[inline]
    pub(crate) fn position(&self, joint: usize, q: f64, is_rotary: bool, random: &mut Random) -> f64 {
        let std = self.position_std.of(joint);
        let q = if std > 0.0 { q + std * random.normal() } else { q };
        match &self.encoder_steps {
            Some(steps) => {
                let step = if is_rotary { core::f64::consts::TAU } else { 1.0 } / steps.of(joint);
                (q / step).round() * step
            }
            None => q,
        }
    }
}
