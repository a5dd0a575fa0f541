//! The least that the errors of one run can be.

use super::trajectory::Trajectory;
use crate::machine::Machine;
use dynident_excitation::Information;
use dynident_excitation::Motion;
use dynident_experiment::SensorSettings;
use nalgebra::DMatrix;

/// Samples whose regressor is held at once.
const SAMPLES_AT_ONCE: usize = 4096;

/// The Cramér-Rao bound of every base parameter: `√ diag (Σ Wᵀ Σ_τ⁻¹ W)⁻¹` over the recorded samples along the trajectory, for white torque noise and exact positions; none without torque noise, with
/// correlated noise, where only parts of the trajectory count, or where a parameter is not excited.
pub(super) fn cramer_rao(
    machine: &Machine,
    trajectory: &Trajectory,
    sensors: &SensorSettings,
    windows: Option<&[Vec<[f64; 2]>]>,
) -> Option<Vec<f64>> {
    let dof = machine.model.dof();
    let std: Vec<f64> = (0..dof).map(|joint| sensors.torque_std.of(joint)).collect();
    if windows.is_some() || sensors.torque_correlation != 0.0 || std.iter().any(|std| *std <= 0.0) {
        return None;
    }
    let mut gatherer = Information::new(&machine.model, &machine.layout, &std, None);
    let count = machine.layout.columns().len();
    let mut sum = DMatrix::zeros(count, count);
    let whole = trajectory.motion();
    for from in (0..whole.samples).step_by(SAMPLES_AT_ONCE) {
        let samples = SAMPLES_AT_ONCE.min(whole.samples - from);
        let mut part = Motion::default();
        part.reset(dof, samples);
        for joint in 0..dof {
            let (to, at) = (part.of(joint), joint * whole.samples + from);
            for (to_values, values) in [(&mut part.q, &whole.q), (&mut part.dq, &whole.dq), (&mut part.ddq, &whole.ddq)]
            {
                to_values[to.clone()].copy_from_slice(&values[at..at + samples]);
            }
        }
        sum += gatherer.of(&part, 1.0);
    }
    // Samples a second that are recorded, of those that are controlled.
    sum *= sensors.record_rate_hz.unwrap_or(trajectory.rate_hz) / trajectory.rate_hz;
    let scale: Vec<f64> = (0..count).map(|k| sum[(k, k)].sqrt()).collect();
    if scale.iter().any(|scale| *scale <= 0.0 || !scale.is_finite()) {
        return None;
    }
    let scaled = DMatrix::from_fn(count, count, |row, column| sum[(row, column)] / (scale[row] * scale[column]));
    let inverse = scaled.cholesky()?.inverse();
    Some((0..count).map(|k| inverse[(k, k)].sqrt() / scale[k]).collect())
}
