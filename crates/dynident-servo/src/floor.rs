//! A floor that points of the robot can touch.

use dynident_dynamics::{Workspace, body_placements};
use dynident_model::{Model, Transform, Vec3};

/// A horizontal floor below the robot, without friction.
#[derive(Clone, Debug, PartialEq)]
pub struct Floor {
    /// Height of the floor in the base frame, measured opposite to gravity, m: the height of a touching point according
    /// to the measured positions without the joints' zeros.
    pub height_m: f64,
    /// Contact force per depth, N/m.
    pub stiffness: f64,
    /// Points of the robot that can touch the floor.
    pub points: Vec<FloorPoint>,
}

impl Floor {
    /// Whether no point is below the floor at these positions of each joint, rad (m).
    pub fn is_clear(&self, model: &Model, positions: &[Vec<f64>]) -> bool {
        let mut workspace = Workspace::new(model);
        let mut height = PointHeight::new(model.dof());
        (0..positions.first().map_or(0, Vec::len)).all(|sample| {
            let q: Vec<f64> = positions.iter().map(|joint| joint[sample]).collect();
            self.points.iter().all(|point| {
                height.compute(model, &mut workspace, &q, point);
                height.height >= self.height_m
            })
        })
    }
}

/// A point of a body.
#[derive(Clone, Debug, PartialEq)]
pub struct FloorPoint {
    /// The body.
    pub body: usize,
    /// Position in the body's frame, m.
    pub at_m: Vec3,
}

/// Height of a point, with its first and second derivatives by the joint positions.
#[derive(Debug)]
pub(crate) struct PointHeight {
    pub(crate) height: f64,
    pub(crate) first: Vec<f64>,
    /// Second derivatives by the joint positions, dof × dof.
    pub(crate) second: Vec<f64>,
}

impl PointHeight {
    pub(crate) fn new(dof: usize) -> Self {
        Self { height: 0.0, first: vec![0.0; dof], second: vec![0.0; dof * dof] }
    }

    /// Computes the height at positions `q` and its first derivatives. With joint axes `a`, joint origins `o` and the
    /// point `p`: `∂p/∂q_i = a_i × (p - o_i)`. If joint `i` is a slide, `∂p/∂q_i = a_i`.
    pub(crate) fn compute(&mut self, model: &Model, workspace: &mut Workspace, q: &[f64], point: &FloorPoint) {
        let placements = body_placements(model, workspace, q);
        let up = up(model);
        let position = placements[point.body].point(point.at_m);
        self.height = up.dot(position);
        self.first.fill(0.0);
        for joint in model.path(point.body) {
            let by_joint = by_joint(model, placements, joint, position);
            for (column, factor) in model.drivers(joint) {
                self.first[column] += factor * up.dot(by_joint);
            }
        }
    }

    /// Computes the second derivatives: for a joint `i` before `j`, `∂²p/∂q_i∂q_j = a_i × (a_j × (p - o_j))`. If joint
    /// `j` is a slide, they are `a_i × a_j`; if joint `i` is a slide, they are zero.
    pub(crate) fn compute_second(&mut self, model: &Model, workspace: &mut Workspace, q: &[f64], point: &FloorPoint) {
        let dof = q.len();
        let placements = body_placements(model, workspace, q);
        let up = up(model);
        let position = placements[point.body].point(point.at_m);
        self.second.fill(0.0);
        let path = model.path(point.body);
        for (at, &joint) in path.iter().enumerate() {
            let by_joint = by_joint(model, placements, joint, position);
            for &before in &path[..=at] {
                let earlier = &model.maps()[before];
                if !earlier.is_rotary {
                    continue;
                }
                let turned = up.dot(placements[before].rotation.mul_vec(earlier.axis).cross(by_joint));
                for (row, f) in model.drivers(before) {
                    for (column, g) in model.drivers(joint) {
                        self.second[row * dof + column] += f * g * turned;
                        if before != joint {
                            self.second[column * dof + row] += f * g * turned;
                        }
                    }
                }
            }
        }
    }
}

/// Unit vector against gravity.
fn up(model: &Model) -> Vec3 {
    let gravity = model.gravity();
    gravity.scale(-1.0 / gravity.norm())
}

/// Derivative of a position by the position of a joint before it.
fn by_joint(model: &Model, placements: &[Transform], joint: usize, position: Vec3) -> Vec3 {
    let map = &model.maps()[joint];
    let axis = placements[joint].rotation.mul_vec(map.axis);
    if map.is_rotary { axis.cross(position - placements[joint].translation) } else { axis }
}
