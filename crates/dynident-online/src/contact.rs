//! What touches the robot, by what its model does not explain.

use crate::error::{OnlineError, check, check_positive};

/// How contact is looked for.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactSettings {
    /// Samples a second.
    pub rate_hz: f64,
    /// Time constant of the look for collisions, s.
    pub collision_s: f64,
    /// Time constant of the look for what stays, a payload or a hand, s.
    pub payload_s: f64,
    /// False alarms in an hour, all joints and both looks together.
    pub false_alarms_per_hour: f64,
}

impl ContactSettings {
    /// 20 ms and 2 s, one false alarm in twenty hours.
    pub fn new(rate_hz: f64) -> Self {
        Self { rate_hz, collision_s: 0.02, payload_s: 2.0, false_alarms_per_hour: 0.05 }
    }

    /// That the settings can be met.
    ///
    /// # Errors
    /// A number that is not positive.
    pub fn validate(&self) -> Result<(), OnlineError> {
        check_positive("rate_hz", &[self.rate_hz])?;
        check_positive("collision_s", &[self.collision_s])?;
        check_positive("payload_s", &[self.payload_s])?;
        check_positive("false_alarms_per_hour", &[self.false_alarms_per_hour])
    }
}

/// Residuals `τ − τ̂` of motion that nothing touched, on which the model was not fitted: one list for each joint, one
/// value for each sample, Nm (N).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Residuals {
    /// The joints'.
    pub joints: Vec<Vec<f64>>,
}

/// How a contact was seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// Over the short time constant.
    Collision,
    /// Over the long one.
    Payload,
}

/// A residual beyond its threshold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// The joint.
    pub joint: usize,
    /// By which look.
    pub look: Look,
    /// The residual's mean over the look's time constant, without what it is by itself, Nm (N).
    pub residual_nm: f64,
    /// What it would exceed by chance as often as was allowed, Nm (N).
    pub threshold_nm: f64,
}

/// Watches residuals for contact.
///
/// Each joint's residual goes through two exponential means. On motion that nothing touched each mean has a standard
/// deviation σ and crosses its own level upwards ν₀ times a second; a Gaussian process exceeds a height h upwards
/// `ν₀ exp(−h²/2σ²)` times a second (Rice, Bell System Technical Journal 24 (1945) 46, 3.3), so that
///
/// ```text
///     h = k σ √(2 ln(2 · 3600 ν₀ / f)),
/// ```
///
/// with f the false alarms an hour that fall to this mean, has them on both sides together. Residuals have heavier
/// tails than that: k is how far the largest mean seen stood beyond what Rice expects of the time that was seen, 1 at
/// least.
#[derive(Clone, Debug)]
pub struct ContactMonitor {
    settings: ContactSettings,
    /// For each joint, by look: its level, its threshold.
    levels: Vec<[f64; 2]>,
    thresholds: Vec<[f64; 2]>,
    means: Vec<[f64; 2]>,
}

impl ContactMonitor {
    /// A monitor for joints with these residuals: half a minute at least, better the motion that will be watched.
    ///
    /// # Errors
    /// Settings that cannot be met; residuals that are too few, not numbers, or zero.
    pub fn new(settings: ContactSettings, calibration: &Residuals) -> Result<Self, OnlineError> {
        settings.validate()?;
        let least = (10.0 * settings.payload_s * settings.rate_hz).ceil();
        let joints = calibration.joints.len();
        // Two looks at each joint share what is allowed.
        let each = settings.false_alarms_per_hour / (2.0 * joints.max(1) as f64);
        let (mut levels, mut thresholds) = (Vec::new(), Vec::new());
        for residuals in &calibration.joints {
            check("residuals of a joint", residuals, residuals.len())?;
            if (residuals.len() as f64) < least {
                let fix = "give at least ten times the longest time constant";
                return Err(OnlineError::Number {
                    what: "samples of the calibration",
                    value: residuals.len() as f64,
                    fix,
                });
            }
            let looks = [settings.collision_s, settings.payload_s];
            let found = looks.map(|constant_s| Watched::new(residuals, constant_s, settings.rate_hz));
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

    /// A monitor by what a model says of itself: `std_nm`, the standard deviation of each joint's residual (half the
    /// width of its 95 % band over 1.96), the time over which residuals forget themselves, and the cut-off `band_hz` of
    /// the filter behind which they were measured, if there was one.
    ///
    /// Noise with a correlation `exp(−t/τ)` through a mean of time constant T has the variance `σ² τ/(τ + T)` and
    /// crosses its level upwards `ν₀ = 1/(2π √(τ T))` times a second (Rice, as above, of a spectrum of two poles). What
    /// a model does not explain goes with the motion, so that τ is that of the motion, a second or so, and not that of
    /// the sensors' noise: the longer, the higher the thresholds. A filter of cut-off B hides noise that a mean of less
    /// than `1/(4 B)` lets through. If all of σ² were white it would be `σ² min(1/(4 T), rate/2)/B` in the mean, of
    /// which samples cross their level `rate acos(e^(−1/(T rate)))/2π` times a second; whichever threshold is higher
    /// holds. Where undisturbed motion can be recorded, thresholds by [`new`](Self::new) are better.
    ///
    /// # Errors
    /// Settings that cannot be met; deviations, a time or a cut-off that are not positive.
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
        let (looks, rate_hz) = ([settings.collision_s, settings.payload_s], settings.rate_hz);
        let of = |std: &f64| {
            looks.map(|constant_s| {
                let height = |share: f64, crossings_hz: f64| share.sqrt() * rice(2.0 * 3600.0 * crossings_hz / each);
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

    /// For each joint its thresholds, of collision and of payload, Nm (N).
    pub fn thresholds_nm(&self) -> &[[f64; 2]] {
        &self.thresholds
    }

    /// Takes the residuals of a sample, one for each joint; gives the contact that stands out most, if any. Allocates
    /// nothing.
    ///
    /// # Errors
    /// Residuals of another number than the joints', or that are no numbers: nothing has changed then.
    pub fn add(&mut self, residuals: &[f64]) -> Result<Option<Contact>, OnlineError> {
        check("residuals", residuals, self.means.len())?;
        let gains = [self.settings.collision_s, self.settings.payload_s].map(|s| gain(s, self.settings.rate_hz));
        let (mut strongest, mut most) = (None, 1.0);
        for (joint, residual) in residuals.iter().enumerate() {
            for (place, look) in [Look::Collision, Look::Payload].into_iter().enumerate() {
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

    /// Forgets what was seen: the next sample begins a motion.
    pub fn restart(&mut self) {
        self.means.clone_from(&self.levels);
    }
}

/// What a sample counts in an exponential mean.
fn gain(constant_s: f64, rate_hz: f64) -> f64 {
    1.0 - (-1.0 / (constant_s * rate_hz)).exp()
}

/// One mean on motion that nothing touched.
#[derive(Clone, Copy)]
struct Watched {
    level: f64,
    std: f64,
    /// Upwards through the level, and the largest distance from it.
    crossings: usize,
    largest: f64,
}

impl Watched {
    fn new(residuals: &[f64], constant_s: f64, rate_hz: f64) -> Self {
        let gain = gain(constant_s, rate_hz);
        // The first time constants hold the start.
        let skipped = ((3.0 * constant_s * rate_hz) as usize).min(residuals.len() / 2);
        let mut mean = residuals.first().copied().unwrap_or(0.0);
        let means: Vec<f64> = residuals
            .iter()
            .map(|residual| {
                mean += gain * (residual - mean);
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
        let expected = self.std * rice(2.0 * crossings_hz * seen_s);
        let heavier = (self.largest / expected).max(1.0);
        heavier * self.std * rice(2.0 * 3600.0 * crossings_hz / per_hour)
    }
}

/// The height, in standard deviations, that a Gaussian process exceeds once in so many crossings of its level.
fn rice(crossings: f64) -> f64 {
    (2.0 * crossings.max(core::f64::consts::E).ln()).sqrt()
}
