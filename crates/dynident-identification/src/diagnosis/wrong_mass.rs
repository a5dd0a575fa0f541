//! One wrong mass in the description, as an alternative to another unit of every torque.

use super::friction_spans::FrictionSpans;
use super::motion_rows::MotionRows;
use super::nominal::nominal_torque;
use dynident_dynamics::ParametricModel;
use dynident_model::InertialParameters;

/// A body with a wrong mass that explains the torques better than another unit of each torque.
#[derive(Clone, Debug, PartialEq)]
pub struct WrongMass {
    /// The body's number.
    pub body: usize,
    /// Factor on its mass and inertia.
    pub factor: f64,
    /// Unexplained share of the torques without friction after the correction (root mean squares).
    pub left: f64,
}

/// The body whose factor has a smaller residual than a separate factor for every joint, `left_by_scales` (the sum over
/// joints of squared residuals relative to the torque without friction), and is outside of `usual_ratios`.
///
/// Without friction, drive inertia and offset, `τ - τ_others = s τ_body` has one unknown for all joints.
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
