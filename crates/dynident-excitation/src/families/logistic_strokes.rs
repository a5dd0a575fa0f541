//! Several logistic strokes (smooth moves) per joint, all joints at once, with exact rest at both ends.

use super::error::{FamilyError, MAX_COUNT, require, require_frame};
use super::logistic_lanes::{Backward, Forward};
use super::logistic_stroke::LogisticStroke;
use super::random_start::{grid, scale_and_shift};
use crate::family::{Family, check_shapes};
use crate::motion::{Motion, MotionAdjoint};
use dynident_lanes::{Level, dispatch};
use dynident_model::sample::Random;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

const NAME: &str = "logistic_strokes";
const MAX_SHARPNESS: f64 = 40.0;
/// Bound of the logarithm of a slot's length relative to the length of the last slot.
const MAX_LOG_SLOT: f64 = 3.0;

/// Order of the strokes of one joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum StrokeOrder {
    /// A sum of strokes anywhere within the duration: more information, but velocity is not a function of position.
    Overlapping,
    /// Strokes one after another in time slots of free length that fill the duration: on every stroke, velocity is a
    /// function of position.
    Spliced,
}

/// Settings of a [`LogisticStrokes`] family.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct LogisticStrokesSettings {
    /// Number of strokes per joint, K. Default 6.
    pub strokes: usize,
    /// Order of the strokes. Default overlapping.
    pub order: StrokeOrder,
    /// Whether the motion ends at its start position. Default true.
    pub returns: bool,
    /// Sharpness κ of overlapping strokes, from 2√3 to 40; see [`LogisticStroke`]. Default 4. For spliced strokes κ
    /// is a free parameter.
    pub sharpness: f64,
    /// Maximum steepness ω of overlapping strokes, 1/s. Default 15.
    pub omega_max: f64,
}

impl Default for LogisticStrokesSettings {
    fn default() -> Self {
        Self { strokes: 6, order: StrokeOrder::Overlapping, returns: true, sharpness: 4.0, omega_max: 15.0 }
    }
}

impl LogisticStrokesSettings {
    /// Checks the settings for a duration (s).
    ///
    /// # Errors
    /// Too few strokes (1, or 2 if the motion returns) or more than 1000, κ out of range, or a maximum ω too small for
    /// one stroke to fit into the duration.
    pub fn validate(&self, duration_s: f64) -> Result<(), FamilyError> {
        let least = if self.returns { 2 } else { 1 };
        let fix = "give 1 to 1000, and at least 2 if the motion returns to its start";
        require((least..=MAX_COUNT).contains(&self.strokes), NAME, "strokes", self.strokes as f64, fix)?;
        require(
            (LogisticStroke::LEAST_SHARPNESS..=MAX_SHARPNESS).contains(&self.sharpness),
            NAME,
            "sharpness",
            self.sharpness,
            "give 3.4642 to 40",
        )?;
        require(
            self.omega_max.is_finite() && self.omega_max > 2.0 * self.sharpness / duration_s,
            NAME,
            "omega_max",
            self.omega_max,
            "give more than 2 sharpness / duration, or no stroke fits into the duration",
        )
    }
}

/// q(t) = h + Σ_k A_k s_k(t) with [`LogisticStroke`]s. This generalises Eq. 14 of *Iterative Identification of Robot
/// Dynamic Parameters Based on Logistic Function* to strokes of different amplitude, steepness and time, with all
/// joints moving at once.
///
/// Parameters per joint, in this order:
/// * overlapping: h, A_1..A_K, ω_1..ω_K in 1/s, and positions τ_1..τ_K in time from 0 (the stroke begins with the
///   motion) to 1 (it ends with the motion). If the motion returns, A_K follows from the other amplitudes and is not a
///   parameter, so that there are 3 K parameters.
/// * spliced: h, A_1..A_K (as above), κ_1..κ_K, and logarithms of the lengths of slots 1..K-1 relative to the last
///   slot. If the motion returns, there are 3 K - 1 parameters.
///
/// Every value within [`bounds`](Family::bounds) keeps all strokes within the duration, so that both ends are exactly
/// at rest, with all derivatives zero.
#[derive(Clone, Debug)]
pub struct LogisticStrokes {
    settings: LogisticStrokesSettings,
    joints: usize,
    duration_s: f64,
}

impl LogisticStrokes {
    /// Creates the family for a number of joints and a duration (s).
    ///
    /// # Errors
    /// Invalid settings; see [`LogisticStrokesSettings::validate`].
    pub fn new(joints: usize, duration_s: f64, settings: &LogisticStrokesSettings) -> Result<Self, FamilyError> {
        require_frame(NAME, joints, duration_s)?;
        settings.validate(duration_s)?;
        Ok(Self { settings: settings.clone(), joints, duration_s })
    }

    /// Start position and strokes of one joint, in the order of the parameters.
    ///
    /// # Panics
    /// If the joint does not exist or there are too few parameters.
    pub fn strokes(&self, parameters: &[f64], joint: usize) -> (f64, Vec<LogisticStroke>) {
        let own = &parameters[joint * self.parameters_per_joint()..(joint + 1) * self.parameters_per_joint()];
        let (count, free) = (self.settings.strokes, self.free_amplitudes());
        let amplitudes = &own[1..=free];
        let (third, fourth) = own[1 + free..].split_at(count);
        let duration = self.duration_s;
        let lengths = self.slots(fourth);
        let mut from = 0.0;
        let strokes = (0..count)
            .map(|k| {
                let amplitude = amplitudes.get(k).copied().unwrap_or_else(|| -amplitudes.iter().sum::<f64>());
                let (centre_s, half_duration_s, sharpness) = match self.settings.order {
                    StrokeOrder::Overlapping => {
                        let half = self.settings.sharpness / third[k];
                        (half + fourth[k] * (duration - 2.0 * half), half, self.settings.sharpness)
                    }
                    StrokeOrder::Spliced => {
                        let half = 0.5 * lengths[k];
                        from += lengths[k];
                        (from - half, half, third[k])
                    }
                };
                LogisticStroke { amplitude, centre_s, half_duration_s, sharpness }
            })
            .collect();
        (own[0], strokes)
    }

    fn free_amplitudes(&self) -> usize {
        self.settings.strokes - usize::from(self.settings.returns)
    }

    fn parameters_per_joint(&self) -> usize {
        let slots = self.settings.strokes - usize::from(self.settings.order == StrokeOrder::Spliced);
        1 + self.free_amplitudes() + self.settings.strokes + slots
    }

    /// Lengths of the slots, s, from their logarithms; the logarithm of the last slot is zero.
    fn slots(&self, logarithms: &[f64]) -> Vec<f64> {
        let mut lengths: Vec<f64> = logarithms.iter().map(|x| x.exp()).collect();
        lengths.resize(self.settings.strokes, 1.0);
        let scale = self.duration_s / lengths.iter().sum::<f64>();
        for length in &mut lengths {
            *length *= scale;
        }
        lengths
    }

    /// Converts derivatives with respect to (A, c, w, κ) of each stroke to derivatives with respect to the joint's
    /// parameters after h.
    fn chain(&self, own: &[f64], raw: &[[f64; 4]], gradient: &mut [f64]) {
        let (count, free) = (self.settings.strokes, self.free_amplitudes());
        let closing = if free < count { raw[free][0] } else { 0.0 };
        for (out, stroke) in gradient[1..=free].iter_mut().zip(raw) {
            *out += stroke[0] - closing;
        }
        let (third, fourth) = own[1 + free..].split_at(count);
        let (third_out, fourth_out) = gradient[1 + free..].split_at_mut(count);
        match self.settings.order {
            StrokeOrder::Overlapping => {
                for k in 0..count {
                    let half = self.settings.sharpness / third[k];
                    let half_by_omega = -half / third[k];
                    third_out[k] += (raw[k][2] + (1.0 - 2.0 * fourth[k]) * raw[k][1]) * half_by_omega;
                    fourth_out[k] += (self.duration_s - 2.0 * half) * raw[k][1];
                }
            }
            StrokeOrder::Spliced => {
                let lengths = self.slots(fourth);
                // A change of a slot's length shifts the middle of its own stroke by half of the change, and all
                // later middles by the change.
                let mut later = 0.0;
                let mut by_length = vec![0.0; count];
                for k in (0..count).rev() {
                    by_length[k] = 0.5 * (raw[k][1] + raw[k][2]) + later;
                    later += raw[k][1];
                    third_out[k] += raw[k][3];
                }
                let mean = by_length.iter().zip(&lengths).map(|(g, d)| g * d).sum::<f64>() / self.duration_s;
                for (k, out) in fourth_out.iter_mut().enumerate() {
                    *out += lengths[k] * (by_length[k] - mean);
                }
            }
        }
    }
}

impl Family for LogisticStrokes {
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

    /// Bounds for overlapping strokes: ω from that of a stroke over the whole duration to the maximum, positions in
    /// time from 0 to 1. For spliced strokes: κ from 2√3 to 40, slots at most e³ times longer or shorter than the
    /// last slot.
    fn bounds(&self) -> Vec<[f64; 2]> {
        let count = self.settings.strokes;
        let (third, fourth) = match self.settings.order {
            StrokeOrder::Overlapping => {
                ([2.0 * self.settings.sharpness / self.duration_s, self.settings.omega_max], [0.0, 1.0])
            }
            StrokeOrder::Spliced => ([LogisticStroke::LEAST_SHARPNESS, MAX_SHARPNESS], [-MAX_LOG_SLOT, MAX_LOG_SLOT]),
        };
        let mut own = vec![[f64::NEG_INFINITY, f64::INFINITY]; 1 + self.free_amplitudes()];
        own.resize(own.len() + count, third);
        own.resize(self.parameters_per_joint(), fourth);
        own.repeat(self.joints)
    }

    fn random(&self, ranges: &[[f64; 2]], speeds: &[f64], random: &mut Random) -> Vec<f64> {
        let (count, free) = (self.settings.strokes, self.free_amplitudes());
        let bounds = self.bounds();
        let mut parameters = Vec::with_capacity(self.parameters());
        for own in bounds.chunks(self.parameters_per_joint()) {
            parameters.push(0.0);
            parameters.extend((0..free).map(|_| random.normal()));
            let [least, most] = own[1 + free];
            // Random starts have slow strokes, which can be large within the limits.
            let most = most.min(6.0 * least);
            parameters.extend((0..count).map(|_| least * (most / least).powf(random.uniform(0.0, 1.0))));
            let [low, high] = match self.settings.order {
                StrokeOrder::Overlapping => [0.0, 1.0],
                StrokeOrder::Spliced => [-0.5, 0.5],
            };
            parameters.extend((1 + free + count..self.parameters_per_joint()).map(|_| random.uniform(low, high)));
        }
        let coarse = grid(self.duration_s);
        let times: Vec<f64> = coarse
            .windows(2)
            .flat_map(|pair| (0..4).map(|part| pair[0] + 0.25 * f64::from(part) * (pair[1] - pair[0])))
            .collect();
        let mut motion = Motion::default();
        self.motion(&parameters, &times, &mut motion);
        for (joint, own) in parameters.chunks_mut(self.parameters_per_joint()).enumerate() {
            let span = motion.of(joint);
            let [scale, shift] =
                scale_and_shift(&motion.q[span.clone()], &motion.dq[span], ranges[joint], speeds[joint], random);
            own[0] = shift;
            own[1..=free].iter_mut().for_each(|amplitude| *amplitude *= scale);
        }
        parameters
    }

    fn motion(&self, parameters: &[f64], times_s: &[f64], out: &mut Motion) {
        assert_eq!(parameters.len(), self.parameters(), "parameters of {NAME}");
        out.reset(self.joints, times_s.len());
        for joint in 0..self.joints {
            let (start_at, strokes) = self.strokes(parameters, joint);
            dispatch(Level::detect(), Forward { strokes: &strokes, start_at, times_s, joint, out });
        }
    }

    fn apply_adjoint(&self, parameters: &[f64], times_s: &[f64], adjoint: &MotionAdjoint, gradient: &mut [f64]) {
        check_shapes(self, parameters, times_s, adjoint, gradient);
        let parameters_per_joint = self.parameters_per_joint();
        for (joint, own) in gradient.chunks_mut(parameters_per_joint).enumerate() {
            let (_, strokes) = self.strokes(parameters, joint);
            let raw = dispatch(Level::detect(), Backward { strokes: &strokes, times_s, joint, adjoint });
            own[0] += adjoint.q[adjoint.of(joint)].iter().sum::<f64>();
            self.chain(&parameters[joint * parameters_per_joint..(joint + 1) * parameters_per_joint], &raw, own);
        }
    }

    fn curvature(
        &self,
        parameters: &[f64],
        times_s: &[f64],
        joint: usize,
        weights: &MotionAdjoint,
        out: &mut DMatrix<f64>,
    ) -> bool {
        assert_eq!((weights.joints, weights.samples), (self.joints, times_s.len()), "weights of {NAME}");
        let parameters_per_joint = self.parameters_per_joint();
        let own = &parameters[joint * parameters_per_joint..(joint + 1) * parameters_per_joint];
        let (_, strokes) = self.strokes(parameters, joint);
        let range = weights.of(joint);
        let arrays = weights.arrays().map(|array| &array[range.clone()]);
        let (mut raw, mut row) = (vec![[[0.0; 4]; 4]; strokes.len()], DVector::zeros(parameters_per_joint));
        for (sample, &time) in times_s.iter().enumerate() {
            if arrays.iter().all(|array| array[sample] == 0.0) {
                continue;
            }
            for (raw, stroke) in raw.iter_mut().zip(&strokes) {
                *raw = stroke.derivatives_by_shape(time);
            }
            for (order, array) in arrays.iter().enumerate().filter(|(_, array)| array[sample] != 0.0) {
                row.fill(0.0);
                row[0] = if order == 0 { 1.0 } else { 0.0 };
                let of_order: Vec<[f64; 4]> = raw.iter().map(|raw| raw[order]).collect();
                self.chain(own, &of_order, row.as_mut_slice());
                out.ger(array[sample], &row, &row, 1.0);
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::families::check;
    use proptest::prelude::*;

    fn family(strokes: usize, order: StrokeOrder, returns: bool) -> LogisticStrokes {
        let settings = LogisticStrokesSettings { strokes, order, returns, ..Default::default() };
        LogisticStrokes::new(2, 10.0, &settings).unwrap()
    }

    fn orders() -> impl Strategy<Value = StrokeOrder> {
        prop_oneof![Just(StrokeOrder::Overlapping), Just(StrokeOrder::Spliced)]
    }

    #[test]
    fn free_numbers() {
        assert_eq!(family(6, StrokeOrder::Overlapping, true).parameters(), 2 * 18);
        assert_eq!(family(6, StrokeOrder::Overlapping, false).parameters(), 2 * 19);
        assert_eq!(family(4, StrokeOrder::Spliced, true).parameters(), 2 * 11);
    }

    #[test]
    fn bad_settings_are_named() {
        let make = |settings: LogisticStrokesSettings| LogisticStrokes::new(1, 2.0, &settings);
        let default = LogisticStrokesSettings::default();
        assert!(make(LogisticStrokesSettings { strokes: 1, ..default.clone() }).is_err());
        assert!(make(LogisticStrokesSettings { sharpness: 1.0, ..default.clone() }).is_err());
        assert!(make(LogisticStrokesSettings { omega_max: 3.9, ..default.clone() }).is_err());
        assert!(make(LogisticStrokesSettings { omega_max: f64::NAN, ..default }).is_err());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn exact(seed in any::<u64>(), strokes in 2_usize..7, order in orders(), returns in any::<bool>()) {
            let family = family(strokes, order, returns);
            check::derivatives(&family, seed);
            check::gradient(&family, seed);
            check::curvature(&family, seed);
        }

        /// Rest is exact, including jerk, and the motion returns to its start up to rounding of the sum.
        #[test]
        fn rests_exactly(seed in any::<u64>(), strokes in 2_usize..7, order in orders()) {
            let family = family(strokes, order, true);
            let parameters = check::start(&family, seed);
            let mut motion = Motion::default();
            family.motion(&parameters, &[0.0, 10.0], &mut motion);
            for joint in 0..2 {
                let [start, end] = [motion.of(joint).start, motion.of(joint).start + 1];
                for values in [&motion.dq, &motion.ddq, &motion.dddq] {
                    prop_assert_eq!([values[start], values[end]], [0.0, 0.0]);
                }
                prop_assert!((motion.q[start] - motion.q[end]).abs() < 1e-13);
            }
        }
    }
}
