//! Columns of the two motors of a differential in place of its two joints.

use super::kind::{Breadth, Facts, MistakeKind, Proof, Setup};
use super::study_keys::{KeyChange, StudyKeys};
use crate::diagnosis::channels::Channels;
use crate::diagnosis::motion_rows::MotionRows;
use dynident_dynamics::ParametricModel;

/// The columns of two neighbouring joints belong to the two motors of a differential (as in a wrist with two bevel
/// gears): with the signs `S` of both motors (columns) at both joints (rows),
///
/// ```text
/// q = ½ S q_motor,   τ = S τ_motor,   q_motor = Sᵀ q
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Differential {
    /// Both joints.
    pub joints: [usize; 2],
    /// `S`, by rows.
    pub signs: [[f64; 2]; 2],
    /// Positions, torques, or both.
    pub channels: Channels,
}

/// Signs of the motors; others are these with the sign of one joint or of both motors reversed.
const SIGNS: [[[f64; 2]; 2]; 4] =
    [[[1.0, 1.0], [1.0, -1.0]], [[1.0, 1.0], [-1.0, 1.0]], [[1.0, -1.0], [1.0, 1.0]], [[-1.0, 1.0], [1.0, 1.0]]];

impl MistakeKind for Differential {
    fn candidates(setup: Setup<'_>, breadth: Breadth<'_>) -> Vec<Self> {
        let Breadth::Rare = breadth else { return Vec::new() };
        let is_rotary = |joint: usize| setup.model().joints()[joint].is_rotary();
        let pairs = (1..setup.robot.dof()).map(|joint| [joint - 1, joint]);
        let pairs = pairs.filter(|joints| joints.iter().all(|&joint| is_rotary(joint)));
        let channels = [Channels::Both, Channels::Position, Channels::Torque];
        pairs
            .flat_map(|joints| SIGNS.map(|signs| channels.map(|channels| Self { joints, signs, channels })))
            .flatten()
            .collect()
    }

    fn correct(&self, _: &ParametricModel, rows: &mut MotionRows) {
        let mix = |values: &mut [Vec<f64>], factor: f64| {
            let [first, second] = self.joints.map(|joint| values[joint].clone());
            for (joint, [a, b]) in self.joints.into_iter().zip(self.signs) {
                for (value, (first, second)) in values[joint].iter_mut().zip(first.iter().zip(&second)) {
                    *value = factor * (a * first + b * second);
                }
            }
        };
        if self.channels != Channels::Torque {
            rows.of_mut(Channels::Position).for_each(|values| mix(values, POSITION_FACTOR));
        }
        if self.channels != Channels::Position {
            mix(&mut rows.tau, 1.0);
        }
    }

    fn facts(&self) -> Facts {
        Facts {
            rarity: 0.15,
            joints: Some(self.joints.to_vec()),
            adds_torques: true,
            proof: Proof::Joint(self.joints[1]),
            ..Facts::of("coupling")
        }
    }

    fn sentence(&self, names: &[String]) -> String {
        let [first, second] = self.joints.map(|joint| &names[joint]);
        let sign = |value: f64, leading: bool| match (value > 0.0, leading) {
            (true, true) => "",
            (true, false) => "+ ",
            (false, true) => "-",
            (false, false) => "- ",
        };
        let [[a, b], [c, d]] = self.signs;
        format!(
            "joints `{first}` and `{second}` have a differential, and their columns contain {channels} of its motors, which turn with {}`{first}` {}`{second}` and {}`{first}` {}`{second}`",
            sign(a, true),
            sign(c, false),
            sign(b, true),
            sign(d, false),
            channels = self.channels.text(),
        )
    }

    fn changes(&self, keys: &StudyKeys) -> Vec<KeyChange> {
        let places = self.joints.map(|joint| keys.places[joint]);
        let of = |channels: Channels| {
            let factor = if channels == Channels::Torque { 1.0 } else { POSITION_FACTOR };
            let own = |values: &[usize; 2], at: usize| values.iter().position(|&place| place == at);
            keys.matrix(channels, places, &|row, column| match (own(&places, row), own(&places, column)) {
                (Some(joint), Some(motor)) => factor * self.signs[joint][motor],
                _ => f64::from(u8::from(row == column)),
            })
        };
        self.channels.each().map(of).collect()
    }
}

/// Factor of the position of a joint on the sum or difference of its motors.
const POSITION_FACTOR: f64 = 0.5;
