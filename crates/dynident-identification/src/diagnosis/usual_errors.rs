//! Torques of robots that the description describes with the errors that descriptions have: what the description may
//! say of a log without being wrong.

use super::explanation::{predicted, without_terms};
use super::motion_rows::MotionRows;
use crate::consistent::{ConsistencySettings, usual_errors_of_bodies};
use dynident_dynamics::ParametricModel;
use dynident_model::sample::Random;

/// Share of its extent by which a body is thicker than described: descriptions have rods.
const THICKER: f64 = 0.3;
/// Robots that are asked.
const ROBOTS: usize = 100;
const SEED: u64 = 0x6f77_6e20_726f_626f;

/// The torque of the bodies of [`ROBOTS`] robots in the motion of `rows`, one vector for each joint, Nm (N): bodies of
/// the description with errors as [`usual_errors_of_bodies`] has them, by a fixed seed. None while a body's inertials
/// are unknown.
pub(super) fn torques_of_likely_robots<'a>(
    robot: &'a ParametricModel,
    rows: &'a MotionRows,
) -> Option<impl Iterator<Item = Vec<Vec<f64>>> + 'a> {
    let nominal = robot.nominal_base()?;
    let errors = usual_errors_of_bodies(robot, &ConsistencySettings::default(), THICKER);
    let mut random = Random::new(SEED);
    Some((0..ROBOTS).map(move |_| {
        let mut theta = nominal.to_vec();
        for error in &errors {
            let size = random.normal();
            theta.iter_mut().zip(error).for_each(|(value, error)| *value += size * error);
        }
        predicted(robot, rows, &without_terms(robot, &theta))
    }))
}
