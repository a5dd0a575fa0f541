//! Finite Fourier series, periodic or exactly at rest at both ends.

use super::error::{FamilyError, MAX_COUNT, require, require_frame};
use super::linear::{Basis, LinearFamily};
use serde::{Deserialize, Serialize};

const NAME: &str = "fourier";

/// Settings of a [`Fourier`] family.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct FourierSettings {
    /// Number of harmonics H. Default 5.
    pub harmonics: usize,
    /// Whether both ends are exactly at rest (q̇ = q̈ = 0). Default true; false selects the plain periodic series.
    pub rest: bool,
    /// Number of periods within the duration. Default 1. Higher frequencies increase the information, so a long
    /// experiment is better with several periods.
    pub periods: usize,
}

impl Default for FourierSettings {
    fn default() -> Self {
        Self { harmonics: 5, rest: true, periods: 1 }
    }
}

impl FourierSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// No harmonics (with rest fewer than 2, which cannot move), no periods, or more than 1000 of either.
    pub fn validate(&self) -> Result<(), FamilyError> {
        let least = if self.rest { 2 } else { 1 };
        let fix = "give 1 to 1000, and at least 2 if the ends are at rest";
        require((least..=MAX_COUNT).contains(&self.harmonics), NAME, "harmonics", self.harmonics as f64, fix)?;
        require((1..=MAX_COUNT).contains(&self.periods), NAME, "periods", self.periods as f64, "give 1 to 1000")
    }
}

/// Finite Fourier series (Swevers et al., IEEE Trans. Robotics and Automation 13(5), 1997),
///
/// q(t) = q0 + Σ_k a_k/(kω) sin kωt + b_k/(kω) cos kωt, k = 1..H, ω = 2π · periods / duration,
///
/// a_k, b_k are amplitudes of velocity in rad/s (m/s). Eq. 24 of *Iterative Identification of Robot Dynamic
/// Parameters Based on Logistic Function* is the same series with coefficients in rad, here a_k/(kω) and b_k/(kω).
///
/// Rest at both ends means q̇(0) = Σ a_k = 0 and q̈(0) = -ω Σ k b_k = 0. An orthonormal basis of the null spaces
/// satisfies both, so that 2 H - 1 unconstrained parameters per joint remain: q0, then H - 1 for a, then H - 1 for b.
/// The periodic series has q0, a_1..a_H, b_1..b_H.
///
/// ```
/// use dynident_excitation::{Family, families::{Fourier, FourierSettings}};
/// let family = Fourier::new(6, 10.0, &FourierSettings::default())?;
/// assert_eq!(family.parameters(), 6 * 9);
/// # Ok::<(), dynident_excitation::families::FamilyError>(())
/// ```
pub type Fourier = LinearFamily<FourierBasis>;

/// Basis functions of a [`Fourier`] family.
#[derive(Clone, Debug)]
pub struct FourierBasis {
    harmonics: usize,
    omega: f64,
    /// Rows: free parameters for a (then for b); columns: harmonics. `None` for the periodic series.
    rest: Option<[Vec<Vec<f64>>; 2]>,
}

impl Fourier {
    /// Creates the family for a number of joints and a duration (s).
    ///
    /// # Errors
    /// Invalid settings; see [`FourierSettings::validate`].
    pub fn new(joints: usize, duration_s: f64, settings: &FourierSettings) -> Result<Self, FamilyError> {
        require_frame(NAME, joints, duration_s)?;
        settings.validate()?;
        let harmonics = settings.harmonics;
        let rest = settings.rest.then(|| {
            [null_space(&vec![1.0; harmonics]), null_space(&(1..=harmonics).map(|k| k as f64).collect::<Vec<_>>())]
        });
        let omega = core::f64::consts::TAU * settings.periods as f64 / duration_s;
        Ok(Self::of(FourierBasis { harmonics, omega, rest }, joints, duration_s))
    }

    /// Coefficients of one joint, `[a_k, b_k]` in rad/s (m/s) for k = 1..H, for the parameters of all joints.
    ///
    /// # Panics
    /// If the joint does not exist or there are too few parameters.
    pub fn coefficients(&self, parameters: &[f64], joint: usize) -> Vec<[f64; 2]> {
        let basis = self.basis();
        let own = &parameters[joint * basis.columns()..(joint + 1) * basis.columns()];
        let (sine, cosine) = own[1..].split_at((own.len() - 1) / 2);
        match &basis.rest {
            None => sine.iter().zip(cosine).map(|(a, b)| [*a, *b]).collect(),
            Some(spaces) => (0..basis.harmonics)
                .map(|k| {
                    [(&spaces[0], sine), (&spaces[1], cosine)]
                        .map(|(space, free)| space.iter().zip(free).map(|(row, weight)| row[k] * weight).sum())
                })
                .collect(),
        }
    }
}

impl Basis for FourierBasis {
    const NAME: &'static str = NAME;

    fn columns(&self) -> usize {
        if self.rest.is_some() { 2 * self.harmonics - 1 } else { 2 * self.harmonics + 1 }
    }

    fn row(&self, _joint: usize, time_s: f64, out: &mut [[f64; 4]]) {
        out[0] = [1.0, 0.0, 0.0, 0.0];
        let half = (out.len() - 1) / 2;
        for k in 1..=self.harmonics {
            let speed = k as f64 * self.omega;
            // Reduced to one turn, so that both ends have the same angle and are exactly at rest.
            let is_rotary = (time_s * speed / core::f64::consts::TAU).fract();
            let (sin, cos) = (is_rotary * core::f64::consts::TAU).sin_cos();
            let sine = [sin / speed, cos, -speed * sin, -speed * speed * cos];
            let cosine = [cos / speed, -sin, -speed * cos, speed * speed * sin];
            match &self.rest {
                None => (out[k], out[half + k]) = (sine, cosine),
                Some([for_a, for_b]) => {
                    for free in 0..half {
                        for order in 0..4 {
                            out[1 + free][order] += for_a[free][k - 1] * sine[order];
                            out[1 + half + free][order] += for_b[free][k - 1] * cosine[order];
                        }
                    }
                }
            }
        }
    }

    fn standing(&self) -> Vec<f64> {
        let mut one = vec![0.0; self.columns()];
        one[0] = 1.0;
        one
    }
}

/// Orthonormal basis of the vectors normal to `normal`: all columns except the first of the Householder reflection
/// that maps `normal` to the first axis.
fn null_space(normal: &[f64]) -> Vec<Vec<f64>> {
    let length = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
    let mut mirror: Vec<f64> = normal.iter().map(|x| x / length).collect();
    mirror[0] += mirror[0].signum();
    let square: f64 = mirror.iter().map(|x| x * x).sum();
    (1..normal.len())
        .map(|column| {
            (0..normal.len())
                .map(|row| f64::from(u8::from(row == column)) - 2.0 * mirror[row] * mirror[column] / square)
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Motion;
    use crate::families::check;
    use crate::family::Family;
    use proptest::prelude::*;

    fn settings(harmonics: usize, rest: bool) -> FourierSettings {
        FourierSettings { harmonics, rest, periods: 1 }
    }

    #[test]
    fn parameter_counts() {
        for (harmonics, rest, numbers) in [(5, true, 9), (10, true, 19), (5, false, 11)] {
            assert_eq!(Fourier::new(1, 10.0, &settings(harmonics, rest)).unwrap().parameters(), numbers);
        }
    }

    /// Compares the motion with Eq. 24 with the coefficients of the family; rounding of sums of ten terms below 10.
    #[test]
    fn is_the_series() {
        let (duration, harmonics) = (8.0, 5);
        for rest in [true, false] {
            let family = Fourier::new(2, duration, &settings(harmonics, rest)).unwrap();
            let parameters = check::start(&family, 5);
            let times = [0.0, 0.37, 2.5, 7.9, duration];
            let mut motion = Motion::default();
            family.motion(&parameters, &times, &mut motion);
            let omega = core::f64::consts::TAU / duration;
            for joint in 0..2 {
                let series = family.coefficients(&parameters, joint);
                let q0 = parameters[joint * family.basis().columns()];
                for (sample, time) in times.iter().enumerate() {
                    let q: f64 = (1..=harmonics)
                        .map(|k| {
                            let [a, b] = series[k - 1];
                            let speed = k as f64 * omega;
                            (a * (speed * time).sin() + b * (speed * time).cos()) / speed
                        })
                        .sum();
                    assert!((motion.q[motion.of(joint)][sample] - q0 - q).abs() < 1e-13);
                }
                if rest {
                    assert!(series.iter().map(|ab| ab[0]).sum::<f64>().abs() < 1e-13);
                    assert!((1..=harmonics).map(|k| k as f64 * series[k - 1][1]).sum::<f64>().abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn rejects_settings_without_motion() {
        for (joints, duration, harmonics) in [(0, 1.0, 5), (1, 0.0, 5), (1, f64::NAN, 5), (1, 1.0, 1), (1, 1.0, 9999)] {
            assert!(Fourier::new(joints, duration, &settings(harmonics, true)).is_err());
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn exact(seed in any::<u64>(), harmonics in 2_usize..9, rest in any::<bool>(), periods in 1_usize..4) {
            let family = Fourier::new(3, 7.0, &FourierSettings { harmonics, rest, periods }).unwrap();
            check::derivatives(&family, seed);
            check::gradient(&family, seed);
            check::curvature(&family, seed);
            if rest { check::rest(&family, seed); }
        }
    }
}
