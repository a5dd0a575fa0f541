//! Lower bound of the estimation error of one run.

use crate::study::StudyRobot;
use dynident_excitation::Information;
use dynident_excitation::Motion;
use dynident_iteration::Leg;
use dynident_simulation::SensorSettings;
use nalgebra::DMatrix;

const BLOCK_SAMPLES: usize = 4096;

/// Cramér-Rao bound of every base parameter, `√ diag (Σ Wᵀ Σ_τ⁻¹ W)⁻¹` with regressor W and torque noise Σ_τ. The sum
/// is over the used samples of the trajectories, for white torque noise and exact positions. `None` without torque
/// noise, with correlated noise, or if the motion does not excite a parameter.
pub(super) fn cramer_rao(robot: &StudyRobot, legs: &[Leg], sensors: &SensorSettings) -> Option<Vec<f64>> {
    let dof = robot.model().dof();
    let std: Vec<f64> = (0..dof).map(|joint| sensors.torque_std.of(joint)).collect();
    if sensors.torque_correlation != 0.0 || std.iter().any(|std| *std <= 0.0) {
        return None;
    }
    let columns = robot.layout().columns().len();
    let mut sum = DMatrix::zeros(columns, columns);
    for leg in legs {
        let (whole, rate_hz) = (leg.reference().motion(), leg.reference().rate_hz());
        let mut own = DMatrix::zeros(columns, columns);
        if leg.windows().is_none() {
            own += information(robot, whole, &std, &(0..whole.samples).collect::<Vec<usize>>());
        } else {
            for joint in 0..dof {
                let inside = |sample: &usize| leg.counts(joint, *sample as f64 / rate_hz);
                let samples: Vec<usize> = (0..whole.samples).filter(inside).collect();
                // Infinite noise excludes the torque of the other joints.
                let mut alone = vec![f64::INFINITY; dof];
                alone[joint] = std[joint];
                own += information(robot, whole, &alone, &samples);
            }
        }
        // The sum is multiplied by the ratio of recorded to controlled samples.
        sum += own * (sensors.record_rate_hz.unwrap_or(rate_hz) / rate_hz);
    }
    let count = sum.nrows();
    let scale: Vec<f64> = (0..count).map(|k| sum[(k, k)].sqrt()).collect();
    if scale.iter().any(|scale| *scale <= 0.0 || !scale.is_finite()) {
        return None;
    }
    let scaled = DMatrix::from_fn(count, count, |row, column| sum[(row, column)] / (scale[row] * scale[column]));
    let inverse = scaled.cholesky()?.inverse();
    Some((0..count).map(|k| inverse[(k, k)].sqrt() / scale[k]).collect())
}

/// Information `Σ Wᵀ Σ_τ⁻¹ W` over selected samples of a motion (regressor W, torque noise Σ_τ).
fn information(robot: &StudyRobot, whole: &Motion, std: &[f64], samples: &[usize]) -> DMatrix<f64> {
    let dof = robot.model().dof();
    let mut gatherer = Information::new(robot.model(), robot.layout(), std, None);
    let count = robot.layout().columns().len();
    let mut sum = DMatrix::zeros(count, count);
    for some in samples.chunks(BLOCK_SAMPLES) {
        let mut part = Motion::default();
        part.reset(dof, some.len());
        for joint in 0..dof {
            let (to, from) = (part.of(joint), joint * whole.samples);
            for (to_values, values) in [(&mut part.q, &whole.q), (&mut part.dq, &whole.dq), (&mut part.ddq, &whole.ddq)]
            {
                for (to, sample) in to_values[to.clone()].iter_mut().zip(some) {
                    *to = values[from + sample];
                }
            }
        }
        sum += gatherer.of(&part, 1.0);
    }
    sum
}
