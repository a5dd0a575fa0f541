//! A designed motion in the names and units of a LeRobot data set.

use crate::error::Error;
use crate::study::{Study, StudyError, StudyRobot};
use dynident_recording::log::{ColumnRef, Quantity};
use std::path::Path;

/// Actions of a LeRobot data set.
#[derive(Clone, Debug, PartialEq)]
pub struct LeRobotActions {
    /// Names of the actions, for example `shoulder_pan.pos`.
    pub names: Vec<String>,
    /// Values of each action.
    pub values: Vec<Vec<f64>>,
    /// Description of how names and units were chosen.
    pub notes: Vec<String>,
}

/// Features of a data set whose entries are positions of joints.
const FEATURES: [&str; 2] = ["action", "observation.state"];

/// The positions of the joints as actions. If `[format]` has columns of a LeRobot data set in `command`, or otherwise
/// in `position`, their names and units are used. If not, the names are `JOINT.pos`, in degrees (m).
///
/// # Errors
/// Columns that do not match the joints, or a matrix.
pub fn lerobot_actions(
    study: &Study,
    study_path: &Path,
    robot: &StudyRobot,
    positions: &[Vec<f64>],
) -> Result<LeRobotActions, Error> {
    let joints = robot.model().joints();
    let moved = |name: &String| joints.iter().position(|joint| joint.name == *name);
    // Columns of a log can belong to locked joints.
    let rest = vec![0.0; positions.first().map_or(0, Vec::len)];
    let of_log: Vec<Vec<f64>> = robot
        .log_joints
        .iter()
        .map(|name| moved(name).and_then(|joint| positions.get(joint)).unwrap_or(&rest).clone())
        .collect();
    if let Some(format) = &study.format {
        let groups = [(Quantity::Command, format.command.as_ref()), (Quantity::Position, Some(&format.position))];
        for (quantity, group) in groups.into_iter().filter_map(|(quantity, group)| Some((quantity, group?))) {
            let in_format = |error: dynident_recording::FormatError| {
                Error::section(study_path, "format")(StudyError::conflict("columns of LeRobot", error.to_string()))
            };
            let columns = group.recorded(quantity, &robot.log_joints, &of_log).map_err(in_format)?;
            let own = columns.into_iter().zip(&robot.log_joints).filter(|(_, name)| moved(name).is_some());
            let columns: Vec<(ColumnRef, Vec<f64>)> = own.map(|(column, _)| column).collect();
            let names: Option<Vec<String>> = columns.iter().map(|(column, _)| action_name(column)).collect();
            if let Some(names) = names {
                let note = format!("LeRobot: names and units of the actions are those of [format] {}.", quantity.key());
                let values = columns.into_iter().map(|(_, values)| values).collect();
                return Ok(LeRobotActions { names, values, notes: vec![note] });
            }
        }
    }
    let in_unit = |(values, joint): (&Vec<f64>, &dynident_model::Joint)| -> Vec<f64> {
        let factor = if joint.is_rotary() { 180.0 / core::f64::consts::PI } else { 1.0 };
        values.iter().map(|value| value * factor).collect()
    };
    let note = "LeRobot: actions are JOINT.pos in degrees (m), as with use_degrees. If your robot has other names or \
                units, for example a gripper in percent, state the columns of one of its data sets in [format] command.";
    Ok(LeRobotActions {
        names: joints.iter().map(|joint| format!("{}.pos", joint.name)).collect(),
        values: positions.iter().zip(joints).map(in_unit).collect(),
        notes: vec![note.to_owned()],
    })
}

/// The entry of a feature: `elbow.pos` in `action[elbow.pos]`. `None` for other columns.
fn action_name(column: &ColumnRef) -> Option<String> {
    let ColumnRef::Name(name) = column else { return None };
    let (feature, entry) = name.strip_suffix(']')?.split_once('[')?;
    (FEATURES.contains(&feature) && entry.parse::<usize>().is_err()).then(|| entry.to_owned())
}
