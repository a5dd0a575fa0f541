//! Mistake: a reversed sign.

use super::Mistake;
use super::kind::{Breadth, Facts, MistakeKind, Setup, TorqueSource, joint_list, scale};
use super::study_keys::{KeyChange, StudyKeys, at, list};
use crate::diagnosis::channels::Channels;
use crate::diagnosis::motion_rows::MotionRows;
use dynident_dynamics::ParametricModel;
use dynident_recording::log::ChannelGroup;

/// The signs of these joints are reversed. If position and torque are both reversed, the axis is reversed.
#[derive(Clone, Debug, PartialEq)]
pub struct Sign {
    /// The joints.
    pub joints: Vec<usize>,
    /// Positions, torques, or both.
    pub channels: Channels,
}

impl MistakeKind for Sign {
    fn candidates(setup: Setup<'_>, breadth: Breadth<'_>) -> Vec<Self> {
        let Breadth::Usual = breadth else { return Vec::new() };
        let dof = setup.robot.dof();
        let single = (0..dof).map(|joint| vec![joint]);
        let all = (dof > 1).then(|| (0..dof).collect());
        let channels = [Channels::Torque, Channels::Position, Channels::Both];
        single
            .chain(all)
            .flat_map(|joints| channels.map(|channels| Self { joints: joints.clone(), channels }))
            .collect()
    }

    fn correct(&self, _: &ParametricModel, rows: &mut MotionRows) {
        for values in rows.of_mut(self.channels) {
            self.joints.iter().for_each(|&joint| scale(&mut values[joint], -1.0));
        }
    }

    fn facts(&self) -> Facts {
        Facts {
            channels: Some(self.channels),
            joints: Some(self.joints.clone()),
            torques: self.joints.iter().map(|&joint| TorqueSource { joint, from: joint, factor: -1.0 }).collect(),
            // A robot with a negative torque moves like its mirror image with a negative position. The torque is more
            // probable, because robot descriptions do not define its sign.
            likelier_channels: Some(Channels::Torque),
            ..Facts::of("sign")
        }
    }

    fn sentence(&self, names: &[String]) -> String {
        let verb = if self.channels == Channels::Both { "have" } else { "has" };
        format!("{} of {} {verb} the opposite sign", self.channels.text(), joint_list(&self.joints, names))
    }

    fn changes(&self, keys: &StudyKeys) -> Vec<KeyChange> {
        let places: Vec<usize> = self.joints.iter().map(|&joint| keys.places[joint]).collect();
        let of = |channels: Channels| {
            let (group, table) = keys.group(channels);
            let has = |matrix: fn(&ChannelGroup) -> bool| group.is_some_and(matrix);
            if has(|group| group.matrix.is_some() || group.inverse_matrix.is_some()) {
                let (key, what) =
                    if has(|group| group.matrix.is_some()) { ("matrix", "row") } else { ("inverse_matrix", "column") };
                let numbers: Vec<String> = places.iter().map(|place| (place + 1).to_string()).collect();
                return KeyChange { table, line: format!("# {key}: the negative of {what} {}", numbers.join(", ")) };
            }
            let flipped = |place: usize| {
                let sign = at(group.and_then(|group| group.sign.as_ref()), place, 1.0);
                if places.contains(&place) { -sign } else { sign }
            };
            let signs: Vec<f64> = (0..keys.columns).map(flipped).collect();
            let line = if signs.iter().all(|sign| *sign == signs[0]) {
                format!("sign = {}", signs[0])
            } else {
                format!("sign = {}", list(signs.iter().map(f64::to_string)))
            };
            KeyChange { table, line }
        };
        self.channels.each().map(of).collect()
    }

    fn with_channels(&self, channels: Channels) -> Option<Mistake> {
        Some(Self { channels, ..self.clone() }.into())
    }
}
