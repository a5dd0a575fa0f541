//! Test for one wrong mass in the description, as an alternative to another unit of all torques.

use super::friction_spans::FrictionSpans;
use super::motion_rows::MotionRows;
use super::nominal::nominal_torque;
use dynident_dynamics::ParametricModel;
use dynident_model::InertialParameters;

/// A body with a wrong mass that explains the torques better than another unit of each torque.
#[derive(Clone, Debug, PartialEq)]
pub struct WrongMass {
    /// Index of the body.
    pub body: usize,
    /// Correct mass and inertia divided by the described values.
    pub factor: f64,
    /// Unexplained share of the torques after the correction, with friction removed (root mean squares).
    pub left: f64,
}

/// Finds a body with a factor on its mass and inertia that explains the torques better than a separate factor for every
/// joint. The factor must be outside of `usual_ratios`. `left_by_scales` is the residual with separate factors: the sum
/// over joints of squared residuals relative to the torque, with friction removed.
///
/// After friction, drive inertia and offset are removed, `τ - τ_others = s τ_body` has a single unknown s for all
/// joints.
pub(super) fn wrong_mass(
    robot: &ParametricModel,
    rows: &MotionRows,
    friction: &FrictionSpans,
    left_by_scales: f64,
    usual_ratios: [f64; 2],
) -> Option<WrongMass> {
    let all = nominal_torque(robot, rows)?;
    let torque = friction.remove_all(&rows.tau);
    let inertials = robot.model().inertials();
    let of_body = |body: usize| {
        let own: Vec<InertialParameters> = (0..inertials.len())
            .map(|other| if other == body { inertials[other] } else { InertialParameters([0.0; 10]) })
            .collect();
        let alone = ParametricModel::new(robot.model().with_inertials(&own).ok()?, Vec::new()).ok()?;
        let alone = nominal_torque(&alone, rows)?;
        let (mut product, mut square, mut left) = (0.0, 0.0, 0.0);
        for (joint, torque) in torque.iter().enumerate().filter(|(_, torque)| torque.norm_squared() > 0.0) {
            let own = friction.remove(joint, &alone[joint]);
            let rest = torque - (friction.remove(joint, &all[joint]) - &own);
            let weight = torque.norm_squared().recip();
            product += weight * own.dot(&rest);
            square += weight * own.norm_squared();
            left += weight * rest.norm_squared();
        }
        let factor = product / square;
        let left = left - product * factor;
        let [lightest, heaviest] = usual_ratios;
        let is_wrong = factor.is_finite() && factor > 0.0 && !(lightest..=heaviest).contains(&factor);
        let share = (left.max(0.0) / torque.len() as f64).sqrt();
        (is_wrong && left < left_by_scales).then_some(WrongMass { body, factor, left: share })
    };
    (0..inertials.len()).filter_map(of_body).min_by(|a, b| a.left.total_cmp(&b.left))
}
