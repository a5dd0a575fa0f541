//! Columns of further friction laws of one joint, from which an identification selects automatically.

use super::constants::step_of_joint;
use dynident_dynamics::ParametricModel;
use dynident_model::terms::CoulombShape;

/// Stribeck velocities, rad/s for an arm of usual size
/// ([`CharacteristicScale::velocity`](dynident_model::CharacteristicScale::velocity)).
const STRIBECK_RAD_S: [f64; 3] = [0.03, 0.1, 0.3];

/// Number of columns.
pub(crate) const FURTHER_LAWS: usize = 4 + STRIBECK_RAD_S.len();

/// Further friction laws of one joint, with its smoothed sign s: load dependence `|τ| s(q̇)`, asymmetry `|s(q̇)|` and
/// `|q̇|`, square root `s(q̇) √|q̇|`, Stribeck `s(q̇) e^(−(q̇/v)²)`.
pub(crate) struct FurtherLaws {
    step: CoulombShape,
    stribeck: [f64; STRIBECK_RAD_S.len()],
}

impl FurtherLaws {
    pub(crate) fn of(robot: &ParametricModel, joint: usize) -> Self {
        let is_rotary = robot.model().joints()[joint].is_rotary();
        let own_velocity = |usual: f64| robot.model().characteristic_scale().velocity(is_rotary, usual);
        Self { step: step_of_joint(robot, joint), stribeck: STRIBECK_RAD_S.map(own_velocity) }
    }

    /// Values of the columns at the velocity `dq`, rad/s (m/s), with the load `load` on the joint, Nm (N).
    pub(crate) fn row(&self, dq: f64, load: f64) -> [f64; FURTHER_LAWS] {
        let step = self.step.step(dq);
        let [a, b, c] = self.stribeck.map(|speed| step * (-(dq / speed).powi(2)).exp());
        [load.abs() * step, step.abs(), dq.abs(), step * dq.abs().sqrt(), a, b, c]
    }
}
