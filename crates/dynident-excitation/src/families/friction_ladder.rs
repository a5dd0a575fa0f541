//! Sweeps at constant velocity, from slow to fast, for the identification of friction curves.

use super::error::{FamilyError, MAX_COUNT, require, require_frame};
use super::linear::{Basis, LinearFamily};
use super::polynomials::smooth_ramp;
use dynident_model::sample::Random;
use serde::{Deserialize, Serialize};

const NAME: &str = "friction_ladder";

/// Distribution of the time among the velocities (rungs) of a [`FrictionLadder`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum LadderPace {
    /// Sweeps of equal duration: slow sweeps cover a short distance.
    EqualTime,
    /// Sweeps of equal distance: slow sweeps take longer.
    EqualTravel,
}

/// Settings of a [`FrictionLadder`] family.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct FrictionLadderSettings {
    /// Number of velocities. Default 6.
    pub rungs: usize,
    /// Slowest velocity as a share of the fastest; the others are geometric steps between them. Default 0.05.
    pub slowest_part: f64,
    /// Duration of a velocity ramp, s. Default 0.2.
    pub ramp_s: f64,
    /// Distribution of the time. Default equal time.
    pub pace: LadderPace,
    /// Whether joints move one after another, each for an equal part of the duration, while the others rest. Default
    /// false: all joints move at the same time.
    pub one_by_one: bool,
}

impl Default for FrictionLadderSettings {
    fn default() -> Self {
        Self { rungs: 6, slowest_part: 0.05, ramp_s: 0.2, pace: LadderPace::EqualTime, one_by_one: false }
    }
}

impl FrictionLadderSettings {
    /// Checks the settings for a number of joints and a duration (s).
    ///
    /// # Errors
    /// No rung, a share outside 0..1, or ramps that leave no time at constant velocity.
    pub fn validate(&self, joints: usize, duration_s: f64) -> Result<(), FamilyError> {
        require((1..=MAX_COUNT).contains(&self.rungs), NAME, "rungs", self.rungs as f64, "give 1 to 1000")?;
        let fix = "give a part above 0 and at most 1";
        require(self.slowest_part > 0.0 && self.slowest_part <= 1.0, NAME, "slowest_part", self.slowest_part, fix)?;
        require(self.ramp_s >= 1e-3, NAME, "ramp_s", self.ramp_s, "give a millisecond or more")?;
        require(
            self.cruising_s(joints, duration_s) > 0.0,
            NAME,
            "ramp_s",
            self.ramp_s,
            "the ramps (four per rung) take the whole duration: use shorter ramps (ramp_s), fewer rungs or a longer duration",
        )
    }

    /// Duration of motion at constant velocity of one joint, s.
    fn cruising_s(&self, joints: usize, duration_s: f64) -> f64 {
        let is_rotary = if self.one_by_one { joints } else { 1 };
        duration_s / is_rotary as f64 - 4.0 * self.rungs as f64 * self.ramp_s
    }
}

/// Sweeps back and forth at constant velocity: one pair of sweeps for each rung of a ladder of velocities, joined by
/// smooth ramps.
///
/// q(t) = q_mid + V g(t): the settings define the shape g, so a joint has two free parameters. These are the middle
/// of its longest sweep in rad (m) and the fastest velocity V in rad/s (m/s; a negative V begins in the other
/// direction). During each sweep q̈ = 0 exactly, so that the torque is gravity and friction. The velocity ramps are
/// polynomials with continuous q̈ and jerk. Both ends are at rest at the same posture.
///
/// # Source
/// Constant-velocity friction identification as in Armstrong-Hélouvry, Control of Machines with Friction (1991).
pub type FrictionLadder = LinearFamily<FrictionLadderBasis>;

#[derive(Clone, Copy, Debug, PartialEq)]
struct Rung {
    start_s: f64,
    cruise_s: f64,
    part: f64,
}

/// Basis functions of a [`FrictionLadder`] family.
#[derive(Clone, Debug)]
pub struct FrictionLadderBasis {
    rungs: Vec<Rung>,
    ramp_s: f64,
    turn_s: f64,
    one_by_one: bool,
    reach: f64,
}

impl FrictionLadder {
    /// Creates the family for a number of joints and a duration (s).
    ///
    /// # Errors
    /// Invalid settings; see [`FrictionLadderSettings::validate`].
    pub fn new(joints: usize, duration_s: f64, settings: &FrictionLadderSettings) -> Result<Self, FamilyError> {
        require_frame(NAME, joints, duration_s)?;
        settings.validate(joints, duration_s)?;
        let ramp_s = settings.ramp_s;
        let steps = settings.rungs.saturating_sub(1).max(1) as f64;
        let mut rungs: Vec<Rung> = (0..settings.rungs)
            .map(|rung| {
                let below = (settings.rungs - 1 - rung) as f64 / steps;
                Rung { start_s: 0.0, cruise_s: 0.0, part: settings.slowest_part.powf(below) }
            })
            .collect();
        let share = |rung: &Rung| match settings.pace {
            LadderPace::EqualTime => 1.0,
            LadderPace::EqualTravel => 1.0 / rung.part,
        };
        let all: f64 = rungs.iter().map(share).sum();
        let cruising_s = settings.cruising_s(joints, duration_s);
        let mut start_s = 0.0;
        for rung in &mut rungs {
            rung.start_s = start_s;
            rung.cruise_s = 0.5 * cruising_s * share(rung) / all;
            start_s += 2.0 * (rung.cruise_s + 2.0 * ramp_s);
        }
        let reach = rungs.iter().map(|rung| rung.part * (rung.cruise_s + ramp_s)).fold(0.0, f64::max);
        let turn_s = if settings.one_by_one { duration_s / joints as f64 } else { 0.0 };
        Ok(Self::of(
            FrictionLadderBasis { rungs, ramp_s, turn_s, one_by_one: settings.one_by_one, reach },
            joints,
            duration_s,
        ))
    }
}

impl FrictionLadderBasis {
    /// Intervals in which `joint` moves at constant velocity, and its velocity as a share of V: `[from_s, to_s,
    /// share]`.
    pub fn sweeps(&self, joint: usize) -> Vec<[f64; 3]> {
        let turn = self.turn_s * joint as f64;
        let mut sweeps = Vec::with_capacity(2 * self.rungs.len());
        for rung in &self.rungs {
            for (half, sign) in [(0.0, 1.0), (1.0, -1.0)] {
                let from = turn + rung.start_s + half * (rung.cruise_s + 2.0 * self.ramp_s) + self.ramp_s;
                sweeps.push([from, from + rung.cruise_s, sign * rung.part]);
            }
        }
        sweeps
    }

    /// Distance covered in a sweep at unit velocity, with derivatives: a ramp up, constant velocity, and a ramp down.
    fn sweep(&self, time_s: f64, cruise_s: f64) -> [f64; 4] {
        let scales = [self.ramp_s, 1.0, 1.0 / self.ramp_s, self.ramp_s.powi(-2)];
        let up = smooth_ramp(time_s / self.ramp_s);
        let down = smooth_ramp((time_s - self.ramp_s - cruise_s) / self.ramp_s);
        core::array::from_fn(|order| (up[order] - down[order]) * scales[order])
    }
}

impl Basis for FrictionLadderBasis {
    const NAME: &'static str = NAME;

    fn columns(&self) -> usize {
        2
    }

    fn differs_by_joint(&self) -> bool {
        self.one_by_one
    }

    fn row(&self, joint: usize, time_s: f64, out: &mut [[f64; 4]]) {
        out[0] = [1.0, 0.0, 0.0, 0.0];
        out[1][0] = -0.5 * self.reach;
        let time = time_s - self.turn_s * joint as f64;
        let Some(rung) = self.rungs.iter().rev().find(|rung| time >= rung.start_s) else { return };
        let half_s = rung.cruise_s + 2.0 * self.ramp_s;
        let (there, back) =
            (self.sweep(time - rung.start_s, rung.cruise_s), self.sweep(time - rung.start_s - half_s, rung.cruise_s));
        for order in 0..4 {
            out[1][order] += rung.part * (there[order] - back[order]);
        }
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

    /// In every sweep the velocity is that of the rung and the acceleration is zero; the ladder is geometric; the
    /// middle is correct.
    #[test]
    fn sweeps_are_at_constant_speed() {
        for (pace, one_by_one) in
            [(LadderPace::EqualTime, false), (LadderPace::EqualTravel, false), (LadderPace::EqualTravel, true)]
        {
            let settings = FrictionLadderSettings { rungs: 4, slowest_part: 0.125, ramp_s: 0.1, pace, one_by_one };
            let family = FrictionLadder::new(2, 20.0, &settings).unwrap();
            let parameters = [0.3, 1.5, -0.2, -1.0];
            for joint in 0..2 {
                let sweeps = family.basis().sweeps(joint);
                assert_eq!(sweeps.len(), 8);
                for (sweep, &[from, to, part]) in sweeps.iter().enumerate() {
                    let expected = 0.125_f64 * 2.0_f64.powi(sweep as i32 / 2) * if sweep % 2 == 0 { 1.0 } else { -1.0 };
                    assert!((part - expected).abs() < 1e-15);
                    let times: Vec<f64> = (0..=10).map(|s| from + (to - from) * f64::from(s) / 10.0).collect();
                    let mut motion = Motion::default();
                    family.motion(&parameters, &times, &mut motion);
                    for sample in motion.of(joint) {
                        // Sweep ends are sums of times, so rounding can place them slightly inside the ramp.
                        assert!((motion.dq[sample] - parameters[2 * joint + 1] * part).abs() < 1e-12);
                        assert!(motion.ddq[sample].abs() < 1e-9);
                    }
                }
            }
            let times: Vec<f64> = (0..=20_000).map(|s| f64::from(s) * 1e-3).collect();
            let mut motion = Motion::default();
            family.motion(&parameters, &times, &mut motion);
            let own = &motion.q[motion.of(0)];
            let [low, high] = own.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], q| [l.min(*q), h.max(*q)]);
            assert!((0.5 * (low + high) - 0.3).abs() < 1e-5 && (own[0] - own[20_000]).abs() < 1e-12);
        }
    }

    #[test]
    fn rejects_ramps_that_are_too_long() {
        let settings = FrictionLadderSettings::default();
        assert!(FrictionLadder::new(1, 4.8, &settings).is_err());
        assert!(FrictionLadder::new(1, 4.9, &settings).is_ok());
        assert!(FrictionLadder::new(2, 4.9, &FrictionLadderSettings { one_by_one: true, ..settings }).is_err());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]
        #[test]
        fn exact(seed in any::<u64>(), rungs in 1_usize..5, ramp_s in 0.2_f64..0.4, one_by_one in any::<bool>()) {
            let settings = FrictionLadderSettings { rungs, ramp_s, one_by_one, ..Default::default() };
            let family = FrictionLadder::new(2, 20.0, &settings).unwrap();
            check::derivatives(&family, seed);
            check::gradient(&family, seed);
            check::rest(&family, seed);
        }
    }
}
