//! Detection of contact from the residuals of the model.

use crate::error::{OnlineError, check, check_positive};
use serde::{Deserialize, Serialize};

/// Settings of contact detection.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactSettings {
    /// Sampling rate, Hz.
    pub rate_hz: f64,
    /// Time constant of the short exponential mean of the residual, which detects collisions, s.
    pub collision_s: f64,
    /// Time constant of the long exponential mean of the residual, which detects persistent forces (a payload or a
    /// hand), s.
    pub payload_s: f64,
    /// Allowed false alarms per hour, for all joints and both time scales together.
    pub false_alarms_per_hour: f64,
    /// Minimum duration of the calibration, divided by [`payload_s`](Self::payload_s). Shorter calibrations give
    /// inaccurate thresholds.
    pub min_calibration_ratio: f64,
}

impl ContactSettings {
    /// Default settings: time constant of 20 ms for collisions and 2 s for payloads, one false alarm in twenty hours,
    /// and a calibration of at least ten times the longer time constant.
    pub fn new(rate_hz: f64) -> Self {
        Self { rate_hz, collision_s: 0.02, payload_s: 2.0, false_alarms_per_hour: 0.05, min_calibration_ratio: 10.0 }
    }

    /// Checks the settings.
    ///
    /// # Errors
    /// A value that is not positive.
    pub fn validate(&self) -> Result<(), OnlineError> {
        check_positive("rate_hz", &[self.rate_hz])?;
        check_positive("collision_s", &[self.collision_s])?;
        check_positive("payload_s", &[self.payload_s])?;
        check_positive("false_alarms_per_hour", &[self.false_alarms_per_hour])?;
        check_positive("min_calibration_ratio", &[self.min_calibration_ratio])
    }
}

/// Residuals `τ − τ̂` of an undisturbed motion that was not used for the fit: one list per joint, one value per sample,
/// Nm (N).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Residuals {
    /// Residuals of each joint.
    pub joints: Vec<Vec<f64>>,
}

/// Which of the two means of the residual exceeded its threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum TimeScale {
    /// The mean with the short time constant.
    Collision,
    /// The mean with the long time constant.
    Payload,
}

/// A detected contact: a mean residual beyond its threshold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// The joint.
    pub joint: usize,
    /// Which mean of the residual exceeded its threshold.
    pub look: TimeScale,
    /// Mean residual of the joint, minus its level during undisturbed motion, Nm (N).
    pub residual_nm: f64,
    /// Threshold for the allowed false-alarm rate, Nm (N).
    pub threshold_nm: f64,
}

/// Detects contact from residuals.
///
/// Each joint's residual is filtered by two exponential means, a short and a long one. During undisturbed motion, each
/// mean has a standard deviation σ and crosses its level (its mean value) upwards ν₀ times per second. A Gaussian
/// process exceeds the level by a height h with the rate `ν₀ exp(−h²/2σ²)` per second (Rice, Bell System Technical
/// Journal 24 (1945) 46, 3.3). The threshold h is therefore
///
/// ```text
///     h = k σ √(2 ln(2 · 3600 ν₀ / f)),
/// ```
///
/// where f is the number of allowed false alarms per hour of this mean, for both signs together. Residuals have heavier
/// tails than Gaussian noise. The factor k ≥ 1 accounts for this: it is the ratio of the largest observed mean to the
/// largest mean that Rice's formula predicts for the duration of the calibration.
#[derive(Clone, Debug)]
pub struct ContactMonitor {
    settings: ContactSettings,
    /// Level and threshold of each joint, for the short and the long mean.
    levels: Vec<[f64; 2]>,
    thresholds: Vec<[f64; 2]>,
    means: Vec<[f64; 2]>,
}

/// State of a [`ContactMonitor`], for storage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ContactState {
    levels: Vec<[f64; 2]>,
    thresholds: Vec<[f64; 2]>,
    means: Vec<[f64; 2]>,
}

impl ContactMonitor {
    /// Creates a monitor and calibrates it with residuals of an undisturbed motion, preferably of the motion that will
    /// be monitored.
    ///
    /// # Errors
    /// Invalid settings; residuals that are too short, not finite, or zero.
    pub fn new(settings: ContactSettings, calibration: &Residuals) -> Result<Self, OnlineError> {
        settings.validate()?;
        let least = (settings.min_calibration_ratio * settings.payload_s * settings.rate_hz).ceil();
        let joints = calibration.joints.len();
        // The allowed false alarms are divided among the two means of all joints.
        let each = settings.false_alarms_per_hour / (2.0 * joints.max(1) as f64);
        let (mut levels, mut thresholds) = (Vec::new(), Vec::new());
        for residuals in &calibration.joints {
            check("residuals of a joint", residuals, residuals.len())?;
            if (residuals.len() as f64) < least {
                let fix = "give a longer recording (min_calibration_ratio payload time constants)";
                return Err(OnlineError::Number {
                    what: "samples of the calibration",
                    value: residuals.len() as f64,
                    fix,
                });
            }
            let time_constants = [settings.collision_s, settings.payload_s];
            let found = time_constants.map(|constant_s| MeanStatistics::new(residuals, constant_s, settings.rate_hz));
            levels.push(found.map(|one| one.level));
            let heights = found.map(|one| one.threshold(settings.rate_hz, residuals.len(), each));
            if let Some(&value) = heights.iter().find(|height| !(**height > 0.0 && height.is_finite())) {
                let fix = "give residuals of a recording with noise";
                return Err(OnlineError::Number { what: "threshold of a joint", value, fix });
            }
            thresholds.push(heights);
        }
        Ok(Self { means: levels.clone(), settings, levels, thresholds })
    }

    /// Creates a monitor whose thresholds follow from the accuracy of the model, without a calibration: `std_nm` is the
    /// standard deviation of each joint's residual (half width of its 95 % band divided by 1.96), `correlation_s` the
    /// correlation time of the residual, and `band_hz` the cut-off of the low-pass after which this deviation was
    /// measured, if any.
    ///
    /// Two kinds of residuals are considered, and the higher threshold is used. First, model errors: noise with
    /// standard deviation σ and the correlation `exp(−t/τ)`, filtered by an exponential mean of time constant T, has
    /// the variance `σ² τ/(τ + T)`. It crosses its level upwards `ν₀ = 1/(2π √(τ T))` times per second (Rice, as cited
    /// at [`ContactMonitor`], for a spectrum with two poles). Model errors change with the motion, so τ is the time
    /// scale of the motion (about one second), not that of the sensor noise; a larger τ gives higher thresholds.
    /// Second, white sensor noise: σ was measured after a low-pass of cut-off B, which removes noise that a mean with T
    /// below `1/(4 B)` still contains. If all of σ² were white noise, the mean would have the variance
    /// `σ² min(1/(4 T), rate/2)/B` and cross its level `rate acos(e^(−1/(T rate)))/2π` times per second. If undisturbed
    /// motion can be recorded, the thresholds of [`new`](Self::new) are more accurate.
    ///
    /// # Errors
    /// Invalid settings; deviations, a time or a cut-off that are not positive.
    pub fn from_band(
        settings: ContactSettings,
        std_nm: &[f64],
        correlation_s: f64,
        band_hz: Option<f64>,
    ) -> Result<Self, OnlineError> {
        settings.validate()?;
        check_positive("band_hz", band_hz.as_slice())?;
        check_positive("std_nm", std_nm)?;
        check_positive("correlation_s", &[correlation_s])?;
        let each = settings.false_alarms_per_hour / (2.0 * std_nm.len().max(1) as f64);
        let (time_constants, rate_hz) = ([settings.collision_s, settings.payload_s], settings.rate_hz);
        let of = |std: &f64| {
            time_constants.map(|constant_s| {
                let height =
                    |share: f64, crossings_hz: f64| share.sqrt() * rice_height(2.0 * 3600.0 * crossings_hz / each);
                let slow = height(
                    correlation_s / (correlation_s + constant_s),
                    1.0 / (core::f64::consts::TAU * (correlation_s * constant_s).sqrt()),
                );
                let white = band_hz.map_or(0.0, |band_hz| {
                    let kept = (-1.0 / (constant_s * rate_hz)).exp();
                    let share = (0.25 / constant_s).min(0.5 * rate_hz) / band_hz;
                    height(share, rate_hz * kept.acos() / core::f64::consts::TAU)
                });
                std * slow.max(white)
            })
        };
        let levels = vec![[0.0; 2]; std_nm.len()];
        Ok(Self { means: levels.clone(), thresholds: std_nm.iter().map(of).collect(), settings, levels })
    }

    /// Thresholds of each joint for the short mean (collision) and the long mean (payload), Nm (N).
    pub fn thresholds_nm(&self) -> &[[f64; 2]] {
        &self.thresholds
    }

    /// Processes the residuals of a sample, one per joint; returns the contact whose mean residual exceeds its
    /// threshold by the largest factor, if there is one. Does not allocate.
    ///
    /// # Errors
    /// A different number of residuals, or a value that is not finite; the state is then unchanged.
    pub fn add(&mut self, residuals: &[f64]) -> Result<Option<Contact>, OnlineError> {
        check("residuals", residuals, self.means.len())?;
        let gains = [self.settings.collision_s, self.settings.payload_s].map(|s| mean_gain(s, self.settings.rate_hz));
        let (mut strongest, mut most) = (None, 1.0);
        for (joint, residual) in residuals.iter().enumerate() {
            for (place, look) in [TimeScale::Collision, TimeScale::Payload].into_iter().enumerate() {
                let mean = &mut self.means[joint][place];
                *mean += gains[place] * (residual - *mean);
                let (off, threshold_nm) = (*mean - self.levels[joint][place], self.thresholds[joint][place]);
                if off.abs() > most * threshold_nm {
                    most = off.abs() / threshold_nm;
                    strongest = Some(Contact { joint, look, residual_nm: off, threshold_nm });
                }
            }
        }
        Ok(strongest)
    }

    /// The state, for storage.
    pub fn state(&self) -> ContactState {
        let Self { levels, thresholds, means, .. } = self;
        ContactState { levels: levels.clone(), thresholds: thresholds.clone(), means: means.clone() }
    }

    /// Continues from a stored state.
    ///
    /// # Errors
    /// A state of other joints, or values that are not finite.
    pub fn restore(&mut self, state: ContactState) -> Result<(), OnlineError> {
        let ContactState { levels, thresholds, means } = state;
        for (what, values) in [("stored levels", &levels), ("stored thresholds", &thresholds), ("stored means", &means)]
        {
            check(what, values.as_flattened(), 2 * self.means.len())?;
        }
        (self.levels, self.thresholds, self.means) = (levels, thresholds, means);
        Ok(())
    }

    /// Resets the exponential means before a new motion.
    pub fn restart(&mut self) {
        self.means.clone_from(&self.levels);
    }
}

/// Weight of a new sample in an exponential mean.
fn mean_gain(constant_s: f64, rate_hz: f64) -> f64 {
    1.0 - (-1.0 / (constant_s * rate_hz)).exp()
}

#[derive(Clone, Copy)]
struct MeanStatistics {
    level: f64,
    std: f64,
    /// Number of upward crossings of the level, and the largest distance from the level.
    crossings: usize,
    largest: f64,
}

impl MeanStatistics {
    fn new(residuals: &[f64], constant_s: f64, rate_hz: f64) -> Self {
        let mean_gain = mean_gain(constant_s, rate_hz);
        // The initial transient is skipped.
        let skipped = ((3.0 * constant_s * rate_hz) as usize).min(residuals.len() / 2);
        let mut mean = residuals.first().copied().unwrap_or(0.0);
        let means: Vec<f64> = residuals
            .iter()
            .map(|residual| {
                mean += mean_gain * (residual - mean);
                mean
            })
            .skip(skipped)
            .collect();
        let count = means.len().max(1) as f64;
        let level = means.iter().sum::<f64>() / count;
        let std = (means.iter().map(|mean| (mean - level).powi(2)).sum::<f64>() / count).sqrt();
        let crossings = means.windows(2).filter(|pair| pair[0] <= level && pair[1] > level).count();
        let largest = means.iter().map(|mean| (mean - level).abs()).fold(0.0, f64::max);
        Self { level, std, crossings, largest }
    }

    fn threshold(&self, rate_hz: f64, samples: usize, per_hour: f64) -> f64 {
        let seen_s = samples as f64 / rate_hz;
        let crossings_hz = self.crossings.max(1) as f64 / seen_s;
        let expected = self.std * rice_height(2.0 * crossings_hz * seen_s);
        let heavier = (self.largest / expected).max(1.0);
        heavier * self.std * rice_height(2.0 * 3600.0 * crossings_hz / per_hour)
    }
}

/// Height, in standard deviations, that a Gaussian process exceeds once during this number of upward crossings of its
/// mean.
fn rice_height(crossings: f64) -> f64 {
    (2.0 * crossings.max(core::f64::consts::E).ln()).sqrt()
}
