//! Torque that results from noise of the positions.

use super::motion_rows::instant_filter;
use dynident_rows::{LogError, LogPass, Logs, RegressorModel, noise_factors};

/// Root mean square torque of each joint, Nm (N), that position noise adds to the prediction by base parameters `theta`
/// at the compared instants, over the recordings `training`: `N θ` with the rows N of [`noise_factors`]. Zero if the
/// noise is unknown.
pub(super) fn torque_of_noise(
    logs: &Logs<'_>,
    model: &RegressorModel,
    training: &[usize],
    theta: &[f64],
) -> Result<Vec<f64>, LogError> {
    let mut squares = vec![0.0; model.dof()];
    for &index in training {
        let pass = logs.pass_for_instants(model, index);
        let Some(report) = pass.each_block(&mut |_| Ok(()))? else { continue };
        let filter = instant_filter(logs, report.rate_hz);
        let pass = LogPass { filter: &filter, ..pass };
        // Weighted so that the noise rows represent one row.
        let Some(factors) = noise_factors(&pass, model, Some(&report), 1)? else { continue };
        for (joint, (square, factor)) in squares.iter_mut().zip(&factors).enumerate() {
            let own: Vec<f64> = model.layout().joint_columns(joint).iter().map(|&column| theta[column]).collect();
            let in_rows = |source| LogError::Rows { log: logs.recordings[index].name.clone(), source };
            *square += factor.total().residual_sum_of_squares(&own).map_err(in_rows)? / training.len() as f64;
        }
    }
    Ok(squares.into_iter().map(f64::sqrt).collect())
}
