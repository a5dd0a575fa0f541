//! Velocities in the logs, for the approximation of friction.

use dynident_export::RecordedVelocity;
use dynident_identification::rows::VelocityHistogram;

/// Velocities of all logs for each joint; a log has one histogram per joint, or none.
pub(super) fn recorded_velocities<'a>(
    logs: impl Iterator<Item = &'a [VelocityHistogram]>,
    dof: usize,
) -> Vec<Vec<RecordedVelocity>> {
    let logs: Vec<&[VelocityHistogram]> = logs.collect();
    let of_joint = |joint: usize| {
        let moving = logs.iter().filter_map(|log| log.get(joint)).flat_map(VelocityHistogram::moving);
        moving.map(|(velocity, samples)| RecordedVelocity { velocity, samples: samples as f64 }).collect()
    };
    (0..dof).map(of_joint).collect()
}
