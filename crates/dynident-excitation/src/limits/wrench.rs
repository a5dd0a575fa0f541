//! Derivatives by places in space, pulled back to joint positions.

use dynident_model::{Model, Transform, Vec3};

/// Force and moment about the base origin, base frame: the derivative of a cost by the places of a body's points is a
/// force at each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Wrench {
    force: Vec3,
    moment: Vec3,
}

impl Wrench {
    pub(crate) const ZERO: Self = Self { force: Vec3::ZERO, moment: Vec3::ZERO };

    /// Adds a force at a place.
    pub(crate) fn add(&mut self, place: Vec3, force: Vec3) {
        self.force += force;
        self.moment += place.cross(force);
    }
}

/// Adds `Jᵀ f` of one sample to `by_position[joint]`: a joint about axis `a` through `o` sees `a · (n - o × f)` of the
/// wrench on everything it carries, a sliding one `a · f`; what a joint that follows others sees is theirs. One inward
/// sweep; the wrenches are used up.
pub(crate) fn pull_wrenches(model: &Model, placements: &[Transform], wrenches: &mut [Wrench], by_position: &mut [f64]) {
    for (body, map) in model.maps().iter().enumerate().rev() {
        let Wrench { force, moment } = wrenches[body];
        wrenches[body] = Wrench::ZERO;
        if force == Vec3::ZERO && moment == Vec3::ZERO {
            continue;
        }
        let Transform { rotation, translation } = &placements[body];
        let axis = rotation.mul_vec(map.axis);
        let along = if map.turns { moment - translation.cross(force) } else { force };
        for (joint, share) in model.drivers(body) {
            by_position[joint] += share * axis.dot(along);
        }
        if let Some(parent) = map.parent {
            wrenches[parent].force += force;
            wrenches[parent].moment += moment;
        }
    }
}
