//! The robot's tree in a form that needs the fewest operations in the dynamics, prepared once per model.
//!
//! Joint torques do not depend on the orientation of a body's frame about its joint axis, nor on the position of a
//! revolute body's mass along its axis. Both facts are used here:
//!
//! - **Frames.** Every body has an inner frame with the same origin and with z along the joint axis. Its x axis is
//!   chosen so that a child's axis at a right angle results from a quarter turn about x (modified Denavit-Hartenberg
//!   convention: Khalil and Kleinfinger, *A new geometric notation for open and closed-loop robots*, ICRA 1986). On
//!   most arms every constant rotation is then the identity or that quarter turn, and rotating a vector between frames
//!   takes four products.
//! - **Inertia.** Mass, first moment along the axis and second moment along the axis of a revolute body act like a part
//!   of its parent. They are moved to the parent, so that three of ten numbers are zero (regrouping of base parameters:
//!   Gautier and Khalil, *Direct calculation of minimum set of inertial parameters of serial robots*, IEEE T-RA 1990).

use crate::inertial::InertialParameters;
use crate::joint::Joint;
use crate::spatial::{Mat3, Vec3};
use crate::structure::{PARALLEL_TOLERANCE_RAD, Shift};

/// Constant part of the rotation from a body's inner frame to its parent's inner frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StepRotation {
    /// Identity: parallel axes.
    Aligned,
    /// 90° about x: `(x, y, z)` becomes `(x, -z, y)`.
    Quarter,
    /// Any other rotation.
    General(Mat3),
}

/// One joint and its body in inner frames. The joint torques equal those of the original [`Joint`] and body, but the
/// inertial parameters of single bodies differ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointStep {
    /// Index of the parent body, or `None` for the base.
    pub parent: Option<usize>,
    /// True for revolute joints, false for prismatic joints.
    pub is_rotary: bool,
    /// Offset added to the position of a revolute joint, rad: angle between the x axes of the inner frame and the body
    /// frame.
    pub offset: f64,
    /// Constant rotation, before the joint's rotation about z. `General` for a prismatic joint.
    pub rotation: StepRotation,
    /// Origin of the inner frame in the parent's inner frame, m; for a prismatic joint at `q = 0`.
    pub translation: Vec3,
    /// Which coordinates of the origin are nonzero.
    pub shift: Shift,
    /// Axis of a prismatic joint in the parent's inner frame; zero for a revolute joint.
    pub slide: Vec3,
    /// Mass, kg; zero for a revolute body, whose mass was moved to its parent.
    pub mass: f64,
    /// First moment `∫ x dm`, kg m.
    pub first: Vec3,
    /// Second moment `∫ x xᵀ dm`, upper triangle by rows: xx, xy, xz, yy, yz, zz. kg m².
    pub second: [f64; 6],
    /// Mass of this body and all its descendants, kg.
    pub subtree_mass: f64,
    /// True if the body has no children.
    pub is_tip: bool,
    /// True if a body other than the next one is a child of this body, so that its state is needed later.
    pub branches: bool,
    /// Relation of the body to its parent.
    pub hang: ParentRelation,
}

/// Relation of a body to its parent; all false at the base.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParentRelation {
    /// True if no sibling has a higher index: in a pass from the tips to the base, this body is the first that
    /// contributes to the parent.
    pub is_last_child: bool,
    /// True if the parent is the previous body, so that its state is still in registers.
    pub follows: bool,
    /// True if the parent rotates about an axis that is fixed in the base, so that only moments about that axis
    /// matter for the parent.
    pub on_resting_axis: bool,
}

pub(crate) fn steps(tree: &[Joint], inertials: &[InertialParameters]) -> Vec<JointStep> {
    // Rotation from the inner frame to the body frame: first with any x axis, later rotated about z.
    let plain: Vec<Mat3> = tree.iter().map(|joint| along_z(joint.axis)).collect();
    let relative = |child: usize, parent_frame: &Mat3| {
        parent_frame.transpose().mul_mat(&tree[child].placement.rotation).mul_mat(&plain[child])
    };
    let turn = |parent: usize| {
        let children = (parent + 1..tree.len()).filter(|&child| tree[child].parent == Some(parent));
        let mut relatives = children.map(|child| relative(child, &plain[parent]).0);
        let right = relatives.find(|w| w[2][2].abs() <= PARALLEL_TOLERANCE_RAD);
        // W = Rz(γ) Rx(α) Rz(δ), third column: (sin γ sin α, -cos γ sin α, cos α).
        right.map_or(0.0, |w| w[0][2].atan2(-w[1][2]))
    };
    let is_rotary: Vec<f64> = (0..tree.len()).map(turn).collect();
    let frames: Vec<Mat3> =
        plain.iter().zip(&is_rotary).map(|(frame, angle)| frame.mul_mat(&about_z(*angle))).collect();

    let mut steps: Vec<JointStep> = Vec::with_capacity(tree.len());
    for (index, joint) in tree.iter().enumerate() {
        let parent_frame = joint.parent.map_or(Mat3::IDENTITY, |parent| frames[parent]);
        let w = relative(index, &parent_frame);
        let (rotation, offset) = if joint.is_rotary() {
            let (rotation, before) = constant_rotation(&w);
            (rotation, before + is_rotary[index])
        } else {
            (StepRotation::General(w.mul_mat(&about_z(is_rotary[index]))), 0.0)
        };
        let slide = if joint.is_rotary() { Vec3::ZERO } else { column(&w, 2) };
        let translation = parent_frame.transpose_mul_vec(joint.placement.translation);
        let frame = &frames[index];
        let [mass, _, _, _, xx, xy, xz, yy, yz, zz] = inertials[index].0;
        let half = 0.5 * (xx + yy + zz);
        let second = Mat3([[half - xx, -xy, -xz], [-xy, half - yy, -yz], [-xz, -yz, half - zz]]);
        let second = frame.transpose().mul_mat(&second).mul_mat(frame).0;
        steps.push(JointStep {
            parent: joint.parent,
            is_rotary: joint.is_rotary(),
            offset,
            rotation,
            translation,
            shift: if joint.is_rotary() { Shift::of(translation) } else { Shift::Any },
            slide,
            mass,
            first: frame.transpose_mul_vec(inertials[index].first_moment()),
            second: [second[0][0], second[0][1], second[0][2], second[1][1], second[1][2], second[2][2]],
            subtree_mass: 0.0,
            is_tip: tree.iter().all(|other| other.parent != Some(index)),
            branches: tree.iter().skip(index + 2).any(|other| other.parent == Some(index)),
            hang: joint.parent.map_or(
                ParentRelation { is_last_child: false, follows: false, on_resting_axis: false },
                |parent| ParentRelation {
                    is_last_child: tree[index + 1..].iter().all(|other| other.parent != Some(parent)),
                    follows: parent + 1 == index,
                    on_resting_axis: tree[parent].parent.is_none() && tree[parent].is_rotary(),
                },
            ),
        });
    }
    regroup(&mut steps);
    steps
}

/// Moves mass moments on the axes of revolute bodies to their parents, from the tips to the base, and sums the masses.
fn regroup(steps: &mut [JointStep]) {
    for index in (0..steps.len()).rev() {
        let (inner, outer) = steps.split_at_mut(index);
        let step = &mut outer[0];
        if step.is_rotary {
            let (mass, along, second) = (step.mass, step.first[2], step.second[5]);
            (step.mass, step.first.0[2], step.second[5]) = (0.0, 0.0, 0.0);
            if let Some(parent) = step.parent {
                let (axis, t) = (step.rotation.axis(), step.translation);
                let parent = &mut inner[parent];
                parent.mass += mass;
                parent.first += axis.scale(along) + t.scale(mass);
                // ∫ (t + z a) (t + z a)ᵀ dm
                for (entry, (i, k)) in parent.second.iter_mut().zip([(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]) {
                    let mixed = axis[i] * t[k] + t[i] * axis[k];
                    *entry += second * axis[i] * axis[k] + along * mixed + mass * t[i] * t[k];
                }
            }
        }
        step.subtree_mass += step.mass;
        if let Some(parent) = step.parent {
            inner[parent].subtree_mass += step.subtree_mass;
        }
    }
}

impl StepRotation {
    fn axis(&self) -> Vec3 {
        match self {
            Self::Aligned => Vec3([0.0, 0.0, 1.0]),
            Self::Quarter => Vec3([0.0, -1.0, 0.0]),
            Self::General(rotation) => column(rotation, 2),
        }
    }
}

/// Decomposes `W` into a constant rotation followed by a rotation about z.
fn constant_rotation(w: &Mat3) -> (StepRotation, f64) {
    let m = &w.0;
    let slant = m[0][2].hypot(m[1][2]);
    if m[2][2] > 0.0 && slant <= PARALLEL_TOLERANCE_RAD {
        (StepRotation::Aligned, m[1][0].atan2(m[0][0]))
    } else if m[2][2].abs() <= PARALLEL_TOLERANCE_RAD && m[0][2].abs() <= PARALLEL_TOLERANCE_RAD && m[1][2] < 0.0 {
        // Rx(90°) Rz(δ) has the third row (sin δ, cos δ, 0).
        (StepRotation::Quarter, m[2][0].atan2(m[2][1]))
    } else {
        (StepRotation::General(*w), 0.0)
    }
}

/// A rotation whose third column is the unit vector `axis`, with as many zeros as possible.
fn along_z(axis: Vec3) -> Mat3 {
    let least = (0..3).fold(0, |least, k| if axis[k].abs() < axis[least].abs() { k } else { least });
    let z = axis.scale(1.0 / axis.norm());
    let mut side = z.scale(-z[least]);
    side[least] += 1.0;
    let x = side.scale(1.0 / side.norm());
    let y = z.cross(x);
    Mat3([[x[0], y[0], z[0]], [x[1], y[1], z[1]], [x[2], y[2], z[2]]])
}

fn about_z(angle: f64) -> Mat3 {
    Mat3::from_axis_angle(Vec3([0.0, 0.0, 1.0]), angle)
}

fn column(m: &Mat3, k: usize) -> Vec3 {
    Vec3([m.0[0][k], m.0[1][k], m.0[2][k]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::{Random, random_tree};
    use crate::{Model, Transform};

    /// `base_from_inner` of every body at `q`, computed from the steps.
    fn inner_placements(model: &Model, q: &[f64]) -> Vec<Transform> {
        let mut placements: Vec<Transform> = Vec::new();
        for (step, q) in model.steps().iter().zip(q) {
            let constant = match step.rotation {
                StepRotation::Aligned => Mat3::IDENTITY,
                StepRotation::Quarter => Mat3([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
                StepRotation::General(rotation) => rotation,
            };
            let own = if step.is_rotary {
                Transform { rotation: constant.mul_mat(&about_z(q + step.offset)), translation: step.translation }
            } else {
                Transform { rotation: constant, translation: step.slide.scale_add(*q, step.translation) }
            };
            placements.push(step.parent.map_or(own, |parent| placements[parent].then(&own)));
        }
        placements
    }

    /// Asserts that the origins and axes of all bodies agree with the joints. Ten successive rotations and lengths of
    /// order one: tolerance 1e-13.
    fn assert_same_axes(model: &Model, random: &mut Random) {
        let q: Vec<f64> = (0..model.body_count()).map(|_| random.uniform(-3.0, 3.0)).collect();
        let mut bodies: Vec<Transform> = Vec::new();
        let inner = inner_placements(model, &q);
        for (index, joint) in model.tree_joints().iter().enumerate() {
            let own = joint.transform(q[index]);
            bodies.push(joint.parent.map_or(own, |parent| bodies[parent].then(&own)));
            let axis = bodies[index].rotation.mul_vec(joint.axis);
            let (off, slant) =
                (inner[index].translation - bodies[index].translation, column(&inner[index].rotation, 2) - axis);
            assert!(off.norm() < 1e-13 && slant.norm() < 1e-13, "{}: {off:?}, {slant:?}", joint.name);
        }
    }

    #[test]
    fn inner_frames_are_on_the_joint_axes() {
        let mut random = Random::new(5);
        for seed in 0..40 {
            assert_same_axes(&random_tree(seed, 1 + seed as usize % 10), &mut random);
        }
    }

    #[test]
    fn right_angles_are_quarter_turns() {
        let mut random = Random::new(6);
        let plain = random_tree(1, 6);
        // Axes along x, y or z, and placements rotated by multiples of 90°.
        let unit = |k: usize, sign: f64| Vec3(core::array::from_fn(|i| if i == k { sign } else { 0.0 }));
        for case in 0..60 {
            let mut joints = plain.tree_joints().to_vec();
            for (index, joint) in joints.iter_mut().enumerate() {
                joint.kind = crate::JointKind::Continuous;
                joint.parent = index.checked_sub(1);
                let turn = core::f64::consts::FRAC_PI_2 * f64::from(random.bits() as u8 % 4);
                joint.placement.rotation = Mat3::from_axis_angle(unit(random.bits() as usize % 3, 1.0), turn);
                joint.axis = unit(random.bits() as usize % 3, if random.bits().is_multiple_of(2) { 1.0 } else { -1.0 });
            }
            let model = Model::new("right angles", plain.base().clone(), joints, plain.bodies().to_vec()).unwrap();
            assert_same_axes(&model, &mut random);
            for (index, step) in model.steps().iter().enumerate().skip(1) {
                // Antiparallel axes are the only case that remains general.
                let opposite = |rotation: &Mat3| (rotation.0[2][2] + 1.0).abs() < 1e-12;
                let is_general = matches!(&step.rotation, StepRotation::General(rotation) if !opposite(rotation));
                assert!(!is_general, "case {case}, joint {index}: {:?}", step.rotation);
            }
        }
    }

    #[test]
    fn moments_on_an_axis_move_to_the_parent() {
        for seed in 0..20 {
            let model = random_tree(seed, 8);
            for step in model.steps().iter().filter(|step| step.is_rotary) {
                assert_eq!((step.mass, step.first[2], step.second[5]), (0.0, 0.0, 0.0));
            }
            // The remaining prismatic bodies carry all masses.
            let masses = model.steps().iter().filter(|step| !step.is_rotary).map(|step| step.mass).sum::<f64>();
            let whole: f64 =
                model.steps().iter().filter(|step| step.parent.is_none()).map(|step| step.subtree_mass).sum();
            assert!((masses - whole).abs() <= 1e-12 * whole.max(1.0), "{masses} against {whole}");
        }
    }
}
