//! Units of positions and commands whose names contain no unit, and grippers that are logged as a share of their
//! range.

use super::channels::GRIPPERS;
use super::draft::Table;
use super::recognised::RecognisedColumns;
use crate::jobs::columns::Family;
use crate::result::LogContents;
use dynident_model::{JointKind, Model};
use dynident_text::quoted;
use std::path::Path;

/// Logged position of an open gripper, if it is logged as a share of its range: 1, or 100 for percent.
const FULL_RANGES: [f64; 2] = [1.0, 100.0];
/// Largest amount by which a logged share can exceed the full range, as a part of the full range.
const MAX_EXCESS: f64 = 0.1;

/// A gripper that is logged as a share of its range.
struct Gripper {
    /// Index of its column.
    place: usize,
    /// Value of the full range in the log: 1 or 100.
    full: f64,
    /// Position limits, rad or m.
    limits: [f64; 2],
}

/// Units of positions and commands that follow from their values.
pub(super) struct PositionUnits {
    columns: usize,
    gripper: Option<Gripper>,
    /// Largest position of a revolute joint, if it is implausible in radians.
    implausible: Option<f64>,
    /// For each column, the largest position of a prismatic joint.
    travel: Vec<Option<f64>>,
    max_travel_m: f64,
}

impl PositionUnits {
    pub(super) fn of(recognised: &RecognisedColumns, model: &Model, logs: &[(&Path, LogContents)]) -> Self {
        let [positions, drive] = &recognised.columns;
        let joints = &recognised.logged.joints;
        let range = |name: &String, file: usize| {
            let channel = logs[file].1.channels.iter().find(|channel| channel.name == *name)?;
            channel.range
        };
        // In a log of commands, positions and commands have the same unit.
        let ranges = |place: usize| {
            let is_alone = recognised.drive.file != recognised.position.file || !recognised.has_commands();
            let files = if is_alone { &[recognised.position.file][..] } else { &recognised.files[..] };
            let own = files.iter().filter_map(|&file| range(&positions[place], file));
            let of_drive = if is_alone { &[recognised.drive.file][..] } else { files };
            let commands = of_drive.iter().filter(|_| recognised.has_commands());
            own.chain(commands.filter_map(|&file| range(&drive[place], file)))
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], [from, to]| [low.min(from), high.max(to)])
        };
        let gripper = |place: usize| {
            let joint = &model.joints()[joints[place]];
            let is_named = GRIPPERS.iter().any(|name| joint.name.to_lowercase().contains(name));
            let limits = [joint.limits.lower?, joint.limits.upper?];
            let [low, high] = ranges(place);
            let is_share = |full: &f64| low >= -MAX_EXCESS * full && high <= (1.0 + MAX_EXCESS) * full;
            let full = FULL_RANGES.into_iter().find(is_share)?;
            // Positions between the limits can be radians, except those from 0 to 1.
            let is_inside = low >= limits[0] && high <= limits[1];
            let is_unit_share = full == FULL_RANGES[0] && low >= 0.0;
            (is_named && limits[0] < limits[1] && (!is_inside || is_unit_share)).then_some(Gripper {
                place,
                full,
                limits,
            })
        };
        let gripper = (0..joints.len()).find_map(|place| gripper(place).filter(|_| recognised.has_commands()));
        let is_turning = |place: &usize| {
            model.joints()[joints[*place]].kind != JointKind::Prismatic
                && gripper.as_ref().is_none_or(|gripper| gripper.place != *place)
        };
        let most = (0..joints.len()).filter(is_turning).map(|place| {
            let [low, high] = ranges(place);
            if low <= high { high.max(-low) } else { 0.0 }
        });
        let most = most.fold(0.0, f64::max);
        let limit = recognised.thresholds.max_radian_turns * core::f64::consts::TAU;
        let is_prismatic = |place: usize| {
            model.joints()[joints[place]].kind == JointKind::Prismatic
                && gripper.as_ref().is_none_or(|gripper| gripper.place != place)
        };
        let travel = (0..joints.len()).map(|place| {
            let [low, high] = ranges(place);
            is_prismatic(place).then(|| high.max(-low))
        });
        Self {
            columns: joints.len(),
            travel: travel.collect(),
            max_travel_m: recognised.thresholds.max_travel_m,
            implausible: (most > limit).then_some(most),
            gripper,
        }
    }

    /// Whether the positions are probably in degrees; `stated` is the unit in their names.
    pub(super) fn are_degrees(&self, stated: Option<&'static str>) -> bool {
        stated == Some("deg") || stated.is_none() && self.implausible.is_some()
    }

    /// Unit of a joint that is not among the columns.
    pub(super) fn unit_of_joint(&self, kind: JointKind, stated: Option<&'static str>) -> &'static str {
        match (stated, kind) {
            (Some(unit), _) => unit,
            (None, JointKind::Prismatic) => "m",
            (None, _) if self.implausible.is_some() => "deg",
            (None, _) => "rad",
        }
    }

    /// Unit of a column of `family`, and the reason for a doubt.
    fn unit(&self, place: usize, stated: Option<&'static str>) -> (&'static str, Option<String>) {
        match (stated, self.travel[place]) {
            (Some(unit @ ("m" | "mm")), _) | (Some(unit), None) => (unit, None),
            (_, Some(travel)) if travel > self.max_travel_m => {
                ("mm", Some(format!("a prismatic joint moves to {travel:.1}, which is implausible in metres")))
            }
            (_, Some(_)) => ("m", None),
            (None, None) => self.implausible.map_or(("rad", None), |most| {
                let reason = format!(
                    "a joint moves to {most:.1}, which is implausible in radians: degrees, or motor-side positions"
                );
                ("deg", Some(reason))
            }),
        }
    }

    /// Returns `table` with the unit of its `columns`, and the range of a gripper.
    pub(super) fn with_unit(&self, table: Table, family: &Family, columns: &[String]) -> Table {
        let stated = family.unit;
        let units: Vec<_> =
            columns.iter().enumerate().map(|(place, column)| self.unit(place, family.unit_of(column))).collect();
        let mut doubts: Vec<&str> = units.iter().filter_map(|(_, doubt)| doubt.as_deref()).collect();
        doubts.dedup();
        let doubt = (!doubts.is_empty()).then(|| doubts.join("; "));
        let names: Vec<&str> = units.iter().map(|(unit, _)| *unit).collect();
        let table = if names.iter().all(|unit| ["rad", "m"].contains(unit)) {
            table
        } else {
            let reason = doubt.clone().unwrap_or_else(|| "by the names".to_owned());
            table.with_line("unit", one_or_list(&names), reason, doubt.is_none())
        };
        let Some(Gripper { place, full, limits: [low, high] }) = &self.gripper else { return table };
        let unit = if self.are_degrees(stated) { core::f64::consts::PI / 180.0 } else { 1.0 };
        let list = |usual: f64, own: f64| {
            let values = (0..self.columns).map(|column| if column == *place { own } else { usual });
            format!("[{}]", values.map(|value| format!("{value:?}")).collect::<Vec<_>>().join(", "))
        };
        let reason = format!(
            "the gripper is logged from 0 to {full}, probably a share of its range: mapped to the limits of the robot description"
        );
        table.with_unsure("scale", list(1.0, (high - low) / full / unit), reason).with("offset", list(0.0, *low), "rad")
    }
}

/// One value if all are equal, otherwise a list.
pub(super) fn one_or_list(units: &[&str]) -> String {
    match units {
        [first, rest @ ..] if rest.iter().all(|unit| unit == first) => quoted(first),
        _ => format!("[{}]", units.iter().map(|unit| quoted(unit)).collect::<Vec<_>>().join(", ")),
    }
}
