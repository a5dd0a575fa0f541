//! Postures held one after another, for gravity and friction offsets.

use super::error::{FamilyError, MAX_COUNT, require, require_frame};
use super::linear::{Basis, LinearFamily};
use super::polynomials::smooth_step;
use serde::{Deserialize, Serialize};

const NAME: &str = "static_postures";

/// Settings of a [`StaticPostures`] family.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct StaticPosturesSettings {
    /// Number of postures. Default 10.
    pub postures: usize,
    /// Share of the duration at rest; the moves share the remaining time equally. Default 0.5.
    pub rest_part: f64,
}

impl Default for StaticPosturesSettings {
    fn default() -> Self {
        Self { postures: 10, rest_part: 0.5 }
    }
}

impl StaticPosturesSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// Fewer than 2 postures or more than 1000, or a share at rest outside 0..1 (ends excluded).
    pub fn validate(&self) -> Result<(), FamilyError> {
        require((2..=MAX_COUNT).contains(&self.postures), NAME, "postures", self.postures as f64, "give 2 to 1000")?;
        let fix = "give a part between 0 and 1";
        require(self.rest_part > 0.0 && self.rest_part < 1.0, NAME, "rest_part", self.rest_part, fix)
    }
}

/// K postures, each held for the same time. The moves between them are polynomials of degree 7 that begin and end
/// with q̇ = q̈ = jerk = 0.
///
/// Parameters per joint: its positions in the K postures, rad (m). The motion begins and ends in a held posture.
pub type StaticPostures = LinearFamily<StaticPosturesBasis>;

/// Basis functions of a [`StaticPostures`] family.
#[derive(Clone, Debug)]
pub struct StaticPosturesBasis {
    postures: usize,
    hold_s: f64,
    move_s: f64,
}

impl StaticPostures {
    /// Creates the family for a number of joints and a duration (s).
    ///
    /// # Errors
    /// Invalid settings; see [`StaticPosturesSettings::validate`].
    pub fn new(joints: usize, duration_s: f64, settings: &StaticPosturesSettings) -> Result<Self, FamilyError> {
        require_frame(NAME, joints, duration_s)?;
        settings.validate()?;
        let postures = settings.postures;
        let hold_s = duration_s * settings.rest_part / postures as f64;
        let move_s = duration_s * (1.0 - settings.rest_part) / (postures - 1) as f64;
        Ok(Self::of(StaticPosturesBasis { postures, hold_s, move_s }, joints, duration_s))
    }
}

impl StaticPosturesBasis {
    /// Start and end of each hold, s.
    pub fn holds(&self) -> Vec<[f64; 2]> {
        let period = self.hold_s + self.move_s;
        (0..self.postures).map(|posture| posture as f64 * period).map(|from| [from, from + self.hold_s]).collect()
    }
}

impl Basis for StaticPosturesBasis {
    const NAME: &'static str = NAME;

    fn columns(&self) -> usize {
        self.postures
    }

    fn row(&self, _joint: usize, time_s: f64, out: &mut [[f64; 4]]) {
        let period = self.hold_s + self.move_s;
        let posture = ((time_s / period) as usize).min(self.postures - 1);
        let step = if posture + 1 < self.postures {
            smooth_step((time_s - posture as f64 * period - self.hold_s) / self.move_s)
        } else {
            [0.0; 4]
        };
        for (order, value) in step.iter().enumerate() {
            let value = value / self.move_s.powi(order as i32);
            out[posture][order] -= value;
            if posture + 1 < self.postures {
                out[posture + 1][order] += value;
            }
        }
        out[posture][0] += 1.0;
    }

    fn standing(&self) -> Vec<f64> {
        vec![1.0; self.postures]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Motion;
    use crate::families::check;
    use crate::family::Family;
    use proptest::prelude::*;

    #[test]
    fn postures_are_held() {
        let family = StaticPostures::new(2, 12.0, &StaticPosturesSettings { postures: 4, rest_part: 0.4 }).unwrap();
        let parameters = check::start(&family, 9);
        for (posture, [from, to]) in family.basis().holds().into_iter().enumerate() {
            let mut motion = Motion::default();
            family.motion(&parameters, &[from + 1e-9, 0.5 * (from + to), to - 1e-9], &mut motion);
            for joint in 0..2 {
                for sample in motion.of(joint) {
                    assert_eq!(motion.q[sample], parameters[4 * joint + posture]);
                    assert_eq!([motion.dq[sample], motion.ddq[sample], motion.dddq[sample]], [0.0; 3]);
                }
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]
        #[test]
        fn exact(seed in any::<u64>(), postures in 2_usize..7, rest_part in 0.1_f64..0.6) {
            let family = StaticPostures::new(2, 8.0, &StaticPosturesSettings { postures, rest_part }).unwrap();
            check::derivatives(&family, seed);
            check::gradient(&family, seed);
            check::rest(&family, seed);
        }
    }
}
