//! The tables of a new study, each line with its reason.

use super::NewStudy;
use super::channels::{LoggedJoints, is_numbered_next_to_names};
use super::draft::{Draft, Table};
use super::grippers::unclear_gripper;
use super::joint_files::GroupColumns;
use super::locked::{LockedJoint, range};
use super::position_units::{PositionUnits, one_or_list};
use super::reasons::basis;
use super::recognised::{LogClock, RecognisedColumns};
use crate::jobs::columns::{Basis, Family, Quantity, Source, column_list};
use crate::result::LogContents;
use crate::study::{XacroSettings, relative_path};
use dynident_model::Model;
use dynident_recording::log::{self as recording, si_factor};
use dynident_text::quoted;
use std::path::Path;

impl RecognisedColumns {
    /// The study with the reasons for its lines.
    pub(super) fn draft(&self, request: &NewStudy, model: &Model, logs: &[(&Path, LogContents)]) -> Draft {
        let from = request.out.parent().unwrap_or_else(|| Path::new(""));
        let joints = model.joints();
        let tables = [
            vec![self.robot_table(request, model, logs, from), self.time_table(request)],
            vec![self.position_table(model, logs)],
            self.velocity_table(model, logs, from).into_iter().collect(),
            vec![if self.has_commands() {
                self.command_table(model, logs, from)
            } else {
                self.torque_table(model, logs, from)
            }],
            self.log_tables(logs, from),
        ];
        let mut tables = tables.concat();
        let known = |limit: fn(&dynident_model::JointLimits) -> Option<f64>| {
            self.logged.joints.iter().filter(|&&joint| limit(&joints[joint].limits).is_some()).count()
        };
        let note = format!(
            "Dynident selects friction, cut-off, lag and estimator with the logs; `dynident docs study` lists the keys that state them. For a motor that drives two joints add [[coupling]]. Limits for `dynident design` in the robot description, of {} joints: {} positions, {} velocities, {} torques",
            self.logged.joints.len(),
            known(|limits| limits.upper),
            known(|limits| limits.velocity),
            known(|limits| limits.effort)
        );
        tables.push(Table::new("", note));
        Draft { tables }
    }

    fn robot_table(&self, request: &NewStudy, model: &Model, logs: &[(&Path, LogContents)], from: &Path) -> Table {
        let LoggedJoints { joints, reason, is_sure } = &self.logged;
        let mut table = Table::new("[robot]", "").with("file", quoted(&path_in_study(&request.robot, from)), "");
        if !request.xacro.arguments.is_empty() {
            let arguments: Vec<String> = request
                .xacro
                .arguments
                .iter()
                .map(|(name, value)| format!("{} = {}", key(name), quoted(value)))
                .collect();
            table = table.with("xacro", format!("{{ {} }}", arguments.join(", ")), "As given: arguments of xacro");
        }
        if request.xacro.limit_s != XacroSettings::DEFAULT_LIMIT_S {
            table = table.with("xacro_limit_s", format!("{:?}", request.xacro.limit_s), "As given");
        }
        if *is_sure && joints.len() == model.dof() && joints.is_sorted() {
            return table;
        }
        let names: Vec<String> = joints.iter().map(|&joint| quoted(&model.joints()[joint].name)).collect();
        let locked = if joints.len() == model.dof() { "" } else { "; every other joint is locked" };
        let reason = format!("{reason}{locked}");
        let table = table.with_line("joints", format!("[{}]", names.join(", ")), reason, *is_sure);
        self.with_lock(table, model, logs)
    }

    /// Adds the positions of joints of the log that are locked.
    fn with_lock(&self, table: Table, model: &Model, logs: &[(&Path, LogContents)]) -> Table {
        if self.locked.is_empty() {
            return table;
        }
        let name = |locked: &LockedJoint| model.joints()[locked.joint].name.clone();
        let units = PositionUnits::of(self, model, logs);
        let file = self.position.file;
        let own = if self.drive.file == file { logs } else { &logs[file..=file] };
        // The share of the range of a gripper whose positions have no unit.
        let share = |locked: &LockedJoint| {
            let range = range(own, &locked.column).filter(|_| self.position.unit_of(&locked.column).is_none())?;
            unclear_gripper(&model.joints()[locked.joint], range)
        };
        let position = |locked: &LockedJoint| {
            let logged = range(own, &locked.column).unwrap_or_default();
            let middle = 0.5 * (logged[0] + logged[1]);
            let kind = model.joints()[locked.joint].kind;
            let unit = units.unit_of_joint(kind, self.position.unit_of(&locked.column), logged);
            let factor = si_factor(unit, recording::Quantity::Position).unwrap_or(1.0) * units.factor_of_joint(kind);
            let position = share(locked).map_or(middle * factor, |share| share.position(middle));
            format!("{} = {:?}", key(&name(locked)), rounded(position))
        };
        let reason = |locked: &LockedJoint| {
            let of_share = if share(locked).is_some() { " (in the log a share of its range)" } else { "" };
            format!("{}: {}{of_share}", name(locked), locked.reason)
        };
        let list = |text: &dyn Fn(&LockedJoint) -> String, separator: &str| {
            self.locked.iter().map(text).collect::<Vec<_>>().join(separator)
        };
        let is_sure = self.locked.iter().all(|locked| locked.is_sure && share(locked).is_none());
        table.with_line("lock", format!("{{ {} }}", list(&position, ", ")), list(&reason, "; "), is_sure)
    }

    /// Whether one text names the files of positions and torques of all joints.
    pub(super) fn has_file_pattern(&self, model: &Model) -> bool {
        self.columns.iter().chain(&self.velocity_columns).all(|columns| self.group(model, columns).file.is_some())
    }

    /// The columns of a group of channels, and their file if it is not the main one.
    fn group(&self, model: &Model, columns: &[String]) -> GroupColumns {
        let joints: Vec<&str> = self.logged.joints.iter().map(|joint| &model.joints()[*joint].name[..]).collect();
        let of_joints = self.joint_files.as_ref().and_then(|files| files.group(columns, &joints));
        of_joints.unwrap_or_else(|| GroupColumns { file: None, columns: column_list(columns) })
    }

    fn time_table(&self, request: &NewStudy) -> Table {
        let table = Table::new("[format]", "");
        let table = match (&self.time, request.rate_hz) {
            (Some(LogClock { key, rate_hz, counts: true, .. }), None) => {
                let reason = "the stamps count 0, 1, 2, ..: milliseconds, or rows: then write rate_hz = the sample rate in place of time";
                let rate = rate_hz.map_or_else(String::new, |rate_hz| format!("{rate_hz:.4} Hz on average; "));
                table.with_unsure("time", key.clone(), format!("{rate}{reason}"))
            }
            (Some(LogClock { counts: true, .. }) | None, Some(rate_hz)) => {
                table.with("rate_hz", format!("{rate_hz:?}"), "As given: no time column recognised")
            }
            (Some(LogClock { key, rate_hz, is_named, .. }), _) => {
                let rate = rate_hz.map_or_else(String::new, |rate_hz| format!("{rate_hz:.4} Hz on average"));
                let by = if *is_named { "" } else { ", a column that rises evenly" };
                table.with("time", key.clone(), format!("{rate}{by}"))
            }
            (None, None) => table.with_unsure(
                "rate_hz",
                "1000.0",
                "no time column recognised: give the sample rate, or time = { column = .. }",
            ),
        };
        let every = self.rows_of_complete_one.round();
        if self.rows_of_complete_one <= 1.0 {
            return table;
        }
        let table = table.with("missing", quoted("drop"), "values are missing in some rows, which are left out");
        if every < 2.0 {
            return table;
        }
        let reason = format!(
            "values are missing in most rows: probably a slower channel with a value in every row number {every}"
        );
        table.with_unsure("keep_every", format!("{every}"), reason)
    }

    /// The reason why a choice between columns is uncertain.
    fn doubt(&self, place: usize) -> Option<String> {
        let equal = self.equals[place].as_ref()?;
        Some(format!(
            "{equal} may equally be meant: the names do not decide, the plainest are taken, of equals the first in the file"
        ))
    }

    fn position_table(&self, model: &Model, logs: &[(&Path, LogContents)]) -> Table {
        let [columns, _] = &self.columns;
        let table = Table::new("[format.position]", basis(&self.position, "positions", &self.alternatives[0]));
        let doubt = self.doubt(0);
        let is_sure = doubt.is_none() && !matches!(self.position.basis, Basis::Order | Basis::Assumption);
        let GroupColumns { file, columns: list } = self.group(model, columns);
        let table = file.into_iter().fold(table, |table, file| table.with("file", file, "one file for each joint"));
        let table = table.with_line("columns", list, doubt.as_ref().unwrap_or(&self.logged.reason), is_sure);
        PositionUnits::of(self, model, logs).with_unit(table, &self.position, columns)
    }

    fn velocity_table(&self, model: &Model, logs: &[(&Path, LogContents)], from: &Path) -> Option<Table> {
        // Commands are compared with positions only, so velocities are not used.
        let velocity = self.velocity.as_ref().filter(|_| !self.has_commands());
        let (family, columns) = velocity.zip(self.velocity_columns.as_ref())?;
        let table = Table::new(
            "[format.velocity]",
            format!("Compared with the derivative of the positions{}", self.alternatives[1]),
        );
        let (table, list) = self.with_file(table, family, columns, model, logs, from);
        let table = table.with("columns", list, "");
        Some(match stated_units(family, columns, "rad/s") {
            Some(units) => table.with("unit", units, "by the names"),
            None if family.unit.is_none() && PositionUnits::of(self, model, logs).are_degrees(self.position.unit) => {
                table.with_unsure("unit", quoted("deg/s"), "positions are in degrees".to_owned())
            }
            None => table,
        })
    }

    fn command_table(&self, model: &Model, logs: &[(&Path, LogContents)], from: &Path) -> Table {
        let [_, columns] = &self.columns;
        let torque = match &self.unused_torque {
            None => "The log has no signed torque or current".to_owned(),
            Some(columns) => {
                format!("The log has torques or currents ({columns}), but these are not those of the joints above")
            }
        };
        let reason = format!(
            "{}. {torque}: commands and positions identify the servos together with the robot. With known gains of the position controllers (MIT mode), `sum` in [format.torque] gives the torque instead: `dynident docs mit-mode`",
            basis(&self.drive, "positions", &self.alternatives[2])
        );
        let table = Table::new("[format.command]", reason);
        let (table, list) = self.with_file(table, &self.drive, columns, model, logs, from);
        let table = table.with("columns", list, "");
        PositionUnits::of(self, model, logs).with_unit(table, &self.drive, columns)
    }

    fn torque_table(&self, model: &Model, logs: &[(&Path, LogContents)], from: &Path) -> Table {
        let [_, columns] = &self.columns;
        let table = Table::new("[format.torque]", basis(&self.drive, "torques", &self.alternatives[2]));
        let (table, list) = self.with_file(table, &self.drive, columns, model, logs, from);
        let table = match self.drive.source {
            Source::Commanded => {
                table.with_unsure("columns", list, "commanded, not measured: no other torque was found")
            }
            Source::Computed => table.with_unsure("columns", list, "computed, not measured: no other torque was found"),
            Source::Unstated | Source::Measured | Source::Filtered => {
                let doubt = match self.drive.basis {
                    Basis::Order => Some("the columns have no names: assigned in order".to_owned()),
                    Basis::JointNames | Basis::Assumption => {
                        Some("their names state no quantity: no other torque was found".to_owned())
                    }
                    _ if is_numbered_next_to_names(&self.drive, &self.position) => {
                        Some("numbers in place of names: assigned in the order of the robot description".to_owned())
                    }
                    Basis::ColumnNames | Basis::FileName => self.doubt(1),
                };
                let is_sure = doubt.is_none();
                table.with_line("columns", list, doubt.unwrap_or_default(), is_sure)
            }
        };
        if self.drive.quantity == Quantity::Current {
            let unit = self.drive.unit.unwrap_or("A");
            let reason = "Nm/A: gear ratio times motor constant, one value per joint; with 1 torques remain in amperes";
            return table.with("unit", quoted(unit), "a current").with_unsure("scale", "1.0", reason);
        }
        match stated_units(&self.drive, columns, "N m") {
            Some(units) => table.with("unit", units, "by the names"),
            None => table,
        }
    }

    /// Adds the file of `columns` if it is not the main one, relative to the folder of the positions; returns the
    /// columns in the notation of a study.
    fn with_file(
        &self,
        table: Table,
        family: &Family,
        columns: &[String],
        model: &Model,
        logs: &[(&Path, LogContents)],
        from: &Path,
    ) -> (Table, String) {
        let GroupColumns { file, columns } = self.group(model, columns);
        if let Some(file) = file {
            return (table.with("file", file, ""), columns);
        }
        if family.file == self.position.file {
            return (table, columns);
        }
        let folder = logs[self.position.file].0.parent().unwrap_or(from);
        let file = quoted(&path_in_study(logs[family.file].0, folder));
        (table.with("file", file, "a separate file with the same number of rows"), columns)
    }

    fn log_tables(&self, logs: &[(&Path, LogContents)], from: &Path) -> Vec<Table> {
        let with_file = |table: Table, number: usize| {
            let table = table.with("file", quoted(&path_in_study(logs[number].0, from)), "");
            let part = self.parts.get(number).and_then(|part| part.as_deref());
            let table = part.iter().fold(table, |table, part| table.with("part", quoted(part), ""));
            self.renamed_files(number).into_iter().fold(table, Table::with_own_format)
        };
        if let [only] = self.files[..] {
            let part = |[from, to]: [f64; 2]| format!("[{from:?}, {to:?}]");
            let first = Table::new("[[log]]", "One recording: the first part is for training, the last for validation");
            return vec![
                with_file(first, only).with("fraction", part(self.thresholds.training_fraction), ""),
                with_file(Table::new("[[log]]", ""), only)
                    .with("fraction", part(self.thresholds.validation_fraction), "")
                    .with("role", quoted("validate"), ""),
            ];
        }
        let last = self.files.len().saturating_sub(1);
        let table = |(place, &number): (usize, &usize)| {
            let reason = if place == last { "the last recording is for validation" } else { "" };
            let table = with_file(Table::new("[[log]]", reason), number);
            if place == last { table.with("role", quoted("validate"), "") } else { table }
        };
        self.files.iter().enumerate().map(table).collect()
    }
}

/// The units in the names of `columns`, if one of them is not the usual unit.
fn stated_units(family: &Family, columns: &[String], usual: &'static str) -> Option<String> {
    let units: Vec<&str> = columns.iter().map(|column| family.unit_of(column).unwrap_or(usual)).collect();
    units.iter().any(|unit| *unit != usual).then(|| one_or_list(&units))
}

/// A position without the rounding of its unit.
fn rounded(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

fn key(name: &str) -> String {
    let is_bare = name.bytes().all(|byte| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'-'));
    if is_bare && !name.is_empty() { name.to_owned() } else { quoted(name) }
}

/// `path` relative to `folder`, written with `/`; unchanged if there is no relative path.
fn path_in_study(path: &Path, folder: &Path) -> String {
    let unchanged = || path.to_string_lossy().replace(std::path::MAIN_SEPARATOR, "/");
    relative_path(folder, path).unwrap_or_else(unchanged)
}
