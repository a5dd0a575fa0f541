//! Rank of the bodies' regressor from motions that differ in one joint: the cross-check for long robots.
//!
//! If two states differ in joint `j` only (position, velocity and acceleration), the **difference** of the torques of
//! the inner joints depends only on body `j` and the bodies after it. The same is true for the torques of joint `j`.
//! The rows of all joints, base to tip, form an upper block triangle, whose rank is at least the sum of the ranks of
//! its diagonal blocks. A block has ten columns, so the cost grows with the square of the length of a chain (with the
//! fourth power for [`numerical_rank`](super::numerical_rank)).

use super::{NumericalRank, numerical_rank};
use crate::body_frames::{inertial_wrench, moved};
use crate::independent_columns::independent_regressor_columns;
use crate::states::BodyState;
use crate::workspace::joint_transform;
use dynident_model::sample::Random;
use dynident_model::{InertialParameters, JointMap, Model, Transform, Vec3};
use nalgebra::DMatrix;

/// Number of state pairs per joint: enough at the base, where a pair gives two rows, and more than the two that are
/// needed elsewhere.
fn pairs(joints_on_path: usize) -> usize {
    5 + 20 / joints_on_path
}

/// Lower bound of the rank of the bodies' columns, body by body: the columns of each body that the torques separate
/// from those of earlier bodies. The states are like those of [`numerical_rank`](super::numerical_rank), but two
/// states differ in one joint only. Every structurally independent column must be among these columns. Deterministic
/// in `seed`. For coupled joints, which do not move alone, this is [`numerical_rank`](super::numerical_rank).
pub fn numerical_rank_by_body(model: &Model, seed: u64, tolerance: f64) -> NumericalRank {
    if model.coupling().is_some() {
        // The seed gives other states than those used for the base parameters of robots with coupled joints.
        return numerical_rank(model, &[], seed + 1, tolerance);
    }
    let maps = model.maps();
    let mut random = Random::new(seed);
    let states: Vec<Vec<BodyState<f64>>> = (0..pairs(1))
        .map(|_| {
            let mut bodies: Vec<BodyState<f64>> = Vec::with_capacity(maps.len());
            for map in maps {
                let body = random_motion(model, map, map.parent.map(|parent| &bodies[parent]), &mut random);
                bodies.push(body);
            }
            bodies
        })
        .collect();
    let mut all = NumericalRank { independent: Vec::new(), weakest_independent: 1.0, strongest_dependent: 0.0 };
    for (j, map) in maps.iter().enumerate() {
        let mut rows: Vec<[f64; 10]> = Vec::new();
        for bodies in &states[..pairs(model.path(j).len())] {
            let first = &bodies[j];
            let second = random_motion(model, map, map.parent.map(|parent| &bodies[parent]), &mut random);
            let [one, other] = [first, &second].map(unit_wrenches);
            rows.extend([one.map(|wrench| wrench.on(map)), other.map(|wrench| wrench.on(map))]);
            let mut inward = map.parent;
            let mut difference: [Wrench; 10] = core::array::from_fn(|k| {
                let (a, b) = (one[k].to_parent(&first.parent_from_body), other[k].to_parent(&second.parent_from_body));
                Wrench { force: a.force - b.force, moment: a.moment - b.moment }
            });
            while let Some(joint) = inward {
                rows.push(difference.map(|wrench| wrench.on(&maps[joint])));
                difference = difference.map(|wrench| wrench.to_parent(&bodies[joint].parent_from_body));
                inward = maps[joint].parent;
            }
        }
        let split = independent_regressor_columns(&DMatrix::from_fn(rows.len(), 10, |row, k| rows[row][k]), tolerance);
        all.independent.extend(split.independent.iter().map(|k| 10 * j + k));
        all.weakest_independent = all.weakest_independent.min(split.weakest_independent);
        all.strongest_dependent = all.strongest_dependent.max(split.strongest_dependent);
    }
    all
}

/// A body's motion for random position, velocity and acceleration of its joint.
fn random_motion(
    model: &Model,
    map: &JointMap,
    parent: Option<&BodyState<f64>>,
    random: &mut Random,
) -> BodyState<f64> {
    let q = random.uniform(-1.0, 1.0) * if map.is_rotary { core::f64::consts::PI } else { 1.0 };
    let (dq, ddq) = (random.uniform(-2.0, 2.0), random.uniform(-5.0, 5.0));
    let mut body = BodyState { parent_from_body: joint_transform(map, q, q.sin(), q.cos()), ..BodyState::REST };
    moved(map, parent, -model.gravity(), dq, ddq, &mut body);
    body
}

/// Force and moment about the frame's origin.
#[derive(Clone, Copy)]
struct Wrench {
    force: Vec3,
    moment: Vec3,
}

impl Wrench {
    /// Torque or force on the joint of its frame.
    fn on(&self, map: &JointMap) -> f64 {
        map.axis.dot(if map.is_rotary { self.moment } else { self.force })
    }

    fn to_parent(self, parent_from_body: &Transform) -> Self {
        let Transform { rotation, translation } = parent_from_body;
        let force = rotation.mul_vec(self.force);
        Self { force, moment: rotation.mul_vec(self.moment) + translation.cross(force) }
    }
}

/// Wrench per unit of each inertial parameter.
fn unit_wrenches(body: &BodyState<f64>) -> [Wrench; 10] {
    core::array::from_fn(|k| {
        let unit = InertialParameters(core::array::from_fn(|i| f64::from(i == k)));
        let (force, moment) = inertial_wrench(&unit, body.omega, body.alpha, body.acceleration);
        Wrench { force, moment }
    })
}
