//! Mistake: positions in another unit.

use super::Mistake;
use super::kind::{Breadth, Facts, MistakeKind, Proof, Setup, joint_list, scale};
use super::numbers::{MAX_RATIO_OF_ONE_FACTOR, MIN_LOG_RATIO_TO_UNIT, Number};
use super::study_keys::{KeyChange, StudyKeys, significant};
use crate::diagnosis::channels::Channels;
use crate::diagnosis::motion_rows::MotionRows;
use core::f64::consts::{PI, TAU};
use dynident_dynamics::ParametricModel;

/// Factors to try: degrees, revolutions, degrees or revolutions converted twice, half revolutions, gear ratios of about
/// 100, milliradians, encoder counts. A search finds gear ratios and encoder counts between these.
const UNITS: [f64; 10] = [PI / 180.0, TAU, 180.0 / PI, 1.0 / TAU, PI, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6];
/// Factors to try for one revolute joint, including factors of two.
const UNITS_OF_ONE: [f64; 8] = [PI / 180.0, TAU, 180.0 / PI, 1.0 / TAU, 0.5, 2.0, 1e-3, 1e-4];
/// Factors to try for one prismatic joint.
const UNITS_OF_ONE_LENGTH: [f64; 4] = [1e-3, 1e3, 0.5, 2.0];
/// Factors that are exact units. Other factors belong to gears or encoders.
const EXACT_UNITS: [f64; 8] = [PI / 180.0, TAU, 180.0 / PI, 1.0 / TAU, PI, 0.5, 2.0, 1e-3];

/// Travel of a joint divided by its range in the description, above which the unit is far too small.
const MAX_TRAVEL_RANGES: f64 = 2.0;
/// Half-width of the search for gear ratios and encoder counts, as the logarithm of the factor.
const SEARCH_REACH: f64 = 2.0;

/// The positions of these joints are in another unit, or were measured on the motor side of the gear.
#[derive(Clone, Debug, PartialEq)]
pub struct PositionUnit {
    /// The joints.
    pub joints: Vec<usize>,
    /// Factor on positions.
    pub factor: f64,
}

impl PositionUnit {
    fn number(&self) -> Number {
        Number { is_round: EXACT_UNITS.contains(&self.factor), ..Number::factor(self.factor, SEARCH_REACH) }
    }

    fn is_shown_by_travel(&self) -> bool {
        self.joints.len() == 1 && self.factor < MAX_TRAVEL_RANGES.recip()
    }

    /// Candidates for the unit of one joint's position. Units that are far too small are tried only if the joint
    /// travels too far.
    fn of_one(setup: Setup<'_>, joint: usize) -> impl Iterator<Item = Self> {
        let description = &setup.model().joints()[joint];
        let units: &[f64] = if description.is_rotary() { &UNITS_OF_ONE } else { &UNITS_OF_ONE_LENGTH };
        let range = description.limits.lower.zip(description.limits.upper).map_or(0.0, |(lower, upper)| upper - lower);
        let range = if range > 0.0 || !description.is_rotary() { range } else { 2.0 * TAU };
        let q = setup.rows.q[joint].iter().copied();
        let travel = q.clone().fold(f64::NEG_INFINITY, f64::max) - q.fold(f64::INFINITY, f64::min);
        let all = units.iter().map(move |&factor| Self { joints: vec![joint], factor });
        all.filter(move |unit| !unit.is_shown_by_travel() || travel > MAX_TRAVEL_RANGES * range)
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
            return format!(
                "the positions are in another unit or on the motor side: multiply them by {factor:.6} to get rad"
            );
        }
        format!(
            "the position of {} has a different unit, or is on the motor side: multiply it by {factor:.6} to get rad (m)",
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
        if greatest <= MAX_RATIO_OF_ONE_FACTOR * least {
            return String::new();
        }
        let [least, greatest] = range.map(significant);
        format!(
            "; these logs do not distinguish factors between {least} and {greatest}: use the gear ratio, or the counts of the encoder, from the data sheet"
        )
    }

    fn with_number(&self, factor: f64) -> Option<Mistake> {
        Some(Self { factor, ..self.clone() }.into())
    }

    /// The best factor nearby; `None` if it is too near to a unit.
    fn with_best_number(&self, value: &dyn Fn(&Mistake) -> f64) -> Option<Mistake> {
        let with = |factor: f64| Self { factor, ..self.clone() }.into();
        let found = self.number().minimum(|factor| value(&with(factor)));
        let is_unit = self.number().is_round && (found / self.factor).ln().abs() < MIN_LOG_RATIO_TO_UNIT;
        (!is_unit).then(|| with(found))
    }
}
