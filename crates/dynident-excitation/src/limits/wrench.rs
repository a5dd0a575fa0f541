//! Derivatives with respect to positions in space, converted to derivatives with respect to joint positions.

use dynident_model::{Model, Transform, Vec3};

/// Force and moment about the base origin in the base frame. The derivative of a cost with respect to the position of
/// a body's point acts like a force at that point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Wrench {
    force: Vec3,
    moment: Vec3,
}

impl Wrench {
    pub(crate) const ZERO: Self = Self { force: Vec3::ZERO, moment: Vec3::ZERO };

    pub(crate) fn add(&mut self, place: Vec3, force: Vec3) {
        self.force += force;
        self.moment += place.cross(force);
    }
}

/// Adds `Jᵀ f` of one sample to `by_position[joint]`. With the total wrench on the bodies that a joint carries, a
/// revolute joint about axis `a` through `o` receives `a · (n - o × f)`, a prismatic joint `a · f`. Followers pass
/// their share to the joints that they follow. One inward sweep, which overwrites the wrenches.
pub(crate) fn apply_wrenches(
    model: &Model,
    placements: &[Transform],
    wrenches: &mut [Wrench],
    by_position: &mut [f64],
) {
    for (body, map) in model.maps().iter().enumerate().rev() {
        let Wrench { force, moment } = wrenches[body];
        wrenches[body] = Wrench::ZERO;
        if force == Vec3::ZERO && moment == Vec3::ZERO {
            continue;
        }
        let Transform { rotation, translation } = &placements[body];
        let axis = rotation.mul_vec(map.axis);
        let along = if map.is_rotary { moment - translation.cross(force) } else { force };
        for (joint, share) in model.drivers(body) {
            by_position[joint] += share * axis.dot(along);
        }
        if let Some(parent) = map.parent {
            wrenches[parent].force += force;
            wrenches[parent].moment += moment;
        }
    }
}
