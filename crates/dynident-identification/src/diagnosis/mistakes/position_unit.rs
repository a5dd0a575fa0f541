//! Positions in another unit.

use super::Mistake;
use super::kind::{Breadth, Facts, MistakeKind, Proof, Setup, joint_list, scale};
use super::numbers::Number;
use super::study_keys::{KeyChange, StudyKeys, significant};
use crate::diagnosis::channels::Channels;
use crate::diagnosis::motion_rows::MotionRows;
use core::f64::consts::{PI, TAU};
use dynident_dynamics::ParametricModel;

/// Factors of positions in other units: degrees, revolutions and what somebody converted twice, half revolutions, gears
/// of about a hundred, milliradians, counts of encoders. Gears and counts between these are found from the nearest.
const UNITS: [f64; 10] = [PI / 180.0, TAU, 180.0 / PI, 1.0 / TAU, PI, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6];
/// The same of one joint, which may also be counted twice or by halves.
const UNITS_OF_ONE: [f64; 8] = [PI / 180.0, TAU, 180.0 / PI, 1.0 / TAU, 0.5, 2.0, 1e-3, 1e-4];
/// The same of one prismatic joint.
const UNITS_OF_ONE_LENGTH: [f64; 4] = [1e-3, 1e3, 0.5, 2.0];
/// Factors that are exactly a unit's; others are those of gears or encoders.
const EXACT_UNITS: [f64; 8] = [PI / 180.0, TAU, 180.0 / PI, 1.0 / TAU, PI, 0.5, 2.0, 1e-3];

/// Travel beyond which a joint's unit is far too small, in ranges of the joint.
const MAX_TRAVEL: f64 = 2.0;
/// Reach of the logarithm of a factor in which gears and counts of encoders are searched.
const REACH: f64 = 2.0;
/// Ratio of two factors from which they are different in words.
const SAME_FACTOR: f64 = 1.1;

/// The positions of these joints are in another unit, or those of the motors' side.
#[derive(Clone, Debug, PartialEq)]
pub struct PositionUnit {
    /// Which joints.
    pub joints: Vec<usize>,
    /// What to multiply positions by.
    pub factor: f64,
}

impl PositionUnit {
    fn number(&self) -> Number {
        Number { is_round: EXACT_UNITS.contains(&self.factor), ..Number::factor(self.factor, REACH) }
    }

    fn is_shown_by_travel(&self) -> bool {
        self.joints.len() == 1 && self.factor < MAX_TRAVEL.recip()
    }

    /// Units of the position of one joint. Units that are far too small are tried where the travel shows them.
    fn of_one(setup: Setup<'_>, joint: usize) -> impl Iterator<Item = Self> {
        let description = &setup.model().joints()[joint];
        let units: &[f64] = if description.turns() { &UNITS_OF_ONE } else { &UNITS_OF_ONE_LENGTH };
        let range = description.limits.lower.zip(description.limits.upper).map_or(0.0, |(lower, upper)| upper - lower);
        let range = if range > 0.0 || !description.turns() { range } else { 2.0 * TAU };
        let q = setup.rows.q[joint].iter().copied();
        let travel = q.clone().fold(f64::NEG_INFINITY, f64::max) - q.fold(f64::INFINITY, f64::min);
        let all = units.iter().map(move |&factor| Self { joints: vec![joint], factor });
        all.filter(move |unit| !unit.is_shown_by_travel() || travel > MAX_TRAVEL * range)
    }
}

impl MistakeKind for PositionUnit {
    fn candidates(setup: Setup<'_>, breadth: Breadth<'_>) -> Vec<Self> {
        let dof = setup.robot.dof();
        match breadth {
            Breadth::Usual if setup.turning().next().is_some() => {
                UNITS.map(|factor| Self { joints: (0..dof).collect(), factor }).to_vec()
            }
            Breadth::Rare if dof > 1 => (0..dof).flat_map(|joint| Self::of_one(setup, joint)).collect(),
            _ => Vec::new(),
        }
    }

    fn correct(&self, _: &ParametricModel, rows: &mut MotionRows) {
        for values in rows.of_mut(Channels::Position) {
            self.joints.iter().for_each(|&joint| scale(&mut values[joint], self.factor));
        }
    }

    fn facts(&self) -> Facts {
        Facts {
            // A unit of one joint alone is rarer than one of all, or than another rate.
            rarity: if self.joints.len() == 1 { 0.15 } else { 0.0 },
            joints: Some(self.joints.clone()),
            position_factor: Some(self.factor),
            proof: match self.joints[..] {
                [joint] if self.is_shown_by_travel() => Proof::Travel(joint),
                [joint] => Proof::JointGain(joint),
                _ => Proof::Score,
            },
            number: Some(self.number()),
            ..Facts::of("unit")
        }
    }

    fn sentence(&self, names: &[String]) -> String {
        let factor = self.factor;
        if self.joints.len() == names.len() {
            return format!("the positions are in another unit or of the motor side: times {factor:.6} they are rad");
        }
        format!(
            "the position of {} is in another unit than the others, or of the motor side: times {factor:.6} it is rad (m)",
            joint_list(&self.joints, names)
        )
    }

    fn changes(&self, keys: &StudyKeys) -> Vec<KeyChange> {
        if self.joints.len() < keys.places.len() {
            return vec![keys.scales(Channels::Position, &self.joints, self.factor)];
        }
        let (_, table) = keys.group(Channels::Position);
        let units = [(180.0 / PI, "rad"), (TAU.recip(), "rad"), (PI / 180.0, "deg"), (TAU, "rev"), (1e-3, "mrad")];
        let unit = units.iter().find(|(value, _)| (self.factor / value - 1.0).abs() < 1e-6);
        let scale = || format!("scale = {}", significant(self.factor));
        vec![KeyChange { table, line: unit.map_or_else(scale, |(_, unit)| format!("unit = \"{unit}\"")) }]
    }

    fn other_factors(&self, range: [f64; 2]) -> String {
        let [least, greatest] = range;
        if greatest <= SAME_FACTOR * least {
            return String::new();
        }
        let [least, greatest] = range.map(significant);
        format!(
            "; these logs cannot tell it from any between {least} and {greatest}: take gear ratios, or counts of encoders, from the data sheet"
        )
    }

    fn with_number(&self, factor: f64) -> Option<Mistake> {
        Some(Self { factor, ..self.clone() }.into())
    }

    /// A gear ratio may be near a unit.
    fn between(&self, value: &dyn Fn(&Mistake) -> f64) -> Option<Mistake> {
        let with = |factor: f64| Self { factor, ..self.clone() }.into();
        let found = self.number().least(|factor| value(&with(factor)));
        let is_unit = self.number().is_round && (found / self.factor).ln().abs() < 0.1;
        (!is_unit).then(|| with(found))
    }
}
