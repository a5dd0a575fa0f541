//! Events in the recordings of a task, and the recordings without the intervals of clear events.

use crate::error::IdentificationError;
use crate::task::IdentificationTask;
use dynident_events::{EventChoice, EventKind, EventSearch, LogEvent, find_events};
use dynident_recording::IgnoredTorque;
use dynident_rows::{Execution, Logs, Recording, RegressorModel, Role, Samples, Silent};

/// Maximum number of rows of a log that is searched; a longer log is read only as often as the fit requires.
const MAX_ROWS: u64 = 1_000_000;

/// Events of one recording.
#[derive(Clone, Debug)]
pub struct RecordingEvents {
    /// Number of the recording.
    pub index: usize,
    /// Its events and the residuals in which they were found.
    pub search: EventSearch,
}

/// Searches every log of the task for intervals that no single model explains. Prepared motions and logs of more than
/// a million rows are not searched. A log that cannot be read has no events here; the fit reports its error.
pub fn recording_events(task: &IdentificationTask, execution: Execution<'_>) -> Vec<RecordingEvents> {
    let IdentificationTask { robot, recordings, settings, .. } = task;
    let limits = &settings.events;
    let is_searched = |index: &usize| {
        let recording = &recordings[*index];
        matches!(recording.samples, Samples::Log(_)) && recording.estimated_rows().is_none_or(|rows| rows <= MAX_ROWS)
    };
    let indices: Vec<usize> = (0..recordings.len()).filter(is_searched).collect();
    if limits.choice == EventChoice::Off || indices.is_empty() {
        return Vec::new();
    }
    let quiet = Execution { progress: &Silent, ..execution };
    let training: Vec<usize> =
        (0..recordings.len()).filter(|&index| recordings[index].role == Role::Identify).collect();
    let Ok(logs) = Logs::new(robot.model(), recordings, settings.row_settings(), &training, None, quiet) else {
        return Vec::new();
    };
    let logs = logs.without_keeping();
    let model: RegressorModel = robot.clone().into();
    let one = |&index: &usize| -> Result<RecordingEvents, core::convert::Infallible> {
        let mut search = find_events(&logs.pass(&model, index), robot, limits).unwrap_or_default();
        set_aside(&mut search, limits.choice, limits.max_share);
        Ok(RecordingEvents { index, search })
    };
    let Ok(found) = execution.try_map(&indices, one);
    found
}

/// The events of the task's logs, and the task without the intervals that are set aside in its training logs; `None` if
/// there are none.
///
/// # Errors
/// Invalid settings of the search.
pub(crate) fn task_without_events(
    task: &IdentificationTask,
    execution: Execution<'_>,
) -> Result<(Vec<RecordingEvents>, Option<IdentificationTask>), IdentificationError> {
    task.settings.events.validate()?;
    let events = recording_events(task, execution);
    let changed = without_intervals(&task.recordings, &events, Role::Identify);
    Ok((events, changed.map(|recordings| IdentificationTask { recordings, ..task.clone() })))
}

/// Marks the clear events of a log that `choice` sets aside. Nothing is marked if they are a large part of the log,
/// which could then be the normal part; a robot without drives never is.
fn set_aside(search: &mut EventSearch, choice: EventChoice, max_share: f64) {
    let is_marked = |event: &LogEvent| event.clear && choice.sets_aside(event.kind);
    let can_be_normal = |event: &&LogEvent| is_marked(event) && event.kind != EventKind::DrivesOff;
    let share: f64 = search.events.iter().filter(can_be_normal).map(|event| event.share).sum();
    if share > max_share {
        return;
    }
    for event in &mut search.events {
        event.set_aside = is_marked(event);
    }
}

/// The recordings without the torque of the intervals that are set aside in logs of this role; `None` if there are
/// none. Motion and clock keep all rows, so that no filter starts again.
pub(crate) fn without_intervals(
    recordings: &[Recording],
    events: &[RecordingEvents],
    role: Role,
) -> Option<Vec<Recording>> {
    let mut changed = None;
    for RecordingEvents { index, search } in events.iter().filter(|one| recordings[one.index].role == role) {
        if search.events.iter().all(|event| !event.set_aside) {
            continue;
        }
        let all = changed.get_or_insert_with(|| recordings.to_vec());
        if let Samples::Log(log) = &mut all[*index].samples {
            let places = |names: &[String]| -> Vec<usize> {
                names.iter().filter_map(|name| log.joints.iter().position(|joint| joint == name)).collect()
            };
            let ignored: Vec<IgnoredTorque> = (search.events.iter().filter(|event| event.set_aside))
                .map(|event| IgnoredTorque { time_s: left_out_s(search, event), joints: places(&event.affected) })
                .collect();
            log.ignored_torque.extend(ignored);
        }
    }
    changed
}

/// Start and end of the intervals that are set aside, s.
pub(crate) fn left_out(search: &EventSearch) -> Vec<[f64; 2]> {
    let set_aside = search.events.iter().filter(|event| event.set_aside);
    set_aside.map(|event| left_out_s(search, event)).collect()
}

/// Interval of an event, longer at both ends by one bin; by three around a filled hole, whose positions are wrong too.
fn left_out_s(search: &EventSearch, event: &LogEvent) -> [f64; 2] {
    let margin_s = if event.kind == EventKind::Interpolated { 3.0 } else { 1.0 } * search.bin_s;
    [event.from_s - margin_s, event.to_s + margin_s]
}
