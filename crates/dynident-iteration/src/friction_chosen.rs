//! The friction that the first run which was able to chose, for itself and all runs after it.

use crate::record::RunRecord;
use dynident_identification::friction::JointFriction;

/// The friction that a run chose for itself and those after it; empty where it was stated.
pub fn friction_chosen(records: &[RunRecord]) -> Vec<JointFriction> {
    let choices = records.iter().filter_map(|record| Some(&record.estimate.as_ref()?.friction));
    choices.into_iter().find(|choice| !choice.is_empty()).cloned().unwrap_or_default()
}
