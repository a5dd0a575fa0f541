//! Keys of a study that correct a mistake.

use crate::diagnosis::channels::Channels;
use core::f64::consts::{PI, TAU};
use dynident_recording::LogFormat;
use dynident_recording::log::{ChannelGroup, OneOrMany};

/// A key of a study and its new value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeyChange {
    /// The table of the key: `format.torque`, `robot`, `[[log]] 2`.
    pub table: String,
    /// The line to write, as TOML.
    pub line: String,
}

/// Present values of the study keys that corrections may change.
#[derive(Clone, Debug)]
pub struct StudyKeys {
    /// The format of the log.
    pub format: LogFormat,
    /// Name of the format's table in the study: `format`, or the table of one log.
    pub table: String,
    /// For each joint of the model, its index among the joints of the log.
    pub places: Vec<usize>,
    /// Number of joints in the log.
    pub columns: usize,
    /// `torque_lag_s` under `[motion]`.
    pub torque_lag_s: Option<OneOrMany<f64>>,
    /// Whether the study states a rotation of the base.
    pub has_base_rotation: bool,
}

impl StudyKeys {
    /// The columns of positions or torques, if the format has them, and the name of their table.
    pub(super) fn group(&self, channels: Channels) -> (Option<&ChannelGroup>, String) {
        let (group, name) = match channels {
            Channels::Torque => (self.format.torque.as_ref(), "torque"),
            Channels::Position | Channels::Both => (Some(&self.format.position), "position"),
        };
        (group, format!("{}.{name}", self.table))
    }

    /// The columns of logged velocities and accelerations, and the names of their tables.
    pub(super) fn derivatives(&self) -> [(Option<&ChannelGroup>, String); 2] {
        let Self { format, table, .. } = self;
        [
            (format.velocity.as_ref(), format!("{table}.velocity")),
            (format.acceleration.as_ref(), format!("{table}.acceleration")),
        ]
    }

    /// Whether the format applies to all logs.
    pub(super) fn is_common(&self) -> bool {
        self.table == "format"
    }

    /// A change of `key` for positions or torques, with one value for each joint of the log; `value` computes the
    /// values.
    pub(super) fn per_column(&self, channels: Channels, key: &str, value: impl Fn(usize) -> String) -> KeyChange {
        let (_, table) = self.group(channels);
        KeyChange { table, line: format!("{key} = {}", list((0..self.columns).map(value))) }
    }

    /// `matrix` of positions or torques with these values by row (joint) and column of the log. If the study has a
    /// matrix, a comment names the coupled `rows`.
    pub(super) fn matrix(
        &self,
        channels: Channels,
        rows: [usize; 2],
        value: &dyn Fn(usize, usize) -> f64,
    ) -> KeyChange {
        let (group, table) = self.group(channels);
        if group.is_some_and(|group| group.matrix.is_some() || group.inverse_matrix.is_some() || group.sum.is_some()) {
            let line = format!("# matrix: rows {} and {} are coupled", rows[0] + 1, rows[1] + 1);
            return KeyChange { table, line };
        }
        let row = |row: usize| list((0..self.columns).map(|column| format!("{:?}", value(row, column))));
        self.per_column(channels, "matrix", row)
    }

    /// `scale` with the values of `joints` times `factor`.
    pub(super) fn scales(&self, channels: Channels, joints: &[usize], factor: f64) -> KeyChange {
        let (group, _) = self.group(channels);
        let places: Vec<usize> = joints.iter().map(|&joint| self.places[joint]).collect();
        self.per_column(channels, "scale", |place| {
            let own = at(group.and_then(|group| group.scale.as_ref()), place, 1.0);
            if places.contains(&place) { significant(factor * own) } else { format!("{own:?}") }
        })
    }

    /// A change of `scale` for the torque columns: each is multiplied by the factor of its joint. A joint without a
    /// factor keeps its scale, and a comment states the numbers of these columns.
    pub fn torque_scale(&self, factors: &[Option<f64>]) -> KeyChange {
        let (group, table) = self.group(Channels::Torque);
        let factor = |place: usize| {
            let mut own = self.places.iter().zip(factors).filter(|(own, _)| **own == place);
            own.find_map(|(_, factor)| *factor)
        };
        let value = |place: usize| {
            let scale = at(group.and_then(|group| group.scale.as_ref()), place, 1.0);
            factor(place).map_or_else(|| format!("{scale:?}"), |factor| significant(factor * scale))
        };
        let unknown = (0..self.columns).filter(|&place| factor(place).is_none()).map(|place| (place + 1).to_string());
        let unknown = unknown.collect::<Vec<_>>().join(", ");
        let comment = match &unknown[..] {
            "" => String::new(),
            unknown => format!("   # number {unknown} not estimated: take it from the data sheet"),
        };
        KeyChange { table, line: format!("scale = {}{comment}", list((0..self.columns).map(value))) }
    }

    /// A change of `scale` for torque columns that are all in the same unit of `unit` Nm (N): one number if all columns
    /// have the same scale in the study.
    pub fn torque_unit(&self, unit: f64) -> KeyChange {
        let (group, table) = self.group(Channels::Torque);
        let own = group.and_then(|group| group.scale.as_ref());
        let own: Vec<f64> = (0..self.columns).map(|place| at(own, place, 1.0)).collect();
        // A unit is an exact number, so it is not rounded.
        let value = |own: &f64| if *own == 1.0 { format!("{unit:?}") } else { significant(unit * own) };
        let line = match own.first() {
            Some(first) if own.iter().all(|other| other == first) => format!("scale = {}", value(first)),
            _ => format!("scale = {}", list(own.iter().map(value))),
        };
        KeyChange { table, line }
    }
}

pub(super) fn at(values: Option<&OneOrMany<f64>>, place: usize, default: f64) -> f64 {
    values.and_then(|values| values.at(place)).unwrap_or(default)
}

pub(super) fn list(values: impl IntoIterator<Item = String>) -> String {
    format!("[{}]", values.into_iter().collect::<Vec<_>>().join(", "))
}

/// Text of a TOML float with at most `decimals` decimals.
pub(super) fn number(value: f64, decimals: usize) -> String {
    let mut text = format!("{value:.decimals$}");
    while text.ends_with('0') && !text.ends_with(".0") {
        text.pop();
    }
    if text == "-0.0" { "0.0".to_owned() } else { text }
}

/// Text of a number with three significant digits, or nine for the exact factor of a unit.
pub(super) fn significant(value: f64) -> String {
    let units = [PI / 180.0, 180.0 / PI, TAU, TAU.recip(), PI, PI.recip()];
    let places = if units.iter().any(|unit| (value / unit - 1.0).abs() < 1e-9) { 8.0 } else { 2.0 };
    let digits = if value == 0.0 { 2 } else { (places - value.abs().log10().floor()).clamp(1.0, 12.0) as usize };
    format!("{value:.digits$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_toml_floats_without_needless_digits() {
        assert_eq!(
            [number(PI / 2.0, 4), number(0.0, 4), number(-9.81, 4), number(-1e-9, 4)],
            ["1.5708", "0.0", "-9.81", "0.0"]
        );
        assert_eq!([significant(13.61234), significant(0.001234), significant(1234.5)], ["13.6", "0.00123", "1234.5"]);
        assert_eq!(significant(PI / 180.0), "0.0174532925");
    }
}
