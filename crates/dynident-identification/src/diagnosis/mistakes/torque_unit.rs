//! Mistake: the torque of one joint in another unit.

use super::Mistake;
use super::kind::{Breadth, Facts, MistakeKind, Proof, Setup, TorqueSource, scale};
use super::numbers::{MIN_LOG_RATIO_TO_UNIT, Number};
use super::study_keys::{KeyChange, StudyKeys, significant};
use crate::diagnosis::channels::Channels;
use crate::diagnosis::motion_rows::MotionRows;
use crate::diagnosis::span::dot;
use dynident_dynamics::ParametricModel;

/// Factors to try: units, gear ratios, one motor of two. A search finds factors between these, such as motor constants.
const UNITS: [f64; 16] = [0.77, 1.3, 0.6, 1.6, 0.5, 2.0, 0.2, 5.0, 0.1, 10.0, 0.03, 30.0, 0.01, 100.0, 1e-3, 1e3];
/// Factors that are exact units, or one motor of two. Other factors belong to gears or motor constants.
const EXACT_UNITS: [f64; 8] = [0.5, 2.0, 0.1, 10.0, 0.01, 100.0, 1e-3, 1e3];
/// Factors that are reported as a gain, not as a unit.
const GAIN_FACTORS: core::ops::RangeInclusive<f64> = 0.4..=2.5;

/// The torque of one joint has a different unit.
#[derive(Clone, Debug, PartialEq)]
pub struct TorqueUnit {
    /// The joint.
    pub joint: usize,
    /// Factor on the joint's torque.
    pub factor: f64,
}

impl MistakeKind for TorqueUnit {
    fn candidates(setup: Setup<'_>, breadth: Breadth<'_>) -> Vec<Self> {
        let dof = setup.robot.dof();
        let min_gain = setup.settings.held_out.min_torque_gain;
        let known = |explained: &[f64], joint: usize| {
            let tau = &setup.rows.tau[joint];
            let factor = dot(explained, tau) / dot(tau, tau);
            let is_clear = factor > 0.0 && factor.ln().abs() > min_gain.ln();
            is_clear.then_some(Self { joint, factor })
        };
        match breadth {
            Breadth::Rare if dof > 1 => (0..dof).flat_map(|joint| UNITS.map(|factor| Self { joint, factor })).collect(),
            Breadth::KnownRobot(explained) => (0..dof).filter_map(|joint| known(&explained[joint], joint)).collect(),
            Breadth::Usual | Breadth::Rare => Vec::new(),
        }
    }

    fn correct(&self, _: &ParametricModel, rows: &mut MotionRows) {
        scale(&mut rows.tau[self.joint], self.factor);
    }

    fn facts(&self) -> Facts {
        let is_round = EXACT_UNITS.contains(&self.factor);
        Facts {
            rarity: 0.15,
            channels: Some(Channels::Torque),
            joints: Some(vec![self.joint]),
            torques: vec![TorqueSource { joint: self.joint, from: self.joint, factor: self.factor }],
            torque_gain: Some(self.joint),
            proof: Proof::JointGain(self.joint),
            number: Some(Number { is_round, ..Number::factor(self.factor, 1.2) }),
            ..Facts::of("unit")
        }
    }

    fn sentence(&self, names: &[String]) -> String {
        let (name, factor) = (&names[self.joint], self.factor);
        if GAIN_FACTORS.contains(&factor) {
            return format!(
                "the torque of joint `{name}` has another gain (motor constant, gear ratio) than in the study: multiply it by {factor:.3} to get Nm (N)"
            );
        }
        format!(
            "the torque of joint `{name}` has a different unit, or is on the motor side: multiply it by {} to get Nm (N)",
            significant(factor)
        )
    }

    fn changes(&self, keys: &StudyKeys) -> Vec<KeyChange> {
        vec![keys.scales(Channels::Torque, &[self.joint], self.factor)]
    }

    fn with_number(&self, factor: f64) -> Option<Mistake> {
        Some(Self { factor, ..*self }.into())
    }

    fn nearest_unit(&self) -> Option<Mistake> {
        let is_near = |unit: &f64| *unit != self.factor && (self.factor / unit).ln().abs() < MIN_LOG_RATIO_TO_UNIT;
        self.with_number(EXACT_UNITS.into_iter().find(is_near)?)
    }
}
