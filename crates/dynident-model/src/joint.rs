//! A joint between a body and its parent.

use crate::spatial::{Mat3, Transform, Vec3};
use crate::structure::{PARALLEL_TOLERANCE_RAD, Shift};

/// The kinds of joint with a degree of freedom.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// Rotates about its axis, between limits; position in radians.
    Revolute,
    /// Rotates about its axis without limits; position in radians.
    Continuous,
    /// Slides along its axis; position in metres.
    Prismatic,
}

impl JointKind {
    /// The name that URDF uses.
    pub fn name(self) -> &'static str {
        match self {
            Self::Revolute => "revolute",
            Self::Continuous => "continuous",
            Self::Prismatic => "prismatic",
        }
    }
}

/// Limits of a joint, if the robot description contains them: rad or m, rad/s or m/s, Nm or N.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointLimits {
    /// Lowest position, rad or m.
    pub lower: Option<f64>,
    /// Highest position, rad or m.
    pub upper: Option<f64>,
    /// Highest velocity, rad/s or m/s.
    pub velocity: Option<f64>,
    /// Highest torque or force, Nm or N.
    pub effort: Option<f64>,
}

/// A spring at a joint. The drive has to provide the torque `τ = stiffness (q - reference)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointSpring {
    /// Stiffness, Nm/rad (N/m).
    pub stiffness: f64,
    /// Position of zero torque, rad or m.
    pub reference: f64,
}

/// Law of a joint that follows others: `q = Σ multiplier · q_source + offset`. URDF's `mimic` has one source; the
/// passive joints of a parallelogram can have two.
#[derive(Clone, Debug, PartialEq)]
pub struct Mimic {
    /// Source joints.
    pub sources: Vec<MimicSource>,
    /// Position while all sources are at zero, rad or m.
    pub offset: f64,
}

/// One source of a mimic joint.
#[derive(Clone, Debug, PartialEq)]
pub struct MimicSource {
    /// Name of the source joint.
    pub joint: String,
    /// Velocity of the follower divided by velocity of the source.
    pub multiplier: f64,
}

impl Mimic {
    /// A mimic joint with one source: `q = multiplier · q_source + offset`.
    pub fn of(source: &str, multiplier: f64, offset: f64) -> Self {
        Self { sources: vec![MimicSource { joint: source.to_owned(), multiplier }], offset }
    }

    /// Names of the sources for messages: `a and b`.
    pub fn source_names(&self) -> String {
        self.sources.iter().map(|source| source.joint.as_str()).collect::<Vec<_>>().join(" and ")
    }
}

/// A joint of the tree. The frame of its child body is the joint frame. At position zero the pose of the joint frame
/// in the parent body's frame is `placement`; the frame moves by `q` about (along) `axis`.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Unique name.
    pub name: String,
    /// Kind of motion.
    pub kind: JointKind,
    /// Index of the parent body, or `None` for the fixed base. Always below this joint's own index.
    pub parent: Option<usize>,
    /// `parent_from_child` at position zero.
    pub placement: Transform,
    /// Unit vector of the axis in the joint (child body) frame.
    pub axis: Vec3,
    /// Limits, where known.
    pub limits: JointLimits,
    /// Viscous friction in the robot description, Nm s/rad (N s/m).
    pub damping: Option<f64>,
    /// Coulomb friction in the robot description, Nm (N).
    pub friction: Option<f64>,
    /// Inertia of rotor and gear, reflected to the joint, in the robot description, kg m² (kg).
    pub drive_inertia: Option<f64>,
    /// Spring in the robot description. The rigid-body dynamics do not include it; it is a torque term,
    /// [`Declared::springs`](crate::terms::Declared::springs).
    pub spring: Option<JointSpring>,
    /// Law of the joint if it follows other joints (mimic joint); see [`JointCoupling`](crate::JointCoupling). A
    /// joint whose source is not in the model is independent.
    pub mimic: Option<Mimic>,
}

/// The numbers of one joint in the form that algorithms use. A revolute joint has the rotation `R(q) = constant +
/// cosine · cos q + sine · sin q` in `parent_from_child`, and a constant translation. A prismatic joint has `R =
/// constant` and the translation `translation + slide · q`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointMap {
    /// Index of the parent body, or `None` for the base.
    pub parent: Option<usize>,
    /// True for revolute and continuous joints.
    pub is_rotary: bool,
    /// Unit axis in the child frame.
    pub axis: Vec3,
    /// Part of the rotation that does not depend on `q`.
    pub constant: Mat3,
    /// Part of the rotation proportional to `cos q` (zero for a prismatic joint).
    pub cosine: Mat3,
    /// Part of the rotation proportional to `sin q` (zero for a prismatic joint).
    pub sine: Mat3,
    /// Translation at `q = 0`, in metres.
    pub translation: Vec3,
    /// Axis in the parent frame for a prismatic joint, zero for a revolute one.
    pub slide: Vec3,
    /// Axes of parent and child (0, 1, 2 for x, y, z) to which the axis of a revolute joint is parallel, if there is
    /// one in both frames. The rotation then has five nonzero entries. The tolerance is 1e-15 rad, below the rounding
    /// error of any result.
    pub along: Option<(usize, usize)>,
    /// Which coordinates of the origin are nonzero.
    pub shift: Shift,
}

/// Axes of parent and child to which `axis` is parallel, for a joint with the rotation `placement`.
fn axes_along(placement: &Mat3, axis: Vec3) -> Option<(usize, usize)> {
    let only = |v: Vec3| (0..3).find(|&k| (0..3).all(|i| i == k || v[i].abs() <= PARALLEL_TOLERANCE_RAD));
    let child = only(axis)?;
    let row = |k: usize| placement.0[k][child];
    Some((only(Vec3([row(0), row(1), row(2)]))?, child))
}

impl Joint {
    /// Precomputes the joint's numbers for the algorithms.
    pub fn map(&self) -> JointMap {
        let placement = &self.placement.rotation;
        let (parent, axis, translation) = (self.parent, self.axis, self.placement.translation);
        if self.is_rotary() {
            // Rodrigues: R(q) = P (a aᵀ + cos q (1 - a aᵀ) + sin q [a]×).
            let constant = placement.mul_mat(&Mat3::outer(axis, axis));
            JointMap {
                parent,
                is_rotary: true,
                axis,
                constant,
                cosine: *placement - constant,
                sine: placement.mul_mat(&Mat3::skew(axis)),
                translation,
                slide: Vec3::ZERO,
                along: axes_along(placement, axis),
                shift: Shift::of(translation),
            }
        } else {
            JointMap {
                parent,
                is_rotary: false,
                axis,
                constant: *placement,
                cosine: Mat3::ZERO,
                sine: Mat3::ZERO,
                translation,
                slide: placement.mul_vec(axis),
                along: None,
                shift: Shift::Any,
            }
        }
    }

    /// `parent_from_child` at position `q` (rad or m).
    pub fn transform(&self, q: f64) -> Transform {
        match self.kind {
            JointKind::Revolute | JointKind::Continuous => Transform {
                rotation: self.placement.rotation.mul_mat(&Mat3::from_axis_angle(self.axis, q)),
                translation: self.placement.translation,
            },
            JointKind::Prismatic => {
                Transform { rotation: self.placement.rotation, translation: self.placement.point(self.axis.scale(q)) }
            }
        }
    }

    /// True for revolute and continuous joints.
    pub fn is_rotary(&self) -> bool {
        self.kind != JointKind::Prismatic
    }
}
