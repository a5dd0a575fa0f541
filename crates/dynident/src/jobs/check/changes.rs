//! From a mistake to the keys that mend it in the study it was made in.

use crate::result::StudyChange;
use crate::study::{Study, StudyRobot};
use core::f64::consts::{PI, TAU};
use core::fmt::Write;
use dynident_identification::Role;
use dynident_identification::diagnosis::{Channels, Mistake};
use dynident_recording::LogFormat;
use dynident_recording::log::{ChannelGroup, ColumnRef, OneOrMany, TimeUnit};
use dynident_text::quoted;

/// Places of a log's format in its study: what is written for it.
pub(super) struct StudyFormat<'a> {
    study: &'a Study,
    robot: &'a StudyRobot,
    format: LogFormat,
    /// `format`, or that of the log itself.
    table: String,
}

impl<'a> StudyFormat<'a> {
    /// The format of the first training log; none in a study without.
    pub(super) fn new(study: &'a Study, robot: &'a StudyRobot) -> Option<Self> {
        let index = *study.logs_of_role(Role::Identify).first()?;
        let of_log = Self::of_log(study, robot, index);
        let is_common = study.log[index].format.is_none();
        Some(if is_common { Self { table: "format".to_owned(), ..of_log } } else { of_log })
    }

    /// The format of log number `index` alone: what the study's other logs have stays as it is.
    pub(super) fn of_log(study: &'a Study, robot: &'a StudyRobot, index: usize) -> Self {
        Self { study, robot, format: study.format_of(index), table: format!("[[log]] {}: format", index + 1) }
    }

    /// Place of a model's joint among the log's joints.
    fn place(&self, joint: usize) -> usize {
        let name = &self.robot.model().joints()[joint].name;
        self.robot.log_joints.iter().position(|log_joint| log_joint == name).unwrap_or(joint)
    }

    fn group(&self, torque: bool) -> (&ChannelGroup, String) {
        let (group, name) = if torque { (&self.format.torque, "torque") } else { (&self.format.position, "position") };
        (group, format!("{}.{name}", self.table))
    }

    /// What to write so that `mistake` is made no more.
    pub(super) fn changes(&self, mistake: &Mistake) -> Vec<StudyChange> {
        match mistake {
            Mistake::Sign { joints, channels } => {
                Self::groups(*channels).into_iter().map(|torque| self.signs(torque, joints)).collect()
            }
            Mistake::Order { order, channels } => {
                Self::groups(*channels).into_iter().filter_map(|torque| self.order(torque, order)).collect()
            }
            Mistake::Offset { joint, offset_rad } => vec![self.offset(*joint, *offset_rad)],
            Mistake::PositionUnit { joints, factor } => vec![self.position_unit(joints, *factor)],
            Mistake::TorqueUnit { joint, factor } => vec![self.one_torque(*joint, *factor)],
            Mistake::Coupled { joint, with, sign, channels } => {
                let groups = Self::groups(*channels).into_iter();
                groups.map(|torque| self.coupled(torque, *joint, *with, *sign)).collect()
            }
            Mistake::TimeUnit { factor } => vec![self.time_unit(*factor)],
            // The key is that of all logs, and positions have none.
            Mistake::Lag { joints, channels: Channels::Torque, lag_s } if self.table == "format" => {
                vec![self.lag(joints, *lag_s)]
            }
            // The description's own, or what only another log has.
            Mistake::Lag { .. } | Mistake::Convention { .. } | Mistake::Length { .. } | Mistake::Compensated => {
                Vec::new()
            }
            Mistake::Gravity { gravity_m_s2 } => {
                let line = format!("gravity_m_s2 = {}", list(&gravity_m_s2.map(|g| number(g, 4))));
                let mut changes = vec![StudyChange { table: "robot".to_owned(), line }];
                if self.study.robot.base_rpy_rad.is_some() || self.study.robot.base_rpy_deg.is_some() {
                    let line = "# without base_rpy_rad and base_rpy_deg".to_owned();
                    changes.push(StudyChange { table: "robot".to_owned(), line });
                }
                changes
            }
        }
    }

    /// `scale` of the torque columns; joints without a value keep 1.
    pub(super) fn torque_scale(&self, scale: &[Option<f64>]) -> StudyChange {
        let (group, table) = self.group(true);
        // Joints that say nothing get what the others have.
        let mut known: Vec<f64> = scale.iter().flatten().copied().collect();
        known.sort_by(f64::total_cmp);
        let usual = known.get(known.len() / 2).copied().unwrap_or(1.0);
        let mut values = vec![significant(usual); scale.len()];
        for (joint, factor) in scale.iter().enumerate() {
            let place = self.place(joint);
            let own = at(group.scale.as_ref(), place, 1.0);
            if let (Some(factor), Some(value)) = (factor, values.get_mut(place)) {
                *value = significant(factor * own);
            }
        }
        StudyChange { table, line: format!("scale = {}", list(&values)) }
    }

    /// `scale` of the torque columns, all in one unit that is worth `unit` Nm (N): one number where they share theirs
    /// so far.
    pub(super) fn torque_unit(&self, unit: f64) -> StudyChange {
        let (group, table) = self.group(true);
        let joints = self.robot.log_joints.len();
        let own: Vec<f64> = (0..joints).map(|place| at(group.scale.as_ref(), place, 1.0)).collect();
        // A unit is exact.
        let value = |own: f64| if own == 1.0 { format!("{unit:?}") } else { significant(unit * own) };
        let line = match own.first() {
            Some(first) if own.iter().all(|other| other == first) => format!("scale = {}", value(*first)),
            _ => format!("scale = {}", list(&own.into_iter().map(value).collect::<Vec<_>>())),
        };
        StudyChange { table, line }
    }

    /// Whether it is the torque's group, for each group that the channels stand for.
    fn groups(channels: Channels) -> Vec<bool> {
        match channels {
            Channels::Position => vec![false],
            Channels::Torque => vec![true],
            Channels::Both => vec![false, true],
        }
    }

    fn signs(&self, torque: bool, joints: &[usize]) -> StudyChange {
        let (group, table) = self.group(torque);
        let places: Vec<usize> = joints.iter().map(|&joint| self.place(joint)).collect();
        if group.matrix.is_some() || group.inverse_matrix.is_some() {
            // A sign belongs to a column, and a joint to a row.
            let (key, what) = if group.matrix.is_some() { ("matrix", "row") } else { ("inverse_matrix", "column") };
            let numbers: Vec<String> = places.iter().map(|place| (place + 1).to_string()).collect();
            return StudyChange { table, line: format!("# {key}: the negative of {what} {}", numbers.join(", ")) };
        }
        let dof = self.robot.log_joints.len();
        let flip = |place: usize| {
            let sign = at(group.sign.as_ref(), place, 1.0);
            if places.contains(&place) { -sign } else { sign }
        };
        let signs: Vec<f64> = (0..dof).map(flip).collect();
        let line = if signs.iter().all(|sign| *sign == signs[0]) {
            format!("sign = {}", signs[0])
        } else {
            format!("sign = {}", list(&signs.iter().map(|sign| format!("{sign}")).collect::<Vec<_>>()))
        };
        StudyChange { table, line }
    }

    fn order(&self, torque: bool, order: &[usize]) -> Option<StudyChange> {
        let (group, table) = self.group(torque);
        let columns = group.column_list("columns").ok()?;
        if columns.len() != self.robot.log_joints.len() {
            return None;
        }
        let mut ordered = columns.clone();
        for (joint, &from) in order.iter().enumerate() {
            ordered[self.place(joint)] = columns[self.place(from)].clone();
        }
        let names: Vec<String> = ordered
            .iter()
            .map(|column| match column {
                ColumnRef::Index(index) => index.to_string(),
                ColumnRef::Name(name) => quoted(name),
            })
            .collect();
        Some(StudyChange { table, line: format!("columns = {}", list(&names)) })
    }

    fn offset(&self, joint: usize, offset_rad: f64) -> StudyChange {
        let (group, table) = self.group(false);
        let place = self.place(joint);
        let with = |at_place: usize| {
            let own = at(group.offset.as_ref(), at_place, 0.0);
            number(if at_place == place { own + offset_rad } else { own }, 4)
        };
        let values: Vec<String> = (0..self.robot.log_joints.len()).map(with).collect();
        StudyChange { table, line: format!("offset = {}", list(&values)) }
    }

    /// `scale` of one joint's torque column beside those of the others.
    fn one_torque(&self, joint: usize, factor: f64) -> StudyChange {
        let (group, table) = self.group(true);
        StudyChange { table, line: format!("scale = {}", self.scales(group, &[joint], factor)) }
    }

    /// The scales of all columns, those of `joints` times `factor`.
    fn scales(&self, group: &ChannelGroup, joints: &[usize], factor: f64) -> String {
        let places: Vec<usize> = joints.iter().map(|&joint| self.place(joint)).collect();
        let value = |place: usize| {
            let own = at(group.scale.as_ref(), place, 1.0);
            if places.contains(&place) { significant(factor * own) } else { format!("{own:?}") }
        };
        list(&(0..self.robot.log_joints.len()).map(value).collect::<Vec<_>>())
    }

    /// The matrix that takes a neighbour's share out of a joint's position, or adds a joint's torque to a neighbour's.
    fn coupled(&self, torque: bool, joint: usize, with: usize, sign: f64) -> StudyChange {
        let (group, table) = self.group(torque);
        let [joint, with] = [joint, with].map(|joint| self.place(joint));
        if group.matrix.is_some() || group.inverse_matrix.is_some() {
            let line = format!("# matrix: rows {} and {} are coupled", joint + 1, with + 1);
            return StudyChange { table, line };
        }
        let (row, column, value) = if torque { (with, joint, sign) } else { (joint, with, -sign) };
        let dof = self.robot.log_joints.len();
        let entry = |at: (usize, usize)| if at == (row, column) { value } else { f64::from(u8::from(at.0 == at.1)) };
        let rows = (0..dof).map(|r| list(&(0..dof).map(|c| format!("{:?}", entry((r, c)))).collect::<Vec<_>>()));
        StudyChange { table, line: format!("matrix = {}", list(&rows.collect::<Vec<_>>())) }
    }

    /// The whole lag of the torque, of all joints or of some.
    fn lag(&self, joints: &[usize], lag_s: f64) -> StudyChange {
        let dof = self.robot.model().dof();
        let stated = self.study.motion.torque_lag_s.as_ref();
        let lag = |joint: usize| if joints.contains(&joint) { lag_s } else { at(stated, joint, 0.0) };
        let line = if joints.len() == dof {
            format!("torque_lag_s = {}", number(lag_s, 3))
        } else {
            format!("torque_lag_s = {}", list(&(0..dof).map(|joint| number(lag(joint), 3)).collect::<Vec<_>>()))
        };
        StudyChange { table: "motion".to_owned(), line }
    }

    fn position_unit(&self, joints: &[usize], factor: f64) -> StudyChange {
        let (group, table) = self.group(false);
        if joints.len() < self.robot.model().dof() {
            return StudyChange { table, line: format!("scale = {}", self.scales(group, joints, factor)) };
        }
        let is = |value: f64| (factor / value - 1.0).abs() < 1e-6;
        let line = if is(180.0 / PI) || is(TAU.recip()) {
            "unit = \"rad\"".to_owned()
        } else if is(PI / 180.0) {
            "unit = \"deg\"".to_owned()
        } else if is(TAU) {
            "unit = \"rev\"".to_owned()
        } else if is(1e-3) {
            "unit = \"mrad\"".to_owned()
        } else {
            format!("scale = {}", significant(factor))
        };
        StudyChange { table, line }
    }

    fn time_unit(&self, factor: f64) -> StudyChange {
        if let Some(rate_hz) = self.format.rate_hz {
            let line = format!("rate_hz = {}", significant(rate_hz / factor));
            return StudyChange { table: self.table.clone(), line };
        }
        let units = [
            (TimeUnit::Seconds, "s"),
            (TimeUnit::Milliseconds, "ms"),
            (TimeUnit::Microseconds, "us"),
            (TimeUnit::Nanoseconds, "ns"),
        ];
        let now = self.format.time.as_ref().map_or(1.0, |time| time.unit.seconds());
        let is_wanted = |unit: &TimeUnit| (unit.seconds() / (now * factor) - 1.0).abs() < 1e-6;
        let fitting = units.iter().find(|(unit, _)| is_wanted(unit)).map(|(_, name)| *name);
        let table = format!("{}.time", self.table);
        let own = self.format.time.as_ref().map_or(1.0, |time| time.scale);
        let scale = || format!("scale = {}", significant(factor * own));
        let line = fitting.map_or_else(scale, |unit| format!("unit = {unit:?}"));
        StudyChange { table, line }
    }
}

fn at(values: Option<&OneOrMany<f64>>, place: usize, otherwise: f64) -> f64 {
    match values {
        None => otherwise,
        Some(OneOrMany::One(value)) => *value,
        Some(OneOrMany::Many(values)) => values.get(place).copied().unwrap_or(otherwise),
    }
}

fn list(values: &[String]) -> String {
    format!("[{}]", values.join(", "))
}

/// With so many decimals at most, and always as a TOML float.
fn number(value: f64, decimals: usize) -> String {
    let mut text = format!("{value:.decimals$}");
    while text.ends_with('0') && !text.ends_with(".0") {
        text.pop();
    }
    if text == "-0.0" { "0.0".to_owned() } else { text }
}

/// Three significant digits; nine of a unit's factor, which is known and not found.
pub(super) fn significant(value: f64) -> String {
    let units = [PI / 180.0, 180.0 / PI, TAU, TAU.recip(), PI, PI.recip()];
    let places = if units.iter().any(|unit| (value / unit - 1.0).abs() < 1e-9) { 8.0 } else { 2.0 };
    let mut text = String::new();
    let digits = if value == 0.0 { 2 } else { (places - value.abs().log10().floor()).clamp(1.0, 12.0) as usize };
    let _ = write!(text, "{value:.digits$}");
    text
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
