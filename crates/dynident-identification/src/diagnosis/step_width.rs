//! How wide the step of dry friction is in some rows.
//!
//! A motion that is read slower than it was has its steps nearer to zero velocity, so another rate would get the credit
//! for a step that is only wider than the study's. The width is no mistake of a study: identification chooses it.

use super::explanation::Explanation;
use super::motion_rows::MotionRows;
use dynident_dynamics::ParametricModel;
use dynident_estimation::EstimationError;
use dynident_model::terms::{CoulombShape, TorqueTerm};

/// Times the width in force that are tried, narrower and wider.
const TIMES: [f64; 4] = [0.4, 2.5, 6.0, 15.0];
/// Share of what is left of a joint's torque that another width leaves at most: less is its noise.
const CLEARLY_LESS: f64 = 0.9;

/// The robot with the widths of smooth steps at which parameters of each joint's own leave least of its torque
/// ([`Explanation::alone`]); those in force where no other leaves clearly less.
///
/// # Errors
/// Too few rows.
pub(super) fn with_steps_of(robot: &ParametricModel, rows: &MotionRows) -> Result<ParametricModel, EstimationError> {
    let mut least =
        Explanation::new(robot, rows, None)?.alone.iter().map(|left| CLEARLY_LESS * left).collect::<Vec<_>>();
    let mut times = vec![1.0; robot.dof()];
    for factor in TIMES {
        let Some(other) = with_widths(robot, &vec![factor; robot.dof()]) else { continue };
        for (joint, left) in Explanation::new(&other, rows, None)?.alone.iter().enumerate() {
            if *left < least[joint] {
                (least[joint], times[joint]) = (*left, factor);
            }
        }
    }
    let is_other = times.iter().any(|factor| *factor != 1.0);
    Ok(is_other.then(|| with_widths(robot, &times)).flatten().unwrap_or_else(|| robot.clone()))
}

/// The robot with each joint's smooth steps so many times as wide; none where it has none.
fn with_widths(robot: &ParametricModel, times: &[f64]) -> Option<ParametricModel> {
    let widened = |term: &TorqueTerm| match term.joints()[..] {
        [joint] => term.clone().with_step(|step| match step {
            CoulombShape::Smooth { width } => CoulombShape::Smooth { width: times[joint] * width },
            dry @ CoulombShape::Sign { .. } => dry,
        }),
        _ => term.clone(),
    };
    let terms: Vec<TorqueTerm> = robot.terms().iter().map(widened).collect();
    (terms != robot.terms()).then(|| robot.with_terms(terms).ok()).flatten()
}
