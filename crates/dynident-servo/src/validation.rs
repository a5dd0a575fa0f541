//! Simulation of a fitted robot for recorded commands.

use crate::error::ServoError;
use crate::law::DriveLaw;
use crate::parameters::{ServoRobot, VariedRobot};
use crate::rollout::Rollout;
use crate::run::Run;
use crate::step_state::Stepping;

/// Simulated positions of each joint at the time stamps of a run, rad (m). The simulation starts at rest at the first
/// measured position and is not reset later. `None` if the simulation diverges.
///
/// # Errors
/// A run that does not fit the robot.
pub fn simulate(robot: &ServoRobot, run: &Run, step_s: f64) -> Result<Option<Vec<Vec<f64>>>, ServoError> {
    simulate_with_law(robot, run, step_s, DriveLaw::Identified)
}

/// As [`simulate`], but with the time steps of another simulator, which computes the torque of the drives by `law`.
///
/// # Errors
/// A run that does not fit the robot.
pub fn simulate_with_law(
    robot: &ServoRobot,
    run: &Run,
    step_s: f64,
    law: DriveLaw,
) -> Result<Option<Vec<Vec<f64>>>, ServoError> {
    run.validate(robot.model.dof())?;
    let varied = VariedRobot::new(robot, &[], &[])?;
    let mut positions = vec![vec![0.0; run.times_s.len()]; run.positions.len()];
    let ended = Rollout::new(&varied, run, Stepping::of_law(law, step_s), false).is_some_and(|rollout| {
        rollout.simulate(|predicted| positions[predicted.joint][predicted.sample] = predicted.position)
    });
    Ok(ended.then_some(positions))
}

/// Root mean square difference between the measured and the given positions of each joint, rad (m).
pub fn errors(run: &Run, positions: &[Vec<f64>]) -> Vec<f64> {
    let error = |(measured, simulated): (&Vec<f64>, &Vec<f64>)| {
        let squares: f64 = measured.iter().zip(simulated).map(|(m, s)| (m - s).powi(2)).sum();
        (squares / measured.len() as f64).sqrt()
    };
    run.positions.iter().zip(positions).map(error).collect()
}
