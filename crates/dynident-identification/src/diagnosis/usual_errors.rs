//! Torque of random robots that differ from the description by usual errors.

use super::explanation::{predicted, without_terms};
use super::motion_rows::MotionRows;
use crate::consistent::{ConsistencySettings, usual_errors_of_bodies};
use dynident_dynamics::ParametricModel;
use dynident_model::sample::Random;

/// Thickness that is added to bodies, relative to their extent, because descriptions contain thin rods.
const ADDED_THICKNESS: f64 = 0.3;
const ROBOTS: usize = 100;
const SEED: u64 = 0x6f77_6e20_726f_626f;

/// Torque of the bodies of [`ROBOTS`] random robots for the motion in `rows`, one vector for each joint, Nm (N). The
/// random errors are those of [`usual_errors_of_bodies`], with a fixed seed. `None` if inertial parameters of a body
/// are unknown.
pub(super) fn torques_of_likely_robots<'a>(
    robot: &'a ParametricModel,
    rows: &'a MotionRows,
) -> Option<impl Iterator<Item = Vec<Vec<f64>>> + 'a> {
    let nominal = robot.nominal_base()?;
    let errors = usual_errors_of_bodies(robot, &ConsistencySettings::default(), ADDED_THICKNESS);
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
