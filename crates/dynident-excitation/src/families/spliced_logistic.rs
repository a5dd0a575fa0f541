//! Excitation trajectory of *Iterative Identification of Robot Dynamic Parameters Based on Logistic Function* ("the
//! paper" below): logistic functions back and forth.

use super::error::{FamilyError, MAX_COUNT, require, require_frame};
use super::random_start::{grid, scale_and_shift};
use crate::family::{Family, check_shapes};
use crate::motion::{Motion, MotionAdjoint};
use dynident_model::sample::Random;
use serde::{Deserialize, Serialize};

const NAME: &str = "spliced_logistic";

/// Settings of a [`SplicedLogistic`] family.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct SplicedLogisticSettings {
    /// Product ω T of steepness and period. Default 40: the paper does not state T, and |q̇(0)| < 1e-4 rad/s requires
    /// about this value. If the period T is given, this is the minimum of ω T.
    pub period_times_omega: f64,
    /// Period T of each joint, s. Default none: T = `period_times_omega` / ω, which depends on ω.
    pub periods_s: Option<Vec<f64>>,
    /// Offset h of each joint, rad (m). Default none: a free parameter.
    pub offsets: Option<Vec<f64>>,
    /// Number of periods; afterwards the joint rests at its start. Default 1.
    pub repetitions: usize,
}

impl Default for SplicedLogisticSettings {
    fn default() -> Self {
        Self { period_times_omega: 40.0, periods_s: None, offsets: None, repetitions: 1 }
    }
}

impl SplicedLogisticSettings {
    /// Checks the settings for a number of joints and a duration (s).
    ///
    /// # Errors
    /// ω T not positive or above 1e4, no repetitions, lists of the wrong length, values that are not finite, or periods
    /// that do not fit into the duration.
    pub fn validate(&self, joints: usize, duration_s: f64) -> Result<(), FamilyError> {
        let product = self.period_times_omega;
        require(product > 0.0 && product <= 1e4, NAME, "period_times_omega", product, "give more than 0, at most 1e4")?;
        let repetitions = self.repetitions as f64;
        require((1..=MAX_COUNT).contains(&self.repetitions), NAME, "repetitions", repetitions, "give 1 to 1000")?;
        for (what, list) in [("periods_s", &self.periods_s), ("offsets", &self.offsets)] {
            let found = list.as_ref().map_or(joints, Vec::len);
            if found != joints {
                return Err(FamilyError::Length { family: NAME, what, expected: joints, found });
            }
        }
        for &period in self.periods_s.iter().flatten() {
            require(
                period >= 1e-3 && repetitions * period <= duration_s * (1.0 + 1e-12),
                NAME,
                "periods_s",
                period,
                "give periods of at least a millisecond whose repetitions fit into the duration",
            )?;
        }
        for &offset in self.offsets.iter().flatten() {
            require(offset.is_finite(), NAME, "offsets", offset, "give finite positions")?;
        }
        Ok(())
    }
}

/// The spliced logistic function, Eqs. 12 to 14 of *Iterative Identification of Robot Dynamic Parameters Based on
/// Logistic Function*:
///
/// q(t) = h + A/(1 + e^-(ω rem(t, T) - ωT/4)) in the first half of each period, h + A/(1 + e^(ω rem(t, T) - 3ωT/4)) in
/// the second.
///
/// Parameters per joint: A in rad (m), ω in 1/s, and h in rad (m) unless given. Peak velocity Aω/4, peak acceleration
/// Aω²/(6√3).
///
/// At the splices the joint is only nearly at rest. It is A/(1 + e^(ωT/4)) away from its asymptote (4.5e-5 A for ωT =
/// 40). Its velocity is about that distance times ω and changes sign there.
/// [`LogisticStrokes`](super::LogisticStrokes) are exactly at rest.
///
/// Velocity and acceleration are functions of position.
#[derive(Clone, Debug)]
pub struct SplicedLogistic {
    settings: SplicedLogisticSettings,
    joints: usize,
    duration_s: f64,
}

struct Phase {
    argument: f64,
    by_omega: f64,
    sign: f64,
    frozen: bool,
}

impl SplicedLogistic {
    /// Creates the family of trajectories for a number of joints and a duration (s).
    ///
    /// # Errors
    /// Invalid settings; see [`SplicedLogisticSettings::validate`].
    pub fn new(joints: usize, duration_s: f64, settings: &SplicedLogisticSettings) -> Result<Self, FamilyError> {
        require_frame(NAME, joints, duration_s)?;
        settings.validate(joints, duration_s)?;
        Ok(Self { settings: settings.clone(), joints, duration_s })
    }

    /// Period T of a joint, s.
    ///
    /// # Panics
    /// If the joint does not exist or there are too few parameters.
    pub fn period_s(&self, parameters: &[f64], joint: usize) -> f64 {
        self.period(joint, parameters[joint * self.parameters_per_joint() + 1])
    }

    fn parameters_per_joint(&self) -> usize {
        if self.settings.offsets.is_some() { 2 } else { 3 }
    }

    fn offset(&self, joint: usize, own: &[f64]) -> f64 {
        self.settings.offsets.as_ref().map_or_else(|| own[2], |offsets| offsets[joint])
    }

    fn period(&self, joint: usize, omega: f64) -> f64 {
        self.settings.periods_s.as_ref().map_or(self.settings.period_times_omega / omega, |periods| periods[joint])
    }

    /// Argument of the logistic function, its derivative with respect to ω, and the sign of the branch.
    fn phase(&self, joint: usize, omega: f64, time_s: f64) -> Phase {
        let period = self.period(joint, omega);
        let given = self.settings.periods_s.is_some();
        let whole = (time_s / period).floor();
        if whole >= self.settings.repetitions as f64 {
            let by_omega = if given { -0.25 * period } else { 0.0 };
            return Phase { argument: -0.25 * omega * period, by_omega, sign: 1.0, frozen: true };
        }
        let rest = time_s - whole * period;
        let (sign, centre) = if rest < 0.5 * period { (1.0, 0.25) } else { (-1.0, 0.75) };
        let from_centre = rest - centre * period;
        // With T = c/ω the argument is ωt minus a constant.
        let by_omega = sign * if given { from_centre } else { time_s };
        Phase { argument: sign * omega * from_centre, by_omega, sign, frozen: false }
    }
}

/// f = 1/(1 + e^-x) and its first four derivatives, from f' = f(1 - f) without cancellation.
fn logistic(x: f64) -> [f64; 5] {
    let e = (-x.abs()).exp();
    let d = 1.0 / (1.0 + e);
    let (value, first) = (if x >= 0.0 { d } else { e * d }, e * d * d);
    // 1 - 2f, accurate also for f near 1/2.
    let slope = if x >= 0.0 { (e - 1.0) * d } else { (1.0 - e) * d };
    [value, first, first * slope, first * (1.0 - 6.0 * first), first * slope * (1.0 - 12.0 * first)]
}

impl Family for SplicedLogistic {
    fn name(&self) -> &'static str {
        NAME
    }

    fn joints(&self) -> usize {
        self.joints
    }

    fn duration_s(&self) -> f64 {
        self.duration_s
    }

    fn parameters(&self) -> usize {
        self.joints * self.parameters_per_joint()
    }

    /// Lower bounds of ω, at which all periods fit into the duration, or the product of ω and a given period T has
    /// its minimum.
    fn bounds(&self) -> Vec<[f64; 2]> {
        let free = [f64::NEG_INFINITY, f64::INFINITY];
        (0..self.joints)
            .flat_map(|joint| {
                let period = self
                    .settings
                    .periods_s
                    .as_ref()
                    .map_or(self.duration_s / self.settings.repetitions as f64, |periods| periods[joint]);
                let omega = [self.settings.period_times_omega / period, f64::INFINITY];
                [free, omega, free].into_iter().take(self.parameters_per_joint())
            })
            .collect()
    }

    fn random(&self, ranges: &[[f64; 2]], speeds: &[f64], random: &mut Random) -> Vec<f64> {
        let times = grid(self.duration_s);
        let mut parameters: Vec<f64> = self
            .bounds()
            .chunks(self.parameters_per_joint())
            .flat_map(|own| {
                let amplitude = if random.bits() & 1 == 0 { 1.0 } else { -1.0 };
                let omega = own[1][0] * random.uniform(0.0, 1.2).exp();
                [amplitude, omega, 0.0].into_iter().take(self.parameters_per_joint())
            })
            .collect();
        let mut motion = Motion::default();
        self.motion(&parameters, &times, &mut motion);
        for (joint, own) in parameters.chunks_mut(self.parameters_per_joint()).enumerate() {
            let range = ranges[joint];
            if let Some(offsets) = &self.settings.offsets {
                // The offset is fixed, so the motion uses the side with more range.
                let room = [range[0] - offsets[joint], range[1] - offsets[joint]];
                let most = if room[1] >= -room[0] { room[1] } else { room[0] };
                let most = if most.is_finite() { most } else { core::f64::consts::PI };
                let fast = if speeds[joint] > 0.0 { 4.0 * speeds[joint] / own[1] } else { f64::INFINITY };
                own[0] = random.uniform(0.3, 0.9) * most.signum() * most.abs().min(fast);
            } else {
                let span = motion.of(joint);
                // The grid can miss the middle of a stroke, where the velocity of unit amplitude is ω/4.
                let peak = [0.25 * own[1]];
                let [scale, shift] = scale_and_shift(&motion.q[span], &peak, range, speeds[joint], random);
                own[0] *= scale;
                own[2] = shift;
            }
        }
        parameters
    }

    fn motion(&self, parameters: &[f64], times_s: &[f64], out: &mut Motion) {
        assert_eq!(parameters.len(), self.parameters(), "parameters of {NAME}");
        out.reset(self.joints, times_s.len());
        for (joint, own) in parameters.chunks(self.parameters_per_joint()).enumerate() {
            let (amplitude, omega, offset) = (own[0], own[1], self.offset(joint, own));
            for (at, &time) in out.of(joint).zip(times_s) {
                let phase = self.phase(joint, omega, time);
                let f = logistic(phase.argument);
                out.q[at] = offset + amplitude * f[0];
                if !phase.frozen {
                    let rate = phase.sign * omega;
                    out.dq[at] = amplitude * rate * f[1];
                    out.ddq[at] = amplitude * rate * rate * f[2];
                    out.dddq[at] = amplitude * rate * rate * rate * f[3];
                }
            }
        }
    }

    fn apply_adjoint(&self, parameters: &[f64], times_s: &[f64], adjoint: &MotionAdjoint, gradient: &mut [f64]) {
        check_shapes(self, parameters, times_s, adjoint, gradient);
        for (joint, own) in parameters.chunks(self.parameters_per_joint()).enumerate() {
            let (amplitude, omega) = (own[0], own[1]);
            let mut sum = [0.0; 3];
            for (at, &time) in adjoint.of(joint).zip(times_s) {
                let phase = self.phase(joint, omega, time);
                let f = logistic(phase.argument);
                let pulls = adjoint.arrays().map(|values| values[at]);
                let orders = if phase.frozen { 1 } else { 4 };
                let mut power = 1.0;
                for (order, pull) in pulls.into_iter().enumerate().take(orders) {
                    let by_omega = order as f64 / omega * f[order] + f[order + 1] * phase.by_omega;
                    sum[0] += pull * power * f[order];
                    sum[1] += pull * power * amplitude * by_omega;
                    power *= phase.sign * omega;
                }
                sum[2] += pulls[0];
            }
            for (out, value) in gradient[joint * self.parameters_per_joint()..]
                .iter_mut()
                .zip(sum.iter().take(self.parameters_per_joint()))
            {
                *out += value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::families::check;
    use proptest::prelude::*;

    fn family(joints: usize, duration_s: f64, settings: &SplicedLogisticSettings) -> SplicedLogistic {
        SplicedLogistic::new(joints, duration_s, settings).unwrap()
    }

    /// Figs. 4 and 5: for T = 80 all ω pass A/2 at T/4 and 3T/4 with slope ±Aω/4 and reach A at T/2; for ω = 0.6 the
    /// same stroke shifts with T. Peak acceleration Aω²/(6√3) at e^x = 2 + √3. Tolerance: rounding.
    #[test]
    fn features_of_figures_4_and_5() {
        for (omega, period) in [(0.5, 80.0), (1.0, 80.0), (2.0, 80.0), (0.6, 70.0), (0.6, 80.0), (0.6, 100.0)] {
            let settings = SplicedLogisticSettings {
                periods_s: Some(vec![period]),
                offsets: Some(vec![0.25]),
                repetitions: 3,
                ..Default::default()
            };
            let family = family(1, 3.0 * period, &settings);
            let steepest = (2.0 + 3.0_f64.sqrt()).ln() / omega;
            let late = 2.0 * period;
            let times =
                [0.25 * period, 0.75 * period, 0.5 * period, 0.0, late + 0.25 * period, 0.25 * period - steepest];
            let mut motion = Motion::default();
            family.motion(&[2.0, omega], &times, &mut motion);
            for sample in [0, 1, 4] {
                assert!((motion.q[sample] - 1.25).abs() < 1e-12);
                assert!((motion.dq[sample].abs() - 0.5 * omega).abs() < 1e-12);
            }
            assert!(motion.dq[0] > 0.0 && motion.dq[1] < 0.0);
            let far = 2.0 / (1.0 + (0.25 * omega * period).exp());
            assert!((motion.q[2] - 2.25 + far).abs() < 1e-13 && (motion.q[3] - 0.25 - far).abs() < 1e-13);
            assert!((motion.ddq[5] - 2.0 * omega * omega / (6.0 * 3.0_f64.sqrt())).abs() < 1e-12);
            assert!(motion.dddq[5].abs() < 1e-12);
            // Below 1e-4 at the splices, as the paper requires, for ωT >= 40.
            if omega * period >= 44.0 {
                assert!([2, 3].iter().all(|&s| motion.dq[s].abs() < 1e-4 && motion.ddq[s].abs() < 1e-4));
            }
        }
    }

    #[test]
    fn bad_settings_are_named() {
        let make = |settings: &SplicedLogisticSettings| SplicedLogistic::new(2, 40.0, settings);
        let default = SplicedLogisticSettings::default();
        assert!(make(&SplicedLogisticSettings { periods_s: Some(vec![10.0]), ..default.clone() }).is_err());
        assert!(make(&SplicedLogisticSettings { periods_s: Some(vec![10.0, 41.0]), ..default.clone() }).is_err());
        assert!(make(&SplicedLogisticSettings { period_times_omega: f64::NAN, ..default.clone() }).is_err());
        assert!(make(&SplicedLogisticSettings { repetitions: 0, ..default }).is_err());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn exact(seed in any::<u64>(), repetitions in 1_usize..4, fixed in any::<bool>(), given in any::<bool>()) {
            let settings = SplicedLogisticSettings {
                repetitions,
                offsets: fixed.then(|| vec![0.1, -0.2]),
                periods_s: given.then(|| vec![20.0, 15.0]),
                ..Default::default()
            };
            check::derivatives(&family(2, 60.0, &settings), seed);
        }

        /// Tested on the strokes: at a splice, which depends on ω if T does, the velocity jumps by e^-10 and has no
        /// derivative.
        #[test]
        fn gradient_is_exact(seed in any::<u64>(), repetitions in 1_usize..4, fixed in any::<bool>(), given in any::<bool>()) {
            let settings = SplicedLogisticSettings {
                repetitions,
                offsets: fixed.then(|| vec![0.1]),
                periods_s: given.then(|| vec![20.0]),
                ..Default::default()
            };
            let family = family(1, 60.0, &settings);
            let parameters = check::start(&family, seed);
            let period = family.period_s(&parameters, 0);
            let mut times = vec![0.5 * (60.0 + repetitions as f64 * period)];
            let mut random = Random::new(seed);
            for half in 0..2 * repetitions {
                times.extend((0..8).map(|_| period * (0.5 * half as f64 + 0.25 + random.uniform(-0.2, 0.2))));
            }
            check::gradient_on(&family, &parameters, &times, seed);
        }
    }
}
