//! The columns that a study uses, among all columns of its recordings.

use super::channels::{
    LoggedJoints, RobotJoints, in_order, logged_joints, probable_columns, with_numbered_names,
    with_partly_foreign_names, without_foreign_grippers, without_other_arms,
};
use super::draft::RenamedFiles;
use super::grippers::{is_gripper, unclear_gripper};
use super::joint_files::JointFiles;
use super::locked::{
    LockedJoint, is_of_other_publisher, places_with_torque, range, recorded_torques, still_places,
    without_other_publisher,
};
use super::reasons::{alternatives, recognised};
use super::settings::NewStudySettings;
use crate::error::NewStudyError;
use crate::jobs::columns::{
    Basis, Family, JointKey, Quantity, Source, best, best_command, best_next_to, best_torque, column_list,
    equal_choice, families, families_by_order, families_without_quantity, is_unsigned, shown, time_as_toml,
    time_unit_s, unit as unit_of_name, with_unit,
};
use crate::result::{LogContents, Unsure};
use dynident_model::Model;
use std::path::Path;

/// The columns that a study uses, among all columns of its recordings.
pub(super) struct RecognisedColumns {
    pub(super) thresholds: NewStudySettings,
    /// Joint assignment, in the order of the columns.
    pub(super) logged: LoggedJoints,
    /// Joints in the log that are locked.
    pub(super) locked: Vec<LockedJoint>,
    pub(super) position: Family,
    /// Torques, or commanded positions in a log without torque.
    pub(super) drive: Family,
    pub(super) velocity: Option<Family>,
    pub(super) columns: [Vec<String>; 2],
    pub(super) velocity_columns: Option<Vec<String>>,
    /// Indices of the recordings with these columns; a recording with torques only belongs to one of them.
    pub(super) files: Vec<usize>,
    /// The files of recordings with one file for each joint.
    pub(super) joint_files: Option<JointFiles>,
    /// The episode of each recording, for files with several.
    pub(super) parts: Vec<Option<String>>,
    pub(super) time: Option<LogClock>,
    /// Other columns that contain positions, velocities or torques.
    pub(super) alternatives: [String; 3],
    /// Columns of positions and of torques that are as likely as the selected ones.
    pub(super) equals: [Option<String>; 2],
    /// Number of rows per row with values in all columns.
    pub(super) rows_of_complete_one: f64,
    /// Signed torques or currents of some joints, in a study with commands.
    pub(super) unused_torque: Option<String>,
}

/// The clock of the recordings.
pub(super) struct LogClock {
    /// The value of the key `time`.
    pub(super) key: String,
    /// Mean sampling rate, Hz.
    pub(super) rate_hz: Option<f64>,
    /// Whether the name of the column, and not only its values, shows that it is the clock.
    pub(super) is_named: bool,
    /// Whether the time stamps are 0, 1, 2, .. without a unit.
    pub(super) counts: bool,
}

impl LogClock {
    /// The clock of a group of channels.
    fn of_group(contents: &LogContents, number: usize) -> Option<Self> {
        let group = contents.groups.get(number)?;
        let name = group.time.as_ref()?;
        let unit = contents.unit(number, name);
        let is_named = group.name.is_some() || time_unit_s(&with_unit(name, unit)).is_some();
        let is_unit_of_rate = unit_of_name(name).is_none() && unit == Some("ms") && group.rate_hz == Some(1000.0);
        let channel = contents.channels.iter().find(|channel| channel.name == *name);
        let starts = channel.and_then(|channel| channel.range).is_some_and(|[first, _]| [0.0, 1.0].contains(&first));
        let counts = is_unit_of_rate && starts;
        Some(Self { key: time_as_toml(name, unit), rate_hz: group.rate_hz, is_named, counts })
    }
}

/// Columns that belong to the joints by their names, or else by their order.
fn joined_families(logs: &[(&Path, LogContents)], robot: &RobotJoints<'_>, counts: [usize; 2]) -> Vec<Family> {
    let mut all = families(logs.iter().map(|(path, log)| (*path, log)), robot.names);
    if all.is_empty() {
        all = logs.iter().enumerate().flat_map(|(file, (_, log))| families_by_order(file, log, &counts)).collect();
    }
    with_numbered_names(&with_partly_foreign_names(&all, logs, robot), logs, robot)
}

/// Names of the joints in columns of the same kind as the positions, without columns of another publisher.
fn names_of_same_kind(all: &[Family], position: &Family, log: &LogContents) -> Vec<String> {
    let same_kind = |family: &&Family| {
        (family.file, family.group, family.quantity, &family.stem)
            == (position.file, position.group, position.quantity, &position.stem)
    };
    all.iter()
        .filter(same_kind)
        .flat_map(|family| &family.columns)
        .filter(|(_, name)| !is_of_other_publisher(position, name, log))
        .filter_map(|(key, _)| match key {
            JointKey::Name(name) => Some(name.clone()),
            JointKey::Joint(_) | JointKey::Number(_) | JointKey::Alone => None,
        })
        .collect()
}

/// The first of `further` with unknown columns, one for each joint.
fn new_family(further: Vec<Family>, all: &[Family], counts: [usize; 2]) -> Option<Family> {
    let is_known = |name: &String| all.iter().flat_map(|family| &family.columns).any(|(_, known)| known == name);
    let is_new = |family: &Family| {
        (counts.contains(&family.columns.len()) || family.basis == Basis::JointNames)
            && family.columns.iter().all(|(_, name)| !is_known(name))
    };
    further.into_iter().find(is_new)
}

/// Columns of torques, or else of commands, next to the positions: for each of both, `places` are tried in this order.
fn torque_or_command(
    all: &[Family],
    position: &Family,
    logs: &[(&Path, LogContents)],
    places: [&dyn Fn(&Family) -> bool; 2],
) -> Option<Family> {
    let is_commanded = |family: &Family| position.source != Source::Commanded && family != position;
    let command = places.iter().find_map(|fits| best_command(all, |family| is_commanded(family) && fits(family)));
    let is_torque = |family: &Family| command.is_none() || !is_unsigned(family, &logs[family.file].1);
    let torques = |is_recorded: bool| {
        let is_usable = |family: &Family| is_torque(family) && (family.source.is_recorded() || !is_recorded);
        places.iter().find_map(|fits| best_torque(all, Some(position), |family| is_usable(family) && fits(family)))
    };
    torques(true).or_else(|| torques(false)).or(command).cloned()
}

/// Indices of the recordings with the columns of positions and torques. If both are in different files, it is the file
/// of the positions.
fn files_with(logs: &[(&Path, LogContents)], [position, drive]: [(&Family, &[String]); 2]) -> Vec<usize> {
    if drive.0.file != position.0.file {
        return vec![position.0.file];
    }
    let has = |log: &LogContents, name: &String| log.channels.iter().any(|channel| channel.name == *name);
    let holds = |file: &usize| position.1.iter().chain(drive.1).all(|name| has(&logs[*file].1, name));
    (0..logs.len()).filter(holds).collect()
}

/// Number of rows per row with values in all columns.
fn rows_of_complete_one(logs: &[(&Path, LogContents)], chosen: [(&Family, &[String]); 2], files: &[usize]) -> f64 {
    let is_pair = chosen[0].0.file != chosen[1].0.file;
    let mut most = 1.0_f64;
    for (family, columns) in chosen {
        let own = core::slice::from_ref(&family.file);
        for &file in if is_pair { own } else { files } {
            let channel = |name: &String| logs[file].1.channels.iter().find(|channel| channel.name == *name);
            let shares = columns
                .iter()
                .filter_map(channel)
                .map(|own| (own.samples + own.missing) as f64 / own.samples.max(1) as f64);
            most = shares.fold(most, f64::max);
        }
    }
    most
}

impl RecognisedColumns {
    /// Finds the columns of `logs` for the joints of `model`.
    ///
    /// # Errors
    /// No columns of positions, or of torques or commands.
    pub(super) fn find(
        model: &Model,
        logs: &[(&Path, LogContents)],
        thresholds: &NewStudySettings,
    ) -> Result<Self, NewStudyError> {
        let names: Vec<String> = model.joints().iter().map(|joint| joint.name.clone()).collect();
        let free: Vec<usize> = (0..model.dof()).filter(|&joint| model.joints()[joint].mimic.is_none()).collect();
        let robot = RobotJoints::new(model, &names, free);
        let paths = || logs.iter().map(|(path, log)| (*path, log));
        let counts = [robot.free.len(), robot.turning.len()];
        let joined = joined_families(logs, &robot, counts);
        let mut all = without_foreign_grippers(&without_other_arms(&joined, &robot), &robot);
        let missing =
            |quantity, all: &[Family]| NewStudyError::NotRecognised { quantity, found: recognised(all, logs) };
        // Columns with unknown names, one for each joint.
        let assume = |all: &mut Vec<Family>, quantity| {
            let further = families_without_quantity(paths(), &names, quantity);
            all.extend(new_family(further, all, counts));
        };
        if best(&all, Quantity::Position, |_| true).is_none() {
            assume(&mut all, Quantity::Position);
        }
        let found = best(&all, Quantity::Position, |_| true).ok_or_else(|| missing("positions", &all))?.clone();
        let (position, mut apart) = without_other_publisher(found.clone(), &logs[found.file].1);
        all.iter_mut()
            .filter(|family| **family == found)
            .for_each(|family| family.columns.clone_from(&position.columns));
        let position = &position;
        let left_out = names_of_same_kind(&joined, position, &logs[position.file].1);
        let logged =
            logged_joints(position, &robot, &left_out).ok_or_else(|| NewStudyError::MoreColumnsThanJoints {
                columns: position.columns.len(),
                joints: robot.free.len(),
                probable: column_list(&probable_columns(position, &robot)),
            })?;
        let logged = with_unread_names(logged, position, &logs[position.file].1);

        // Torques of some joints only: the others are locked.
        let recorded = recorded_torques(&all, position, logs);
        let places = places_with_torque(&recorded, position, &logged.joints, &robot);
        let with_torque = places.map(|places| {
            let is_kept = |place: &usize| places.contains(place);
            let (kept, others): (Vec<usize>, Vec<usize>) = (0..logged.joints.len()).partition(is_kept);
            let width = |column: &str| range(logs, column).map_or(0.0, |[low, high]| high - low);
            let widths = position.columns.iter().map(|(_, column)| width(column));
            let most = thresholds.max_still_share * widths.fold(0.0, f64::max);
            let lock = |place: &usize| {
                let (joint, column) = (logged.joints[*place], &position.columns[*place].1);
                LockedJoint::without_torque(joint, column, width(column) <= most, is_gripper(&robot.names[joint]))
            };
            apart.extend(others.iter().map(lock));
            let columns = kept.iter().map(|place| position.columns[*place].clone()).collect();
            let joints = kept.iter().map(|place| logged.joints[*place]).collect();
            (Family { columns, ..position.clone() }, LoggedJoints { joints, ..logged.clone() })
        });
        if let Some((shortened, _)) = &with_torque {
            all.iter_mut().filter(|family| **family == *position).for_each(|family| family.clone_from(shortened));
        }
        let (position, logged) =
            with_torque.as_ref().map_or((position, &logged), |(position, logged)| (position, logged));
        let ordered = |family: &Family| in_order(family, position, &logged.joints);

        // The columns are searched in the file of the positions, and otherwise in another file with the same number
        // of rows.
        let in_same_file = |family: &Family| family.file == position.file && ordered(family).is_some();
        let rows = |family: &Family| logs[family.file].1.groups.get(family.group).map(|group| group.rows);
        let in_other_file = |family: &Family| {
            family.file != position.file && rows(family) == rows(position) && ordered(family).is_some()
        };
        let places: [&dyn Fn(&Family) -> bool; 2] = [&in_same_file, &in_other_file];
        let mut drive = torque_or_command(&all, position, logs, places);
        if drive.is_none() {
            assume(&mut all, Quantity::Torque);
            drive = torque_or_command(&all, position, logs, places);
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
        let of_velocity = velocity.and_then(ordered);
        let own = |file: usize| if drive.file == position.file { logs } else { &logs[file..=file] };
        let quantities = [(own(position.file), &of_position[..]), (own(drive.file), &of_drive)];
        let still = still_places(quantities, thresholds.max_still_share);
        let is_torque = drive.quantity != Quantity::Position;
        let is_share = |place: &usize| {
            let (joint, column) = (&model.joints()[logged.joints[*place]], &of_position[*place]);
            let range = range(own(position.file), column).filter(|_| is_torque && position.unit_of(column).is_none());
            !still.contains(place) && range.is_some_and(|range| unclear_gripper(joint, range).is_some())
        };
        let shares: Vec<usize> = (0..logged.joints.len()).filter(is_share).collect();
        let still: Vec<usize> = still.into_iter().chain(shares.iter().copied()).collect();
        let place_of = |place: usize| {
            let joint = logged.joints[place];
            if shares.contains(&place) {
                return LockedJoint::share(joint, &of_position[place]);
            }
            LockedJoint::still(joint, &of_position[place], robot.carries_moving(joint, &logged.joints, &still))
        };
        let locked: Vec<LockedJoint> = still.iter().map(|place| place_of(*place)).chain(apart).collect();
        let moving = |columns: &[String]| -> Vec<String> {
            let places = columns.iter().enumerate().filter(|(place, _)| !still.contains(place));
            places.map(|(_, name)| name.clone()).collect()
        };
        let (of_position, of_drive) = (moving(&of_position), moving(&of_drive));
        let joints = logged.joints.iter().enumerate().filter(|(place, _)| !still.contains(place));
        let joints = joints.map(|(_, joint)| *joint).collect();
        let time = LogClock::of_group(&logs[position.file].1, position.group);
        let chosen = [(position, &of_position[..]), (drive, &of_drive)];
        let files = files_with(logs, chosen);
        let rows_of_complete_one = rows_of_complete_one(logs, chosen, &files);
        Ok(Self {
            thresholds: thresholds.clone(),
            columns: [of_position, of_drive],
            velocity_columns: of_velocity.as_deref().map(moving),
            files,
            parts: vec![None; logs.len()],
            time,
            logged: LoggedJoints { joints, ..logged.clone() },
            locked,
            joint_files: None,
            position: position.clone(),
            drive: drive.clone(),
            velocity: velocity.cloned(),
            alternatives,
            equals,
            rows_of_complete_one,
            unused_torque: recorded.first().filter(|_| !is_torque).map(named),
        })
    }

    /// Recordings whose columns are not used.
    pub(super) fn unused_recordings(&self, logs: &[(&Path, LogContents)]) -> Vec<Unsure> {
        let channel_files = [Some(&self.drive), self.velocity.as_ref()].into_iter().flatten().map(|family| family.file);
        let used: Vec<usize> = self.files.iter().copied().chain(channel_files).collect();
        let unused = logs.iter().enumerate().filter(|(number, _)| !used.contains(number));
        let reason = |path: &Path| {
            format!("{} is not in the study: its columns differ from those of the other recordings", path.display())
        };
        unused.map(|(_, (path, _))| Unsure { line: None, proposed: Vec::new(), reason: reason(path) }).collect()
    }

    /// Files of the recording number `log` with one file for each joint, if they have other names than those of the
    /// first recording.
    pub(super) fn renamed_files(&self, log: usize) -> Option<RenamedFiles> {
        self.joint_files.as_ref().and_then(|files| files.renamed(log))
    }

    /// Whether the log has commanded positions instead of torques.
    pub(super) fn has_commands(&self) -> bool {
        self.drive.quantity == Quantity::Position
    }
}

/// Adds a doubt if the file has names of the joints that are not readable, and the columns have numbers only.
fn with_unread_names(logged: LoggedJoints, position: &Family, contents: &LogContents) -> LoggedJoints {
    let is_of_names = |note: &&String| {
        let array = note.split_once(':').map_or("", |(array, _)| array);
        array.contains("name") && note.contains("Python objects")
    };
    let has_numbers = matches!(position.columns[0].0, JointKey::Number(_));
    match contents.notes.iter().find(is_of_names).filter(|_| has_numbers) {
        Some(note) => {
            let reason =
                format!("{}; the order may be another one, because names are not readable: {note}", logged.reason);
            LoggedJoints { reason, is_sure: false, ..logged }
        }
        None => logged,
    }
}
