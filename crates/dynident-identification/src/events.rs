//! Events in the recordings of a task, and the recordings without the intervals of clear events.

use crate::error::IdentificationError;
use crate::task::IdentificationTask;
use dynident_events::{EventChoice, EventKind, EventSearch, LogEvent, find_events};
use dynident_recording::IgnoredTorque;
use dynident_rows::{Execution, Logs, Recording, RegressorModel, Role, Samples, Silent};

/// Maximum number of rows of a log that is searched for events. A longer log is read only as often as the fit requires.
const MAX_ROWS: u64 = 1_000_000;

/// Events of one recording.
#[derive(Clone, Debug)]
pub struct RecordingEvents {
    /// Index of the recording.
    pub index: usize,
    /// The events of the recording, and the residuals in which they were found.
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

/// The events in the logs of a task, and the task without the intervals of its training logs that are excluded from the
/// fit; `None` if no interval is excluded.
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

/// Marks the clear events of a log that are excluded from the fit according to `choice`. Nothing is marked if the
/// events are a large part of the log, because this part could be the normal one. A rest with the drives off is never
/// the normal part.
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

/// The recordings with this role, without the torque of excluded intervals; `None` if no interval is excluded. Motion
/// and time stamps keep all rows, so that no filter starts again.
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

/// Start and end of the excluded intervals, s.
pub(crate) fn left_out(search: &EventSearch) -> Vec<[f64; 2]> {
    let set_aside = search.events.iter().filter(|event| event.set_aside);
    set_aside.map(|event| left_out_s(search, event)).collect()
}

/// Interval of an event, extended at both ends by one bin. Around a filled hole it is extended by three bins, because
/// the positions there are wrong, too.
fn left_out_s(search: &EventSearch, event: &LogEvent) -> [f64; 2] {
    let margin_s = if event.kind == EventKind::Interpolated { 3.0 } else { 1.0 } * search.bin_s;
    [event.from_s - margin_s, event.to_s + margin_s]
}
