//! Width of the smoothed sign of dry friction that fits some rows best.
//!
//! If the width in the model is wrong, another sample rate can seem to fit better, because it scales all velocities.
//! The width itself is not a mistake of the study, because an identification selects it.

use super::joint_fits::JointFits;
use super::motion_rows::MotionRows;
use dynident_dynamics::ParametricModel;
use dynident_estimation::EstimationError;
use dynident_model::terms::{CoulombShape, TorqueTerm};
use rayon::prelude::*;

/// Factors on the present width that are tried first.
const WIDTH_FACTORS: [f64; 7] = [0.4, 1.6, 2.5, 4.0, 6.0, 10.0, 15.0];
/// Finer factors, which are tried in this order on the best width so far.
const FINE_FACTORS: [[f64; 2]; 2] = [[0.77, 1.3], [0.88, 1.14]];

/// The robot with the widths of smoothed signs for which one set of base parameters ([`JointFits::one_set`]) has the
/// smallest residual of each joint. The present widths are kept unless others have at most `max_ratio` times their
/// residual. One set is used because separate parameters of each joint would also fit a wrong width.
pub(super) fn with_fitted_steps(
    robot: &ParametricModel,
    rows: &MotionRows,
    max_ratio: f64,
) -> Result<ParametricModel, EstimationError> {
    let mut least: Vec<f64> = left_by_one_set(robot, rows)?.iter().map(|left| max_ratio * left).collect();
    let mut times = vec![1.0; robot.dof()];
    let first: Vec<Vec<f64>> = WIDTH_FACTORS.iter().map(|factor| vec![*factor; robot.dof()]).collect();
    narrow_down(robot, rows, &first, &mut least, &mut times)?;
    if times.iter().all(|times| *times == 1.0) {
        return Ok(robot.clone());
    }
    for factors in FINE_FACTORS {
        let near = |factor: f64| times.iter().map(|best| if *best == 1.0 { 1.0 } else { factor * best }).collect();
        let near: [Vec<f64>; 2] = factors.map(near);
        narrow_down(robot, rows, &near, &mut least, &mut times)?;
    }
    Ok(with_widths(robot, &times).unwrap_or_else(|| robot.clone()))
}

fn left_by_one_set(robot: &ParametricModel, rows: &MotionRows) -> Result<Vec<f64>, EstimationError> {
    let (_, left) = JointFits::new(robot, rows)?.one_set()?;
    Ok(left)
}

/// Tries the widths `tried`, and updates for each joint the smallest residual and the factor on its width.
fn narrow_down(
    robot: &ParametricModel,
    rows: &MotionRows,
    tried: &[Vec<f64>],
    least: &mut [f64],
    times: &mut [f64],
) -> Result<(), EstimationError> {
    let left = |times: &Vec<f64>| with_widths(robot, times).map(|other| left_by_one_set(&other, rows)).transpose();
    let all: Vec<Option<Vec<f64>>> = tried.par_iter().map(left).collect::<Result<_, EstimationError>>()?;
    for (tried, left) in tried.iter().zip(all).filter_map(|(tried, left)| Some((tried, left?))) {
        for joint in 0..left.len() {
            if left[joint] < least[joint] {
                (least[joint], times[joint]) = (left[joint], tried[joint]);
            }
        }
    }
    Ok(())
}

/// The robot with the width of each joint's smoothed signs multiplied by a factor; `None` if nothing changes.
pub(super) fn with_widths(robot: &ParametricModel, times: &[f64]) -> Option<ParametricModel> {
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
