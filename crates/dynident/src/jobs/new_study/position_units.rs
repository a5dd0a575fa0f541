//! Units of positions and commands whose names contain no unit, and grippers that are logged as a share of their
//! range.

use super::draft::Table;
use super::grippers::{DEGREE, Share, share_of_range};
use super::normalised::{LoggedRange, Normalised, are_thousandths};
use super::recognised::RecognisedColumns;
use crate::jobs::columns::Family;
use crate::result::LogContents;
use dynident_model::{JointKind, Model};
use dynident_text::quoted;
use std::path::Path;

/// A gripper that is logged as a share of its range.
struct Gripper {
    /// Index of its column.
    place: usize,
    share: Share,
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
    /// The note about LeRobot's normalised positions, if the positions may be such.
    normalised: Option<String>,
    /// Factor on the unit: 0.001 if the positions are probably in 0.001 degree, otherwise 1.
    factor: f64,
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
            let [low, high] = ranges(place);
            let share = share_of_range(&model.joints()[joints[place]], [low, high])?;
            // Positions between the limits can be radians, except those from 0 to 1.
            (!share.is_inside || share.is_of_one() && low >= 0.0).then_some(Gripper { place, share })
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
        let implausible = (most > limit).then_some(most);
        let logged = |place: usize| {
            let joint = &model.joints()[joints[place]];
            let limits = joint.limits.lower.zip(joint.limits.upper).map(|(lower, upper)| [lower, upper]);
            let of_files = recognised.files.iter().filter_map(|&file| range(&positions[place], file));
            let range = of_files.fold(ranges(place), |[low, high], [from, to]| [low.min(from), high.max(to)]);
            LoggedRange { joint: joint.name.clone(), range, limits, is_turning: is_turning(&place) }
        };
        let logged: Vec<LoggedRange> = (0..joints.len()).map(logged).collect();
        let is_unstated = implausible.is_some() && recognised.position.unit.is_none();
        let normalised = is_unstated.then(|| Normalised::find(&logged, positions)).flatten();
        Self {
            columns: joints.len(),
            normalised: normalised.map(|found| found.note(&logged)),
            factor: if is_unstated && are_thousandths(&logged) { 1e-3 } else { 1.0 },
            travel: travel.collect(),
            max_travel_m: recognised.thresholds.max_travel_m,
            implausible,
            gripper,
        }
    }

    /// Whether the positions may be LeRobot's normalised ones, so that corrections of other units are misleading.
    pub(super) fn may_be_normalised(&self) -> bool {
        self.normalised.is_some()
    }

    /// Factor on the unit of a joint that is not among the columns.
    pub(super) fn factor_of_joint(&self, kind: JointKind) -> f64 {
        if kind == JointKind::Prismatic { 1.0 } else { self.factor }
    }

    /// Whether the positions are probably in degrees; `stated` is the unit in their names.
    pub(super) fn are_degrees(&self, stated: Option<&'static str>) -> bool {
        stated == Some("deg") || stated.is_none() && self.implausible.is_some()
    }

    /// Unit of a joint with the positions from `low` to `high` that is not among the columns.
    pub(super) fn unit_of_joint(
        &self,
        kind: JointKind,
        stated: Option<&'static str>,
        [low, high]: [f64; 2],
    ) -> &'static str {
        match (stated, kind) {
            (Some(unit), _) => unit,
            (None, JointKind::Prismatic) if high.max(-low) > self.max_travel_m => "mm",
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
                let reason = if self.factor == 1.0 {
                    let normalised = self.normalised.iter().fold(String::new(), |text, note| text + "; " + note);
                    format!(
                        "a joint moves to {most:.1}, which is implausible in radians: degrees, or motor-side positions{normalised}"
                    )
                } else {
                    format!(
                        "a joint moves to {most:.1}, which is implausible in radians and degrees, but 0.001 degree per unit (as in the SDK of the Piper) fits the limits of all joints: scale = 0.001; counts of an encoder are possible too"
                    )
                };
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
        let Some(Gripper { place, share: Share { full, limits: [low, high], .. } }) = &self.gripper else {
            return self.with_factor(table);
        };
        let unit = if self.are_degrees(stated) { DEGREE } else { 1.0 };
        let list = |usual: f64, own: f64| {
            let values = (0..self.columns).map(|column| if column == *place { own } else { usual });
            format!("[{}]", values.map(|value| format!("{value:?}")).collect::<Vec<_>>().join(", "))
        };
        let reason = format!(
            "the gripper is logged from 0 to {full}, probably a share of its range: mapped to the limits of the robot description"
        );
        let scale = list(self.factor, (high - low) / full / unit);
        table.with_unsure("scale", scale, reason).with("offset", list(0.0, *low), "rad")
    }

    /// Returns `table` with the factor on the unit of revolute joints.
    fn with_factor(&self, table: Table) -> Table {
        if self.factor == 1.0 {
            return table;
        }
        let factors = self.travel.iter().map(|travel| if travel.is_some() { 1.0 } else { self.factor });
        let factors: Vec<String> = factors.map(|factor| format!("{factor:?}")).collect();
        table.with("scale", format!("[{}]", factors.join(", ")), "0.001 degree, as stated for `unit`")
    }
}

/// One value if all are equal, otherwise a list.
pub(super) fn one_or_list(units: &[&str]) -> String {
    match units {
        [first, rest @ ..] if rest.iter().all(|unit| unit == first) => quoted(first),
        _ => format!("[{}]", units.iter().map(|unit| quoted(unit)).collect::<Vec<_>>().join(", ")),
    }
}
