//! `new`: a study from a robot and its recordings.

mod channels;
mod draft;
mod drives;
mod position_units;
mod reasons;
mod settings;

pub use settings::NewStudySettings;

use crate::error::{Error, NewStudyError};
use crate::jobs::check::check;
use crate::jobs::columns::{
    Basis, Family, JointKey, Quantity, Source, best, best_command, best_next_to, best_torque, column_list,
    equal_choice, families, families_by_order, families_without_quantity, is_unsigned, shown, time_as_toml,
    time_unit_s, unit, with_unit,
};
use crate::jobs::log::log_contents;
use crate::jobs::options::RunOptions;
use crate::result::{LogContents, NEW_STUDY_SCHEMA, NewStudyFile, StudyChange, Unsure};
use crate::study::{LoadSettings, Study, XacroSettings, load_robot, relative_path};
use channels::{
    LoggedJoints, RobotJoints, in_order, is_numbered_next_to_names, logged_joints, with_numbered_names,
    with_partly_foreign_names, without_foreign_grippers,
};
use draft::{Draft, Table};
use drives::{DriveInertiaFinding, drive_inertia};
use dynident_model::{JointKind, Model, Robot};
use dynident_recording::Level;
use dynident_text::quoted;
use position_units::{PositionUnits, one_or_list};
use reasons::{alternatives, basis, recognised};
use std::path::{Path, PathBuf};

const MAX_ROUNDS: usize = 3;

/// Inputs of a new study.
#[derive(Clone, Debug, PartialEq)]
pub struct NewStudy {
    /// The robot description: URDF, MJCF, SDF, or D-H table in TOML.
    pub robot: PathBuf,
    /// The robot description as read by [`load_robot`]; `None` reads the file, which must not have xacro macros.
    pub description: Option<Box<Robot>>,
    /// Settings of the program `xacro`; written into the study if arguments are given.
    pub xacro: XacroSettings,
    /// The recordings, at least one.
    pub logs: Vec<PathBuf>,
    /// Path of the study; paths in it are relative to its folder.
    pub out: PathBuf,
    /// Sample rate for recordings without time stamps, Hz.
    pub rate_hz: Option<f64>,
    /// Lines that a person states; these override proposals and answer [`NewStudyFile::unsure`].
    pub stated: Vec<StudyChange>,
}

impl NewStudy {
    fn study(&self, draft: &Draft) -> Result<Study, Error> {
        let mut study = Study::parse(&draft.text(), &self.out)?;
        study.robot.description.clone_from(&self.description);
        Ok(study)
    }
}

/// Writes a study: joints from names and number of columns, units from names, limits and ranges, and a validation part.
/// It is then examined like by [`check`], unambiguous corrections are applied, and one fit tests for drive inertia,
/// which `design` and `iterate` need but cannot test. Every line has a reason; uncertain lines are marked. No file is
/// written.
///
/// # Errors
/// A robot description or recording that cannot be read, or without recognisable columns of positions and of torques or
/// commands. A recording that cannot be used with the written study is a doubt, not an error.
pub fn new_study(request: &NewStudy, options: &RunOptions<'_>) -> Result<NewStudyFile, Error> {
    new_study_with(request, options, &NewStudySettings::default())
}

/// As [`new_study()`], with other thresholds.
///
/// # Errors
/// As [`new_study()`], and invalid thresholds.
pub fn new_study_with(
    request: &NewStudy,
    options: &RunOptions<'_>,
    thresholds: &NewStudySettings,
) -> Result<NewStudyFile, Error> {
    thresholds.validate().map_err(Error::section(&request.out, "new"))?;
    let robot = match &request.description {
        Some(robot) => (**robot).clone(),
        None => load_robot(&request.robot, &LoadSettings { xacro: request.xacro.clone(), ..LoadSettings::default() })?,
    };
    // Each episode of a file is a recording.
    let (mut logs, mut parts) = (Vec::new(), Vec::new());
    for path in &request.logs {
        for (part, contents) in log_contents(path)?.episodes() {
            logs.push((path.as_path(), contents));
            parts.push(part);
        }
    }
    let recorded = RecognisedColumns::find(&robot.model, &logs, thresholds).map_err(Error::NewStudy)?;
    let recorded = RecognisedColumns { parts, ..recorded };
    let mut draft = recorded.draft(request, &robot.model, &logs);
    for change in &request.stated {
        draft.apply(change, "As stated");
    }

    let mut examined = None;
    let mut unsure = draft.unsure();
    unsure.extend(recorded.unused_recordings(&logs));
    let without_rate = |unsure: &Unsure| unsure.line.as_ref().is_some_and(|change| change.line.starts_with("rate_hz"));
    if !unsure.iter().any(without_rate) {
        for _ in 0..MAX_ROUNDS {
            let study = request.study(&draft)?;
            let found = match check(&study, &request.out, options) {
                Ok(found) => found.check,
                Err(error @ Error::Interrupted { .. }) => return Err(error),
                // The study is known except for what the error names, so it is written.
                Err(error) => {
                    unsure.push(Unsure { line: None, proposed: Vec::new(), reason: error.to_string() });
                    break;
                }
            };
            let changed = draft.apply_corrections(&found);
            examined = Some(found);
            if !changed {
                break;
            }
        }
    }
    let remaining = examined.iter().flat_map(|check| &check.findings).filter(|finding| finding.level == Level::Problem);
    unsure.extend(remaining.map(|finding| Unsure {
        line: None,
        proposed: finding.write.iter().filter(|change| change.is_well_formed()).cloned().collect(),
        reason: finding.sentence(),
    }));
    if unsure.is_empty() && examined.is_some() && !recorded.has_commands() {
        match drive_inertia(request, &draft, options)? {
            DriveInertiaFinding::Present(table) => draft = draft.with(table),
            DriveInertiaFinding::Absent(figures) => draft = draft.with(Table::new("", figures)),
        }
    }
    Ok(NewStudyFile {
        schema: NEW_STUDY_SCHEMA.to_owned(),
        file: request.out.display().to_string(),
        text: draft.text(),
        unsure,
        check: examined,
    })
}

struct RecognisedColumns {
    thresholds: NewStudySettings,
    /// Joint assignment, in the order of the columns.
    logged: LoggedJoints,
    position: Family,
    /// Torques, or commanded positions in a log without torque.
    drive: Family,
    velocity: Option<Family>,
    columns: [Vec<String>; 2],
    velocity_columns: Option<Vec<String>>,
    /// Recordings with these columns; recordings with torques only belong to one of them.
    files: Vec<usize>,
    /// The episode of each recording, for files with several.
    parts: Vec<Option<String>>,
    time: Option<LogClock>,
    /// Other columns of the quantities of positions, velocities and torques.
    alternatives: [String; 3],
    /// Columns of positions and of torques that are as likely as the chosen ones.
    equals: [Option<String>; 2],
    /// Rows of the recordings for one row with values in all columns.
    rows_of_complete_one: f64,
}

struct LogClock {
    /// The value of `time`.
    key: String,
    /// Mean rate, Hz.
    rate_hz: Option<f64>,
    /// Whether its name, not its values, shows that it is the clock.
    is_named: bool,
    /// Whether the stamps are 0, 1, 2, .. without a unit.
    counts: bool,
}

impl RecognisedColumns {
    fn find(
        model: &Model,
        logs: &[(&Path, LogContents)],
        thresholds: &NewStudySettings,
    ) -> Result<Self, NewStudyError> {
        let names: Vec<String> = model.joints().iter().map(|joint| joint.name.clone()).collect();
        let free: Vec<usize> = (0..model.dof()).filter(|&joint| model.joints()[joint].mimic.is_none()).collect();
        let is_rotary = |joint: &usize| model.joints()[*joint].kind != JointKind::Prismatic;
        let turning = free.iter().copied().filter(is_rotary).collect();
        let moves = |other: usize, joint: usize| other != joint && model.moves(other, model.body_of(joint));
        let carriers_of = |joint| (0..model.dof()).filter(|&other| moves(other, joint)).collect();
        let carriers = (0..model.dof()).map(carriers_of).collect();
        let robot = RobotJoints { names: &names, free, turning, carriers };
        let paths = || logs.iter().map(|(path, log)| (*path, log));
        let mut all = families(paths(), &names);
        let counts = [robot.free.len(), robot.turning.len()];
        if all.is_empty() {
            all = logs.iter().enumerate().flat_map(|(file, (_, log))| families_by_order(file, log, &counts)).collect();
        }
        let joined = with_numbered_names(&with_partly_foreign_names(&all, logs, &robot), logs, &robot);
        let mut all = without_foreign_grippers(&joined, &robot);
        let missing =
            |quantity, all: &[Family]| NewStudyError::NotRecognised { quantity, found: recognised(all, logs) };
        // Unknown columns, one for each joint.
        let assume = |all: &mut Vec<Family>, quantity| {
            let known: Vec<String> =
                all.iter().flat_map(|family| &family.columns).map(|(_, name)| name.clone()).collect();
            let is_new = |family: &Family| {
                counts.contains(&family.columns.len()) && family.columns.iter().all(|(_, name)| !known.contains(name))
            };
            all.extend(families_without_quantity(paths(), &names, quantity).into_iter().find(is_new));
        };
        if best(&all, Quantity::Position, |_| true).is_none() {
            assume(&mut all, Quantity::Position);
        }
        let position = best(&all, Quantity::Position, |_| true).ok_or_else(|| missing("positions", &all))?.clone();
        let position = &position;
        let same_kind = |family: &&Family| {
            (family.file, family.group, family.quantity, &family.stem)
                == (position.file, position.group, position.quantity, &position.stem)
        };
        let left_out: Vec<String> = joined
            .iter()
            .filter(same_kind)
            .flat_map(|family| &family.columns)
            .filter_map(|(key, _)| match key {
                JointKey::Name(name) => Some(name.clone()),
                JointKey::Joint(_) | JointKey::Number(_) | JointKey::Alone => None,
            })
            .collect();
        let logged = logged_joints(position, &robot, &left_out).ok_or(NewStudyError::MoreColumnsThanJoints {
            columns: position.columns.len(),
            joints: robot.free.len(),
        })?;
        let ordered = |family: &Family| in_order(family, position, &logged.joints);

        // In the file of the positions if present, otherwise in another file with the same number of rows.
        let in_same_file = |family: &Family| family.file == position.file && ordered(family).is_some();
        let rows = |family: &Family| logs[family.file].1.groups.get(family.group).map(|group| group.rows);
        let in_other_file = |family: &Family| {
            family.file != position.file && rows(family) == rows(position) && ordered(family).is_some()
        };
        let is_commanded = |family: &Family| position.source != Source::Commanded && family != position;
        let find_drive = |all: &[Family]| {
            let command = best_command(all, |family| is_commanded(family) && in_same_file(family))
                .or_else(|| best_command(all, |family| is_commanded(family) && in_other_file(family)));
            let is_torque = |family: &Family| command.is_none() || !is_unsigned(family, &logs[family.file].1);
            let torques = |is_recorded: bool, fits: &dyn Fn(&Family) -> bool| {
                let is_usable = |family: &Family| is_torque(family) && (family.source.is_recorded() || !is_recorded);
                best_torque(all, Some(position), |family| is_usable(family) && fits(family))
            };
            let torque = torques(true, &in_same_file)
                .or_else(|| torques(true, &in_other_file))
                .or_else(|| torques(false, &in_same_file))
                .or_else(|| torques(false, &in_other_file));
            torque.or(command).cloned()
        };
        let mut drive = find_drive(&all);
        if drive.is_none() {
            assume(&mut all, Quantity::Torque);
            drive = find_drive(&all);
        }
        let none = || missing("torques, currents or commanded positions", &all);
        let drive = &drive.ok_or_else(none)?;
        let velocity = best_next_to(&all, Quantity::Velocity, Some(position), in_same_file)
            .or_else(|| best_next_to(&all, Quantity::Velocity, Some(position), in_other_file))
            .filter(|family| family.source.is_recorded());
        let fits = |family: &&Family| in_same_file(family) || in_other_file(family);
        let alternatives = [Some(position), velocity, Some(drive)]
            .map(|chosen| chosen.map_or_else(String::new, |chosen| alternatives(chosen, all.iter().filter(fits))));
        let named =
            |family: &Family| shown(&family.columns.iter().map(|(_, name)| name.clone()).collect::<Vec<_>>(), 1);
        let equals = [(position, None), (drive, Some(position))]
            .map(|(chosen, other)| equal_choice(&all, chosen, other, in_same_file).map(named));

        let (Some(of_position), Some(of_drive)) = (ordered(position), ordered(drive)) else { return Err(none()) };
        let has = |log: &LogContents, columns: &[String]| {
            columns.iter().all(|column| log.channels.iter().any(|channel| channel.name == *column))
        };
        let is_pair = drive.file != position.file;
        let holds = |file: &usize| {
            let log = &logs[*file].1;
            if is_pair { *file == position.file } else { has(log, &of_position) && has(log, &of_drive) }
        };
        let contents = &logs[position.file].1;
        let group = contents.groups.get(position.group);
        let time = group.and_then(|group| {
            let name = group.time.as_ref()?;
            let unit = contents.unit(position.group, name);
            let is_named = group.name.is_some() || time_unit_s(&with_unit(name, unit)).is_some();
            let is_unit_of_rate = self::unit(name).is_none() && unit == Some("ms") && group.rate_hz == Some(1000.0);
            let channel = contents.channels.iter().find(|channel| channel.name == *name);
            let starts =
                channel.and_then(|channel| channel.range).is_some_and(|[first, _]| [0.0, 1.0].contains(&first));
            let counts = is_unit_of_rate && starts;
            Some(LogClock { key: time_as_toml(name, unit), rate_hz: group.rate_hz, is_named, counts })
        });
        let files: Vec<usize> = (0..logs.len()).filter(holds).collect();
        let used = |log: &LogContents, name: &String| {
            let channel = log.channels.iter().find(|channel| channel.name == *name)?;
            Some((channel.samples + channel.missing) as f64 / channel.samples.max(1) as f64)
        };
        let shares = [(position, &of_position), (drive, &of_drive)].into_iter().flat_map(|(family, columns)| {
            let own = if is_pair { vec![family.file] } else { files.clone() };
            own.into_iter().flat_map(move |file| columns.iter().filter_map(move |name| used(&logs[file].1, name)))
        });
        let rows_of_complete_one = shares.fold(1.0, f64::max);
        Ok(Self {
            thresholds: thresholds.clone(),
            columns: [of_position, of_drive],
            velocity_columns: velocity.and_then(ordered),
            files,
            parts: vec![None; logs.len()],
            time,
            logged,
            position: position.clone(),
            drive: drive.clone(),
            velocity: velocity.cloned(),
            alternatives,
            equals,
            rows_of_complete_one,
        })
    }

    fn unused_recordings(&self, logs: &[(&Path, LogContents)]) -> Vec<Unsure> {
        let channel_files = [Some(&self.drive), self.velocity.as_ref()].into_iter().flatten().map(|family| family.file);
        let used: Vec<usize> = self.files.iter().copied().chain(channel_files).collect();
        let unused = logs.iter().enumerate().filter(|(number, _)| !used.contains(number));
        let reason = |path: &Path| {
            format!("{} is not in the study: its columns differ from those of the other recordings", path.display())
        };
        unused.map(|(_, (path, _))| Unsure { line: None, proposed: Vec::new(), reason: reason(path) }).collect()
    }

    fn draft(&self, request: &NewStudy, model: &Model, logs: &[(&Path, LogContents)]) -> Draft {
        let from = request.out.parent().unwrap_or_else(|| Path::new(""));
        let joints = model.joints();
        let tables = [
            vec![self.robot_table(request, model, from), self.time_table(request)],
            vec![self.position_table(model, logs)],
            self.velocity_table(model, logs, from).into_iter().collect(),
            vec![if self.has_commands() {
                self.command_table(model, logs, from)
            } else {
                self.torque_table(logs, from)
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

    fn robot_table(&self, request: &NewStudy, model: &Model, from: &Path) -> Table {
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
        table.with_line("joints", format!("[{}]", names.join(", ")), reason, *is_sure)
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

    /// The doubt about a choice between columns.
    fn doubt(&self, place: usize) -> Option<String> {
        let equal = self.equals[place].as_ref()?;
        Some(format!("{equal} may equally be meant: the names do not decide, the first in the file are taken"))
    }

    fn position_table(&self, model: &Model, logs: &[(&Path, LogContents)]) -> Table {
        let [columns, _] = &self.columns;
        let table = Table::new("[format.position]", basis(&self.position, "positions", &self.alternatives[0]));
        let doubt = self.doubt(0);
        let is_sure = doubt.is_none() && !matches!(self.position.basis, Basis::Order | Basis::Assumption);
        let table =
            table.with_line("columns", column_list(columns), doubt.as_ref().unwrap_or(&self.logged.reason), is_sure);
        PositionUnits::of(self, model, logs).with_unit(table, &self.position, columns)
    }

    fn velocity_table(&self, model: &Model, logs: &[(&Path, LogContents)], from: &Path) -> Option<Table> {
        // Commands are compared with positions alone.
        let velocity = self.velocity.as_ref().filter(|_| !self.has_commands());
        let (family, columns) = velocity.zip(self.velocity_columns.as_ref())?;
        let table = Table::new(
            "[format.velocity]",
            format!("Compared with the derivative of the positions{}", self.alternatives[1]),
        );
        let table = self.with_file(table, family, logs, from).with("columns", column_list(columns), "");
        Some(match stated_units(family, columns, "rad/s") {
            Some(units) => table.with("unit", units, "by the names"),
            None if family.unit.is_none() && PositionUnits::of(self, model, logs).are_degrees(self.position.unit) => {
                table.with_unsure("unit", quoted("deg/s"), "positions are in degrees".to_owned())
            }
            None => table,
        })
    }

    /// Whether the log has commanded positions in place of torques.
    fn has_commands(&self) -> bool {
        self.drive.quantity == Quantity::Position
    }

    fn command_table(&self, model: &Model, logs: &[(&Path, LogContents)], from: &Path) -> Table {
        let [_, columns] = &self.columns;
        let reason = format!(
            "{}. The log has no signed torque or current: commands and positions identify the servos together with the robot",
            basis(&self.drive, "positions", &self.alternatives[2])
        );
        let table = self.with_file(Table::new("[format.command]", reason), &self.drive, logs, from);
        let table = table.with("columns", column_list(columns), "");
        PositionUnits::of(self, model, logs).with_unit(table, &self.drive, columns)
    }

    fn torque_table(&self, logs: &[(&Path, LogContents)], from: &Path) -> Table {
        let [_, columns] = &self.columns;
        let table = Table::new("[format.torque]", basis(&self.drive, "torques", &self.alternatives[2]));
        let table = self.with_file(table, &self.drive, logs, from);
        let table = match self.drive.source {
            Source::Commanded => {
                table.with_unsure("columns", column_list(columns), "commanded, not measured: no other torque was found")
            }
            Source::Computed => {
                table.with_unsure("columns", column_list(columns), "computed, not measured: no other torque was found")
            }
            Source::Unstated | Source::Measured | Source::Filtered => {
                let doubt = match self.drive.basis {
                    Basis::Order => Some("the columns have no names: assigned in order".to_owned()),
                    Basis::Assumption => Some("their names state no quantity: no other torque was found".to_owned()),
                    _ if is_numbered_next_to_names(&self.drive, &self.position) => {
                        Some("numbers in place of names: assigned in the order of the robot description".to_owned())
                    }
                    Basis::ColumnNames | Basis::FileName => self.doubt(1),
                };
                let is_sure = doubt.is_none();
                table.with_line("columns", column_list(columns), doubt.unwrap_or_default(), is_sure)
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

    /// Adds the file name for columns in another file than the positions, relative to the folder of the positions.
    fn with_file(&self, table: Table, family: &Family, logs: &[(&Path, LogContents)], from: &Path) -> Table {
        if family.file == self.position.file {
            return table;
        }
        let folder = logs[self.position.file].0.parent().unwrap_or(from);
        let file = quoted(&path_in_study(logs[family.file].0, folder));
        table.with("file", file, "a separate file with the same number of rows")
    }

    fn log_tables(&self, logs: &[(&Path, LogContents)], from: &Path) -> Vec<Table> {
        let with_file = |table: Table, number: usize| {
            let table = table.with("file", quoted(&path_in_study(logs[number].0, from)), "");
            let part = self.parts.get(number).and_then(|part| part.as_deref());
            part.iter().fold(table, |table, part| table.with("part", quoted(part), ""))
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

/// The units in the names of `columns`, if one is not the usual one.
fn stated_units(family: &Family, columns: &[String], usual: &'static str) -> Option<String> {
    let units: Vec<&str> = columns.iter().map(|column| family.unit_of(column).unwrap_or(usual)).collect();
    units.iter().any(|unit| *unit != usual).then(|| one_or_list(&units))
}

fn key(name: &str) -> String {
    if name.contains(['.', '/']) { quoted(name) } else { name.to_owned() }
}

/// `path` relative to `folder`, with `/`; unchanged if there is no relative path.
fn path_in_study(path: &Path, folder: &Path) -> String {
    let unchanged = || path.to_string_lossy().replace(std::path::MAIN_SEPARATOR, "/");
    relative_path(folder, path).unwrap_or_else(unchanged)
}
