//! Multisines with Schroeder's phases.

use super::error::{FamilyError, MAX_COUNT, require, require_frame};
use super::linear::{Basis, LinearFamily};
use super::polynomials::smooth_step;
use core::f64::consts::{PI, TAU};
use dynident_model::sample::Random;
use serde::{Deserialize, Serialize};

const NAME: &str = "multisine";

/// Settings of a [`Multisine`] family.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct MultisineSettings {
    /// Number of harmonics N. Default 20.
    pub harmonics: usize,
    /// Periods between the ramps. Default 1.
    pub periods: usize,
    /// Fade-in and fade-out time at each end, s; 0 selects the plain periodic multisine. Default 1.
    pub ramp_s: f64,
}

impl Default for MultisineSettings {
    fn default() -> Self {
        Self { harmonics: 20, periods: 1, ramp_s: 1.0 }
    }
}

impl MultisineSettings {
    /// Checks the settings for a duration (s).
    ///
    /// # Errors
    /// No harmonics or periods, more than 1000 of either, or ramps that leave no time between them.
    pub fn validate(&self, duration_s: f64) -> Result<(), FamilyError> {
        for (setting, value) in [("harmonics", self.harmonics), ("periods", self.periods)] {
            require((1..=MAX_COUNT).contains(&value), NAME, setting, value as f64, "give 1 to 1000")?;
        }
        require(
            (self.ramp_s == 0.0 || self.ramp_s >= 1e-3) && 2.0 * self.ramp_s < duration_s,
            NAME,
            "ramp_s",
            self.ramp_s,
            "give 0, or a millisecond or more and less than half of the duration",
        )
    }
}

/// q_j(t) = q0_j + A_j w(t) m(t + jP/n), m' = √(2/N) Σ_k cos(kωt + φ_k), with Schroeder's phases φ_k = -π k (k - 1)/N,
///
/// ω = 2π/P, P is the period between the ramps, n the number of joints. The velocity has a flat spectrum and a low
/// crest factor; A_j is its rms in rad/s (m/s). The joints are shifted in time relative to each other, because equal
/// motions of two joints would not distinguish their parameters.
///
/// The window w fades in and out over the ramps with three derivatives that are zero at both ends, so that both ends
/// are exactly at rest. Between the ramps whole periods are unchanged, for averaging. Parameters per joint: q0, A.
///
/// # Source
/// Schroeder, Synthesis of low-peak-factor signals, IEEE Trans. Information Theory 16(1), 1970; Pintelon and Schoukens,
/// System Identification (2012), section 5.
pub type Multisine = LinearFamily<MultisineBasis>;

/// Basis functions of a [`Multisine`] family.
#[derive(Clone, Debug)]
pub struct MultisineBasis {
    settings: MultisineSettings,
    joints: usize,
    duration_s: f64,
    period_s: f64,
}

impl Multisine {
    /// Creates the family for a number of joints and a duration (s).
    ///
    /// # Errors
    /// Invalid settings; see [`MultisineSettings::validate`].
    pub fn new(joints: usize, duration_s: f64, settings: &MultisineSettings) -> Result<Self, FamilyError> {
        require_frame(NAME, joints, duration_s)?;
        settings.validate(duration_s)?;
        let period_s = (duration_s - 2.0 * settings.ramp_s) / settings.periods as f64;
        Ok(Self::of(MultisineBasis { settings: settings.clone(), joints, duration_s, period_s }, joints, duration_s))
    }
}

impl MultisineBasis {
    fn wave(&self, time_s: f64) -> [f64; 4] {
        let count = self.settings.harmonics as f64;
        let turn = (time_s / self.period_s).rem_euclid(1.0);
        let scale = (2.0 / count).sqrt();
        let mut sum = [0.0; 4];
        for k in 1..=self.settings.harmonics {
            let k = k as f64;
            let speed = TAU * k / self.period_s;
            let (sin, cos) = (TAU * k * turn - PI * k * (k - 1.0) / count).sin_cos();
            for (sum, term) in sum.iter_mut().zip([sin / speed, cos, -speed * sin, -speed * speed * cos]) {
                *sum += scale * term;
            }
        }
        sum
    }

    fn fade(&self, time_s: f64) -> [f64; 4] {
        let ramp = self.settings.ramp_s;
        let (edge, sign) =
            if time_s < 0.5 * self.duration_s { (time_s, 1.0) } else { (self.duration_s - time_s, -1.0) };
        if edge >= ramp {
            return [1.0, 0.0, 0.0, 0.0];
        }
        let step = smooth_step(edge / ramp);
        [step[0], sign * step[1] / ramp, step[2] / ramp.powi(2), sign * step[3] / ramp.powi(3)]
    }
}

impl Basis for MultisineBasis {
    const NAME: &'static str = NAME;

    fn columns(&self) -> usize {
        2
    }

    fn differs_by_joint(&self) -> bool {
        true
    }

    fn row(&self, joint: usize, time_s: f64, out: &mut [[f64; 4]]) {
        out[0] = [1.0, 0.0, 0.0, 0.0];
        let wave = self.wave(time_s - self.settings.ramp_s + self.period_s * joint as f64 / self.joints as f64);
        let fade = self.fade(time_s);
        out[1] = [
            fade[0] * wave[0],
            fade[0] * wave[1] + fade[1] * wave[0],
            fade[0] * wave[2] + 2.0 * fade[1] * wave[1] + fade[2] * wave[0],
            fade[0] * wave[3] + 3.0 * fade[1] * wave[2] + 3.0 * fade[2] * wave[1] + fade[3] * wave[0],
        ];
    }

    fn standing(&self) -> Vec<f64> {
        vec![1.0, 0.0]
    }

    fn shape(&self, random: &mut Random) -> Vec<f64> {
        vec![0.0, if random.bits() & 1 == 0 { 1.0 } else { -1.0 }]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Motion;
    use crate::families::check;
    use crate::family::Family;
    use proptest::prelude::*;

    /// The rms of the velocity over a period is A. The crest factor of Schroeder's phases is below 2; equal phases
    /// would result in √(2N) = 6.3.
    #[test]
    fn rms_and_crest() {
        let settings = MultisineSettings { harmonics: 20, periods: 1, ramp_s: 0.0 };
        let family = Multisine::new(3, 5.0, &settings).unwrap();
        let parameters = [0.1, 0.7, 0.0, 0.7, -0.4, 0.7];
        let times: Vec<f64> = (0..4000).map(|s| f64::from(s) * 5.0 / 4000.0).collect();
        let mut motion = Motion::default();
        family.motion(&parameters, &times, &mut motion);
        for joint in 0..3 {
            let speed = &motion.dq[motion.of(joint)];
            let rms = (speed.iter().map(|v| v * v).sum::<f64>() / 4000.0).sqrt();
            let peak = speed.iter().fold(0.0_f64, |peak, v| peak.max(v.abs()));
            // Equal steps sum a trigonometric polynomial exactly, up to rounding.
            assert!((rms - 0.7).abs() < 1e-12);
            assert!(peak / rms < 2.0, "crest {}", peak / rms);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]
        #[test]
        fn exact(seed in any::<u64>(), harmonics in 1_usize..12, periods in 1_usize..3, ramp_s in 0.5_f64..2.0) {
            let family = Multisine::new(3, 9.0, &MultisineSettings { harmonics, periods, ramp_s }).unwrap();
            check::derivatives(&family, seed);
            check::gradient(&family, seed);
            check::rest(&family, seed);
        }
    }
}
