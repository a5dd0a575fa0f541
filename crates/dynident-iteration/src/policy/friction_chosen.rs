use crate::policy::record::RunRecord;
use dynident_identification::friction::JointFriction;

/// Returns the friction that the first run with sufficient data selected for itself and later runs; empty if friction
/// is not selected.
pub fn friction_chosen(records: &[RunRecord]) -> Vec<JointFriction> {
    let choices = records.iter().filter_map(|record| Some(&record.estimate.as_ref()?.friction));
    choices.into_iter().find(|choice| !choice.is_empty()).cloned().unwrap_or_default()
}
