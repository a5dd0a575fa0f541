//! Mistake: a wrong zero of a joint position.

use super::Mistake;
use super::kind::{Breadth, Facts, MistakeKind, Proof, Setup};
use super::numbers::Number;
use super::study_keys::{KeyChange, StudyKeys, at, number};
use crate::diagnosis::channels::Channels;
use crate::diagnosis::motion_rows::MotionRows;
use core::f64::consts::{FRAC_PI_2, FRAC_PI_6, PI};
use dynident_dynamics::ParametricModel;

/// Offsets to try, rad: a quarter turn, half a turn, or small offsets. A search finds offsets between these.
const OFFSETS_RAD: [f64; 7] = [-FRAC_PI_2, FRAC_PI_2, PI, -FRAC_PI_6, FRAC_PI_6, -FRAC_PI_6 / 3.0, FRAC_PI_6 / 3.0];
/// Smaller offsets to try if base parameters are known, rad.
const SMALL_OFFSETS_RAD: [f64; 6] = [-0.3, -0.15, -0.07, 0.07, 0.15, 0.3];
/// Factors on an offset that are tried with random robots, to test whether the improvement is due to chance.
const OTHER_OFFSETS: [f64; 6] = [-1.0, -0.5, -0.25, 0.25, 0.5, 1.0];

/// A wrong zero of a joint's position.
#[derive(Clone, Debug, PartialEq)]
pub struct Offset {
    /// The joint.
    pub joint: usize,
    /// Offset to add to the position, rad.
    pub offset_rad: f64,
}

impl MistakeKind for Offset {
    fn candidates(setup: Setup<'_>, breadth: Breadth<'_>) -> Vec<Self> {
        let offsets_rad: &[f64] = match breadth {
            Breadth::Usual => &OFFSETS_RAD,
            Breadth::Rare => &[],
            Breadth::KnownRobot(_) => &SMALL_OFFSETS_RAD,
        };
        let of = |joint: usize| offsets_rad.iter().map(move |&offset_rad| Self { joint, offset_rad });
        setup.turning().flat_map(of).collect()
    }

    fn correct(&self, _: &ParametricModel, rows: &mut MotionRows) {
        rows.q[self.joint].iter_mut().for_each(|q| *q += self.offset_rad);
    }

    fn facts(&self) -> Facts {
        let is_round = (self.offset_rad / FRAC_PI_2).fract() == 0.0;
        Facts {
            rarity: 0.15,
            joints: Some(vec![self.joint]),
            proof: Proof::Torque,
            number: Some(Number { is_round, ..Number::angle(self.offset_rad, 0.5) }),
            other_numbers: OTHER_OFFSETS.map(|times| times * self.offset_rad).to_vec(),
            ..Facts::of("offset")
        }
    }

    fn sentence(&self, names: &[String]) -> String {
        format!(
            "the zero of joint `{}` differs by {:.1} degrees from that of the robot description",
            names[self.joint],
            self.offset_rad * 180.0 / PI
        )
    }

    fn changes(&self, keys: &StudyKeys) -> Vec<KeyChange> {
        let (group, _) = keys.group(Channels::Position);
        let with = |place: usize| {
            let own = at(group.and_then(|group| group.offset.as_ref()), place, 0.0);
            number(if place == keys.places[self.joint] { own + self.offset_rad } else { own }, 4)
        };
        vec![keys.per_column(Channels::Position, "offset", with)]
    }

    fn with_number(&self, offset_rad: f64) -> Option<Mistake> {
        Some(Self { offset_rad, ..*self }.into())
    }
}
