//! Changes of study keys that correct a mistake.

use crate::result::StudyChange;
use crate::study::{Study, StudyRobot};
use dynident_identification::Role;
use dynident_identification::diagnosis::{Mistake, StudyKeys};

/// Keys for the first training log; `None` for a study without training logs.
pub(super) fn keys_of_study(study: &Study, robot: &StudyRobot) -> Option<StudyKeys> {
    let index = *study.logs_of_role(Role::Identify).first()?;
    let keys = keys_of_log(study, robot, index);
    let is_common = study.log[index].format.is_none();
    Some(if is_common { StudyKeys { table: "format".to_owned(), ..keys } } else { keys })
}

/// Keys for log number `index` only; the other logs keep theirs.
pub(super) fn keys_of_log(study: &Study, robot: &StudyRobot, index: usize) -> StudyKeys {
    let place = |joint: usize| {
        let name = &robot.model().joints()[joint].name;
        robot.log_joints.iter().position(|log_joint| log_joint == name).unwrap_or(joint)
    };
    StudyKeys {
        format: study.format_of(index),
        table: format!("[[log]] {}: format", index + 1),
        places: (0..robot.model().dof()).map(place).collect(),
        columns: robot.log_joints.len(),
        torque_lag_s: study.motion.torque_lag_s.clone(),
        has_base_rotation: study.robot.base_rpy_rad.is_some() || study.robot.base_rpy_deg.is_some(),
    }
}

/// Key changes that correct a mistake; empty without keys.
pub(super) fn changes(mistake: &Mistake, keys: Option<&StudyKeys>) -> Vec<StudyChange> {
    let changes = keys.map_or_else(Vec::new, |keys| mistake.changes(keys));
    changes.into_iter().map(StudyChange::from).collect()
}
