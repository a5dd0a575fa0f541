//! How much parameters count beside each other: by the torque that they make.

use crate::leg::Leg;
use crate::run_information::{RunNoise, run_information};
use dynident_dynamics::ParametricModel;

/// For each base parameter the torque that one of its unit makes along the legs, as a share of the joints' own:
/// `√(Σ_j mean(w_j²) / r_j²)` with the column `w_j` of the regressor and the root mean square `r_j` = `torque_rms` of
/// joint j's torque (Nm, N). A mass and a moment of inertia have no other common measure; joints without torque do not
/// count.
pub(crate) fn parameter_shares(robot: &ParametricModel, legs: &[Leg], torque_rms: &[f64]) -> Vec<f64> {
    let joint_sigma = torque_rms.iter().map(|rms| if *rms > 0.0 { *rms } else { f64::INFINITY }).collect();
    let noise = RunNoise { joint_sigma, rows_per_s: 1.0 };
    let mut squares = vec![0.0; robot.layout().columns().len()];
    for leg in legs {
        let information = run_information(robot, leg.reference(), &noise);
        squares.iter_mut().zip(information.diagonal().iter()).for_each(|(sum, own)| *sum += own);
    }
    let duration_s: f64 = legs.iter().map(|leg| leg.reference().duration_s()).sum();
    squares.into_iter().map(|square| (square / duration_s.max(f64::MIN_POSITIVE)).sqrt()).collect()
}
