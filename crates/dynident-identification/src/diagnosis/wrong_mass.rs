//! One body whose mass the description has wrong: one number, in place of another unit of every joint's torque.

use super::beside_friction::BesideFriction;
use super::motion_rows::MotionRows;
use super::nominal::nominal_torque;
use dynident_dynamics::ParametricModel;
use dynident_model::InertialParameters;

/// Factors within which descriptions err.
const USUAL: [f64; 2] = [0.5, 2.0];

/// A body whose inertials, times a factor, explain what else asks for another unit of every torque.
#[derive(Clone, Debug, PartialEq)]
pub struct WrongMass {
    /// The body's number.
    pub body: usize,
    /// What its mass and inertia have to be multiplied by.
    pub factor: f64,
    /// Share of the joints' torques, friction aside, that the description so corrected leaves (root mean squares).
    pub left: f64,
}

/// The body whose factor leaves less of the torques than a factor of every joint's own leaves, `left_by_scales` (the
/// sum over joints of squares, each joint in units of what friction leaves of its torque); none where no body does.
///
/// With friction, drive inertia and an offset taken off joint by joint, `τ - τ_others = s τ_body` has one unknown for
/// all joints.
pub(super) fn wrong_mass(
    robot: &ParametricModel,
    rows: &MotionRows,
    beside: &BesideFriction,
    left_by_scales: f64,
) -> Option<WrongMass> {
    let all = nominal_torque(robot, rows)?;
    let torque = beside.of_all(&rows.tau);
    let inertials = robot.model().inertials();
    let of_body = |body: usize| {
        let own: Vec<InertialParameters> = (0..inertials.len())
            .map(|other| if other == body { inertials[other] } else { InertialParameters([0.0; 10]) })
            .collect();
        let alone = ParametricModel::new(robot.model().with_inertials(&own).ok()?, Vec::new()).ok()?;
        let alone = nominal_torque(&alone, rows)?;
        let (mut product, mut square, mut left) = (0.0, 0.0, 0.0);
        for (joint, torque) in torque.iter().enumerate().filter(|(_, torque)| torque.norm_squared() > 0.0) {
            let own = beside.of(joint, &alone[joint]);
            let rest = torque - (beside.of(joint, &all[joint]) - &own);
            let weight = torque.norm_squared().recip();
            product += weight * own.dot(&rest);
            square += weight * own.norm_squared();
            left += weight * rest.norm_squared();
        }
        let factor = product / square;
        let left = left - product * factor;
        let is_wrong = factor.is_finite() && factor > 0.0 && !(USUAL[0]..=USUAL[1]).contains(&factor);
        let share = (left.max(0.0) / torque.len() as f64).sqrt();
        (is_wrong && left < left_by_scales).then_some(WrongMass { body, factor, left: share })
    };
    (0..inertials.len()).filter_map(of_body).min_by(|a, b| a.left.total_cmp(&b.left))
}
