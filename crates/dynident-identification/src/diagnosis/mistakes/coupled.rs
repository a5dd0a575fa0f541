//! Mistake: a column that also moves with a neighbouring joint.

use super::kind::{Breadth, Facts, MistakeKind, Proof, Setup};
use super::study_keys::{KeyChange, StudyKeys};
use crate::diagnosis::channels::Channels;
use crate::diagnosis::motion_rows::MotionRows;
use dynident_dynamics::ParametricModel;

/// The position column of a joint also moves with another joint: it contains `q_joint + sign q_with`, as at the motor
/// of a parallelogram or of a coupled wrist. If torques are measured at the motors, the column of `τ_with` lacks
/// `sign τ_joint`.
#[derive(Clone, Debug, PartialEq)]
pub struct Coupled {
    /// The joint.
    pub joint: usize,
    /// The other joint with which the column of `joint` moves.
    pub with: usize,
    /// Direction of the coupling, 1 or -1.
    pub sign: f64,
    /// Whether only positions are coupled, or positions and torques.
    pub channels: Channels,
}

impl MistakeKind for Coupled {
    fn candidates(setup: Setup<'_>, breadth: Breadth<'_>) -> Vec<Self> {
        let Breadth::Rare = breadth else { return Vec::new() };
        let is_rotary = |joint: usize| setup.model().joints()[joint].is_rotary();
        let neighbours = (1..setup.robot.dof()).flat_map(|joint| [(joint, joint - 1), (joint - 1, joint)]);
        let ways =
            [(Channels::Position, 1.0), (Channels::Position, -1.0), (Channels::Both, 1.0), (Channels::Both, -1.0)];
        neighbours
            .filter(|&(joint, with)| is_rotary(joint) && is_rotary(with))
            .flat_map(|(joint, with)| ways.map(|(channels, sign)| Self { joint, with, sign, channels }))
            .collect()
    }

    fn correct(&self, _: &ParametricModel, rows: &mut MotionRows) {
        let add = |values: &mut [Vec<f64>], to: usize, from: usize, factor: f64| {
            let added = values[from].clone();
            values[to].iter_mut().zip(added).for_each(|(to, from)| *to += factor * from);
        };
        if self.channels != Channels::Torque {
            rows.of_mut(Channels::Position).for_each(|values| add(values, self.joint, self.with, -self.sign));
        }
        if self.channels != Channels::Position {
            add(&mut rows.tau, self.with, self.joint, self.sign);
        }
    }

    fn facts(&self) -> Facts {
        Facts {
            rarity: 0.15,
            joints: Some(vec![self.joint]),
            adds_torques: true,
            proof: Proof::Joint(self.joint),
            ..Facts::of("coupling")
        }
    }

    fn sentence(&self, names: &[String]) -> String {
        format!(
            "{channels} of joint `{joint}` {belong} to a motor that also turns with joint `{with}`: the column contains `{joint}` {sign} `{with}`",
            channels = self.channels.text(),
            joint = names[self.joint],
            belong = if self.channels == Channels::Both { "belong" } else { "belongs" },
            with = names[self.with],
            sign = if self.sign > 0.0 { "+" } else { "-" },
        )
    }

    /// The matrix for the study that removes the other joint from the position, or adds the torque to the torque of the
    /// other joint.
    fn changes(&self, keys: &StudyKeys) -> Vec<KeyChange> {
        let [joint, with] = [self.joint, self.with].map(|joint| keys.places[joint]);
        let of = |channels: Channels| {
            let (place, value) =
                if channels == Channels::Torque { ([with, joint], self.sign) } else { ([joint, with], -self.sign) };
            keys.matrix(channels, [joint, with], &|row, column| {
                if [row, column] == place { value } else { f64::from(u8::from(row == column)) }
            })
        };
        self.channels.each().map(of).collect()
    }
}
