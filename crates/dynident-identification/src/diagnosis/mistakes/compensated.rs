//! Mistake: the logged torque lacks the gravity torque of the nominal bodies.

use super::kind::{Breadth, Facts, MistakeKind, Proof, Setup};
use crate::diagnosis::motion_rows::MotionRows;
use crate::diagnosis::nominal::gravity_torque;
use dynident_dynamics::ParametricModel;

/// The controller logs only the torque in addition to its gravity compensation, so the torques lack the gravity torque
/// of the nominal bodies.
#[derive(Clone, Debug, PartialEq)]
pub struct Compensated;

impl MistakeKind for Compensated {
    fn candidates(setup: Setup<'_>, breadth: Breadth<'_>) -> Vec<Self> {
        let is_described = setup.robot.nominal_base().is_some() && setup.model().gravity().norm() > 0.0;
        if matches!(breadth, Breadth::Rare) && is_described { vec![Self] } else { Vec::new() }
    }

    fn correct(&self, robot: &ParametricModel, rows: &mut MotionRows) {
        let gravity = gravity_torque(robot, rows);
        for (tau, gravity) in rows.tau.iter_mut().zip(gravity) {
            tau.iter_mut().zip(gravity).for_each(|(tau, gravity)| *tau += gravity);
        }
    }

    fn facts(&self) -> Facts {
        Facts {
            rarity: 0.3,
            adds_torques: true,
            is_of_all_logs: true,
            proof: Proof::ConsistentRobot,
            ..Facts::of("mounting")
        }
    }

    fn sentence(&self, _: &[String]) -> String {
        "the torque is without gravity: the controller subtracts the gravity torque of the robot description; log the \
         torque with gravity, or add the subtracted torque to the columns"
            .to_owned()
    }
}
