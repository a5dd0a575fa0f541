//! The link tree: an immutable model of the robot.

use crate::collision::CollisionShape;
use crate::error::ModelError;
use crate::inertial::InertialParameters;
use crate::joint::{Joint, JointMap};
use crate::spatial::{Mat3, Transform, Vec3};

/// Standard gravity of the tools of this field (Pinocchio, MuJoCo, URDF simulators), m/s², along -z of the base.
pub const STANDARD_GRAVITY: Vec3 = Vec3([0.0, 0.0, -9.81]);

/// A link of the description that moves with a body: the body's own link, or one fixed to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Name in the description.
    pub name: String,
    /// `body_from_link`.
    pub placement: Transform,
    /// Inertial parameters in the **link's** frame; `None` when the description gives none (unknown, not zero).
    pub inertial: Option<InertialParameters>,
    /// Shapes for collision checking in the **link's** frame; empty where the description gives none.
    pub collision: Vec<CollisionShape>,
}

/// A body: everything that moves with one joint, lumped.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// The links that move with the joint; the first is the joint's own child link, at the identity.
    pub links: Vec<Link>,
}

impl Body {
    /// Name of the joint's own child link.
    pub fn name(&self) -> &str {
        &self.links[0].name
    }

    /// Prior inertial parameters in the body frame: the sum over its links that have any. `None` when none has:
    /// unknown.
    pub fn prior(&self) -> Option<InertialParameters> {
        self.links
            .iter()
            .filter_map(|link| link.inertial.map(|inertial| inertial.expressed_in(&link.placement)))
            .reduce(|sum, next| sum.plus(&next))
    }
}

/// A robot on a fixed base: joints and bodies in an order where parents come before children. Body `i` moves with joint
/// `i`; positions, velocities and torques are vectors in this order.
#[doc(alias("robot", "kinematic tree", "multibody"))]
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    name: String,
    gravity: Vec3,
    joints: Vec<Joint>,
    bodies: Vec<Body>,
    base: Body,
    maps: Vec<JointMap>,
    inertials: Vec<InertialParameters>,
}

impl Model {
    /// A model from its parts. `base` holds the links that do not move.
    ///
    /// # Errors
    /// If counts differ, a name stands twice, a parent does not come before its child, an axis is not a unit vector, or
    /// a number is not finite.
    pub fn new(name: &str, base: Body, joints: Vec<Joint>, bodies: Vec<Body>) -> Result<Self, ModelError> {
        if joints.len() != bodies.len() {
            return Err(ModelError::Counts { joints: joints.len(), bodies: bodies.len() });
        }
        for (index, joint) in joints.iter().enumerate() {
            if joints[..index].iter().any(|other| other.name == joint.name) {
                return Err(ModelError::DuplicateJoint { joint: joint.name.clone() });
            }
            if joint.parent.is_some_and(|parent| parent >= index) {
                return Err(ModelError::ParentAfterChild { joint: joint.name.clone() });
            }
            // 1e-9 is what normalising a vector in double precision leaves, with room.
            if (joint.axis.norm() - 1.0).abs().is_nan() || (joint.axis.norm() - 1.0).abs() > 1e-9 {
                return Err(ModelError::AxisNotUnit { joint: joint.name.clone() });
            }
            let placement = &joint.placement;
            let finite = placement.rotation.0.iter().flatten().chain(&placement.translation.0).all(|x| x.is_finite());
            if !finite {
                return Err(ModelError::NotFinite { what: format!("placement of joint `{}`", joint.name) });
            }
        }
        for body in &bodies {
            if body.links.is_empty() {
                return Err(ModelError::BodyWithoutLink);
            }
            for link in &body.links {
                if link.inertial.is_some_and(|inertial| inertial.0.iter().any(|x| !x.is_finite())) {
                    return Err(ModelError::NotFinite { what: format!("inertial of link `{}`", link.name) });
                }
            }
        }
        let inertials = bodies.iter().map(|body| body.prior().unwrap_or(InertialParameters::ZERO)).collect();
        let maps = joints.iter().map(Joint::map).collect();
        Ok(Self { name: name.to_owned(), gravity: STANDARD_GRAVITY, joints, bodies, base, maps, inertials })
    }

    /// The robot's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Degrees of freedom: the length of every joint vector.
    pub fn dof(&self) -> usize {
        self.joints.len()
    }

    /// The joints, parents first.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// The joints' numbers, prepared for the algorithms; same order as [`joints`](Model::joints).
    pub fn maps(&self) -> &[JointMap] {
        &self.maps
    }

    /// The moving bodies; body `i` moves with joint `i`.
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// What does not move.
    pub fn base(&self) -> &Body {
        &self.base
    }

    /// Gravitational acceleration in the base frame, m/s².
    pub fn gravity(&self) -> Vec3 {
        self.gravity
    }

    /// Inertial parameters of the bodies in their frames, zero where [`Body::prior`] is unknown: what the dynamics
    /// compute with.
    pub fn inertials(&self) -> &[InertialParameters] {
        &self.inertials
    }

    /// All inertial parameters, body after body: the vector `π` that the torque regressor multiplies.
    pub fn parameter_vector(&self) -> Vec<f64> {
        self.inertials.iter().flat_map(|inertial| inertial.0).collect()
    }

    /// Names of the moving bodies whose inertial parameters are unknown.
    pub fn bodies_without_prior(&self) -> Vec<&str> {
        self.bodies.iter().filter(|body| body.prior().is_none()).map(Body::name).collect()
    }

    /// Index of the joint called `name`.
    pub fn joint_index(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|joint| joint.name == name)
    }

    /// True when body `body` moves with joint `joint`.
    pub fn moves(&self, joint: usize, body: usize) -> bool {
        let mut at = Some(body);
        while let Some(index) = at {
            if index == joint {
                return true;
            }
            at = self.joints[index].parent;
        }
        false
    }

    /// The joints from the base to body `body`, inclusive.
    pub fn path(&self, body: usize) -> Vec<usize> {
        let mut path = vec![body];
        while let Some(parent) = self.joints[path[path.len() - 1]].parent {
            path.push(parent);
        }
        path.reverse();
        path
    }

    /// The same robot under another gravity (base frame, m/s²).
    ///
    /// # Errors
    /// If a component is not finite.
    pub fn with_gravity(mut self, gravity: Vec3) -> Result<Self, ModelError> {
        if gravity.0.iter().any(|g| !g.is_finite()) {
            return Err(ModelError::NotFinite { what: "gravity".to_owned() });
        }
        self.gravity = gravity;
        Ok(self)
    }

    /// The same robot mounted with its base turned by roll, pitch, yaw (radians, fixed axes) against the world: gravity
    /// turns the other way in the base frame.
    ///
    /// # Errors
    /// If an angle is not finite.
    pub fn with_base_orientation(self, roll: f64, pitch: f64, yaw: f64) -> Result<Self, ModelError> {
        let gravity = Mat3::from_roll_pitch_yaw(roll, pitch, yaw).transpose_mul_vec(self.gravity);
        self.with_gravity(gravity)
    }

    /// The same robot with other inertial parameters: body `i` becomes one link with `inertials[i]` in the body frame.
    ///
    /// # Errors
    /// If the count differs or a number is not finite.
    pub fn with_inertials(&self, inertials: &[InertialParameters]) -> Result<Self, ModelError> {
        if inertials.len() != self.dof() {
            return Err(ModelError::Counts { joints: self.dof(), bodies: inertials.len() });
        }
        if inertials.iter().flat_map(|inertial| inertial.0).any(|x| !x.is_finite()) {
            return Err(ModelError::NotFinite { what: "inertial parameters".to_owned() });
        }
        let mut model = self.clone();
        for (body, inertial) in model.bodies.iter_mut().zip(inertials) {
            for link in &mut body.links {
                link.inertial = None;
            }
            body.links[0].inertial = Some(*inertial);
        }
        model.inertials = inertials.to_vec();
        Ok(model)
    }

    /// The same robot with the named joints held at the given positions (rad or m): each one's body joins its parent's.
    ///
    /// # Errors
    /// If a name is unknown or given twice, or a position is not finite.
    pub fn locked(&self, positions: &[(String, f64)]) -> Result<Self, ModelError> {
        let mut position_of = vec![None; self.dof()];
        for (name, position) in positions {
            let index = self.joint_index(name).ok_or_else(|| ModelError::UnknownJoint {
                joint: name.clone(),
                known: self.joints.iter().map(|joint| joint.name.clone()).collect(),
            })?;
            if !position.is_finite() {
                return Err(ModelError::NotFinite { what: format!("locked position of joint `{name}`") });
            }
            if position_of[index].replace(*position).is_some() {
                return Err(ModelError::DuplicateJoint { joint: name.clone() });
            }
        }
        // Where each old body went: new body index (None: base) and new_from_old.
        let mut went: Vec<(Option<usize>, Transform)> = Vec::with_capacity(self.dof());
        let (mut joints, mut bodies, mut base) = (Vec::new(), Vec::<Body>::new(), self.base.clone());
        for (index, joint) in self.joints.iter().enumerate() {
            let (parent, parent_from_old) = joint.parent.map_or((None, Transform::IDENTITY), |p| went[p]);
            if let Some(position) = position_of[index] {
                let placement = parent_from_old.then(&joint.transform(position));
                let host = parent.map_or(&mut base, |p| &mut bodies[p]);
                host.links.extend(
                    self.bodies[index]
                        .links
                        .iter()
                        .map(|link| Link { placement: placement.then(&link.placement), ..link.clone() }),
                );
                went.push((parent, placement));
            } else {
                joints.push(Joint { parent, placement: parent_from_old.then(&joint.placement), ..joint.clone() });
                bodies.push(self.bodies[index].clone());
                went.push((Some(joints.len() - 1), Transform::IDENTITY));
            }
        }
        Self::new(&self.name, base, joints, bodies)?.with_gravity(self.gravity)
    }
}
