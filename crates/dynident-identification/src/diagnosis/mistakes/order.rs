//! Mistake: columns in another order.

use super::Mistake;
use super::kind::{Breadth, Facts, MistakeKind, Setup, TorqueSource};
use super::study_keys::{KeyChange, StudyKeys, list};
use crate::diagnosis::channels::Channels;
use crate::diagnosis::motion_rows::MotionRows;
use dynident_dynamics::ParametricModel;
use dynident_recording::log::{ChannelGroup, ColumnRef};
use dynident_text::quoted;

/// The columns are in another order: joint `j` must get the columns that the study assigns to joint `order[j]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    /// For each joint, the joint to which the study assigns its columns.
    pub order: Vec<usize>,
    /// Positions, torques, or both.
    pub channels: Channels,
}

impl MistakeKind for Order {
    /// Candidates: two exchanged joints, the reverse order, or a shift by one joint.
    fn candidates(setup: Setup<'_>, breadth: Breadth<'_>) -> Vec<Self> {
        let Breadth::Usual = breadth else { return Vec::new() };
        let dof = setup.robot.dof();
        let exchanged = |a: usize, b: usize| {
            let mut order: Vec<usize> = (0..dof).collect();
            order.swap(a, b);
            order
        };
        let mut orders: Vec<Vec<usize>> =
            (0..dof).flat_map(|a| (a + 1..dof).map(move |b| (a, b))).map(|(a, b)| exchanged(a, b)).collect();
        if dof > 2 {
            orders.push((0..dof).rev().collect());
            orders.push((0..dof).map(|joint| (joint + 1) % dof).collect());
            orders.push((0..dof).map(|joint| (joint + dof - 1) % dof).collect());
        }
        let channels = [Channels::Both, Channels::Torque, Channels::Position];
        orders.into_iter().flat_map(|order| channels.map(|channels| Self { order: order.clone(), channels })).collect()
    }

    fn correct(&self, _: &ParametricModel, rows: &mut MotionRows) {
        for values in rows.of_mut(self.channels) {
            *values = self.order.iter().map(|&from| values[from].clone()).collect();
        }
    }

    fn facts(&self) -> Facts {
        let source = |(joint, &from): (usize, &usize)| TorqueSource { joint, from, factor: 1.0 };
        Facts {
            rarity: 0.05,
            channels: Some(self.channels),
            torques: self.order.iter().enumerate().map(source).collect(),
            ..Facts::of("order")
        }
    }

    fn sentence(&self, names: &[String]) -> String {
        let channels = self.channels.text();
        let moved: Vec<usize> = (0..self.order.len()).filter(|&joint| self.order[joint] != joint).collect();
        if let [a, b] = moved[..] {
            return format!("{channels} of joints `{}` and `{}` are exchanged", names[a], names[b]);
        }
        let from: Vec<String> = self.order.iter().map(|&joint| format!("`{}`", names[joint])).collect();
        format!(
            "the columns of {channels} are in another order: the study has {}, the correct order is {}",
            names.join(", "),
            from.join(", ")
        )
    }

    fn changes(&self, keys: &StudyKeys) -> Vec<KeyChange> {
        let of = |(group, table): (Option<&ChannelGroup>, String)| {
            let columns = group?.column_list("columns").ok().filter(|columns| columns.len() == keys.columns)?;
            let mut ordered = columns.clone();
            for (joint, &from) in self.order.iter().enumerate() {
                ordered[keys.places[joint]] = columns[keys.places[from]].clone();
            }
            let name = |column: ColumnRef| match column {
                ColumnRef::Index(index) => index.to_string(),
                ColumnRef::Name(name) => quoted(&name),
            };
            Some(KeyChange { table, line: format!("columns = {}", list(ordered.into_iter().map(name))) })
        };
        let groups = self.channels.each().map(|channels| keys.group(channels));
        // Velocities and accelerations are reordered together with the positions.
        let is_of_position = self.channels.each().any(|channels| channels == Channels::Position);
        groups.chain(is_of_position.then(|| keys.derivatives()).into_iter().flatten()).filter_map(of).collect()
    }

    fn with_channels(&self, channels: Channels) -> Option<Mistake> {
        Some(Self { channels, ..self.clone() }.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn velocities_follow_the_order_of_the_positions() {
        let format = "rate_hz = 100.0\nposition = { columns = \"q{1..3}\" }\nvelocity = { columns = \"v{1..3}\" }\n\
                      torque = { columns = \"tau{1..3}\" }";
        let keys = StudyKeys {
            format: toml::from_str(format).unwrap(),
            table: "format".to_owned(),
            places: vec![0, 1, 2],
            columns: 3,
            torque_lag_s: None,
            has_base_rotation: false,
        };
        let changed = |channels| {
            let changes = Order { order: vec![1, 0, 2], channels }.changes(&keys);
            changes.into_iter().map(|change| format!("{} {}", change.table, change.line)).collect::<Vec<_>>()
        };
        let line =
            |table: &str, name: &str| format!("format.{table} columns = [\"{name}2\", \"{name}1\", \"{name}3\"]");
        let [position, torque, velocity] = [line("position", "q"), line("torque", "tau"), line("velocity", "v")];
        assert_eq!(changed(Channels::Both), [position.clone(), torque.clone(), velocity.clone()]);
        assert_eq!(changed(Channels::Position), [position, velocity]);
        assert_eq!(changed(Channels::Torque), [torque]);
    }
}
