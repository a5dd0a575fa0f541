use crate::setup::leg::Leg;
use crate::setup::run_information::{RunNoise, run_information};
use dynident_dynamics::ParametricModel;

/// Torque share of each base parameter: torque of one unit of it along the trajectories relative to the joint
/// torques, `√(Σ_j mean(w_j²) / r_j²)`. `w_j` is the parameter's column of joint j's regressor, and `r_j` =
/// `torque_rms` the root mean square of joint j's torque (Nm, N). The shares make parameters of different units
/// comparable. Joints without torque are ignored.
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
