//! The link tree: an immutable model of the robot.

use crate::collision::CollisionShape;
use crate::coupling::JointCoupling;
use crate::dh_convention::DhConvention;
use crate::error::ModelError;
use crate::inertial::InertialParameters;
use crate::joint::{Joint, JointKind, JointLimits, JointMap, Mimic};
use crate::spatial::{Mat3, Transform, Vec3};
use crate::steps::{JointStep, steps};

/// Standard gravity, m/s², along -z of the base, as in Pinocchio, MuJoCo and URDF simulators.
pub const STANDARD_GRAVITY: Vec3 = Vec3([0.0, 0.0, -9.81]);

/// A link of the description that belongs to a body: the body's own link, or one fixed to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Name in the robot description.
    pub name: String,
    /// `body_from_link`.
    pub placement: Transform,
    /// Inertial parameters in the **link's** frame; `None` if the description has none (unknown, not zero).
    pub inertial: Option<InertialParameters>,
    /// Shapes for collision checking in the **link's** frame; may be empty.
    pub collision: Vec<CollisionShape>,
}

/// A rigid body: all links that move together with one joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Links of the body; the first one is the joint's child link, whose frame is the body frame.
    pub links: Vec<Link>,
}

impl Body {
    /// Name of the joint's child link.
    pub fn name(&self) -> &str {
        &self.links[0].name
    }

    /// Prior inertial parameters in the body frame: the sum over the links with known inertial; `None` if no link has
    /// one.
    pub fn prior(&self) -> Option<InertialParameters> {
        self.links
            .iter()
            .filter_map(|link| link.inertial.map(|inertial| inertial.expressed_in(&link.placement)))
            .reduce(|sum, next| sum.plus(&next))
    }
}

/// A robot on a fixed base: a tree of joints and bodies, parents before children.
///
/// Body `i` is moved by joint `i` of the tree ([`tree_joints`](Model::tree_joints)). Usually each tree joint is a
/// degree of freedom. If some joints follow others ([`Joint::mimic`]), the **degrees of freedom**
/// ([`joints`](Model::joints)) are the independent joints, and [`coupling`](Model::coupling) maps them to the tree.
/// Positions, velocities and torques are vectors over the degrees of freedom.
#[doc(alias("robot", "kinematic tree", "multibody"))]
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    name: String,
    gravity: Vec3,
    tree: Vec<Joint>,
    /// Degrees of freedom: joints of `tree` that are not mimic joints.
    joints: Vec<Joint>,
    coupling: Option<JointCoupling>,
    bodies: Vec<Body>,
    base: Body,
    maps: Vec<JointMap>,
    inertials: Vec<InertialParameters>,
    steps: Vec<JointStep>,
    other_convention: Option<Box<OtherConvention>>,
}

#[derive(Clone, Debug, PartialEq)]
struct OtherConvention {
    convention: DhConvention,
    model: Model,
}

impl Model {
    /// Builds a model from the joints of its tree and their bodies. `base` contains the links that do not move.
    ///
    /// # Errors
    /// Different counts, a repeated name, a parent after its child, an axis that is not a unit vector, a cycle of mimic
    /// joints, or a number that is not finite.
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
            // The tolerance is well above the rounding error of a normalised vector.
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
        let inertials: Vec<_> = bodies.iter().map(|body| body.prior().unwrap_or(InertialParameters::ZERO)).collect();
        let steps = steps(&joints, &inertials);
        let maps = joints.iter().map(Joint::map).collect();
        let tree = joints;
        let coupling = JointCoupling::of(&tree)?;
        let joints = coupling.as_ref().map_or_else(
            || tree.clone(),
            |coupling| coupling.driving().iter().map(|&joint| tree[joint].clone()).collect(),
        );
        let gravity = STANDARD_GRAVITY;
        let (name, other_convention) = (name.to_owned(), None);
        Ok(Self { name, gravity, tree, joints, coupling, bodies, base, maps, inertials, steps, other_convention })
    }

    /// The robot's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Number of degrees of freedom: the length of every joint vector.
    pub fn dof(&self) -> usize {
        self.joints.len()
    }

    /// The independent joints, parents first: the degrees of freedom.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// All joints of the tree, parents first: joint `i` moves body `i`. Equal to [`joints`](Model::joints) if there
    /// are no mimic joints.
    pub fn tree_joints(&self) -> &[Joint] {
        &self.tree
    }

    /// Map from the degrees of freedom to the joints of the tree; `None` if they are the same.
    pub fn coupling(&self) -> Option<&JointCoupling> {
        self.coupling.as_ref()
    }

    /// Index in the tree of the joint of a degree of freedom, and of its body.
    pub fn body_of(&self, joint: usize) -> usize {
        self.coupling.as_ref().map_or(joint, |coupling| coupling.driving()[joint])
    }

    /// Degrees of freedom that move a joint of the tree, with the velocity ratios: the joint's row of `G` in
    /// [`JointCoupling`].
    pub fn drivers(&self, tree_joint: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let itself = self.coupling.is_none().then_some((tree_joint, 1.0));
        let followed = self.coupling.iter().flat_map(move |coupling| coupling.row(tree_joint).iter().copied());
        itself.into_iter().chain(followed)
    }

    /// Degree of freedom of a tree joint; `None` for a mimic joint.
    pub fn joint_of(&self, tree_joint: usize) -> Option<usize> {
        match &self.coupling {
            Some(coupling) => coupling.driving().binary_search(&tree_joint).ok(),
            None => Some(tree_joint),
        }
    }

    /// Mimic joints of the tree, with their tree indices.
    pub fn followers(&self) -> impl Iterator<Item = (usize, &Joint)> {
        self.tree.iter().enumerate().filter(|(place, _)| self.joint_of(*place).is_none())
    }

    /// Number of moving bodies, and of joints of the tree.
    pub fn body_count(&self) -> usize {
        self.tree.len()
    }

    /// Number of inertial parameters: ten for each moving body.
    pub fn inertial_count(&self) -> usize {
        10 * self.body_count()
    }

    /// Precomputed numbers of the joints, in the order of [`tree_joints`](Model::tree_joints).
    pub fn maps(&self) -> &[JointMap] {
        &self.maps
    }

    /// Joints and bodies in a form that needs the fewest operations, in the order of
    /// [`tree_joints`](Model::tree_joints).
    pub fn steps(&self) -> &[JointStep] {
        &self.steps
    }

    /// The moving bodies; joint `i` of the tree moves body `i`.
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// The base, which does not move.
    pub fn base(&self) -> &Body {
        &self.base
    }

    /// Gravitational acceleration in the base frame, m/s².
    pub fn gravity(&self) -> Vec3 {
        self.gravity
    }

    /// Inertial parameters of the bodies in their frames, as used by the dynamics; zero for bodies whose
    /// [`Body::prior`] is unknown.
    pub fn inertials(&self) -> &[InertialParameters] {
        &self.inertials
    }

    /// All inertial parameters, body by body: the vector `π` that the torque regressor multiplies.
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

    /// True if degree of freedom `joint` moves body `body`.
    pub fn moves(&self, joint: usize, body: usize) -> bool {
        let mut at = Some(body);
        while let Some(index) = at {
            if self.drivers(index).any(|(dof, _)| dof == joint) {
                return true;
            }
            at = self.tree[index].parent;
        }
        false
    }

    /// Joints of the tree from the base to body `body`, inclusive.
    pub fn path(&self, body: usize) -> Vec<usize> {
        let mut path = vec![body];
        while let Some(parent) = self.tree[path[path.len() - 1]].parent {
            path.push(parent);
        }
        path.reverse();
        path
    }

    /// The same robot with another gravity (base frame, m/s²).
    ///
    /// # Errors
    /// If a component is not finite.
    pub fn with_gravity(mut self, gravity: Vec3) -> Result<Self, ModelError> {
        if gravity.0.iter().any(|g| !g.is_finite()) {
            return Err(ModelError::NotFinite { what: "gravity".to_owned() });
        }
        self.gravity = gravity;
        if let Some(other) = &mut self.other_convention {
            other.model.gravity = gravity;
        }
        Ok(self)
    }

    /// For a Denavit-Hartenberg table: the model read in the other convention (standard instead of modified, or the
    /// reverse), and that convention. `None` for other descriptions. Gravity and locked joints are kept; any other
    /// change of the model removes it.
    pub fn other_convention(&self) -> Option<(DhConvention, &Self)> {
        self.other_convention.as_ref().map(|other| (other.convention, &other.model))
    }

    pub(crate) fn with_other_convention(mut self, convention: DhConvention, model: Self) -> Self {
        self.other_convention = Some(Box::new(OtherConvention { convention, model }));
        self
    }

    /// The same robot with longer or shorter links: the distances of these tree joints (indices as in
    /// [`tree_joints`](Model::tree_joints)) from the previous joint are multiplied by `factor`, which scales the
    /// translation of the placement, m. A negative factor mirrors the link. Bodies keep their parameters in their
    /// frames.
    ///
    /// # Errors
    /// If a joint is not there or a number would not be finite.
    pub fn with_joint_distances(mut self, joints: &[usize], factor: f64) -> Result<Self, ModelError> {
        for &joint in joints {
            let Some(place) = self.tree.get_mut(joint) else {
                let known = self.tree.iter().map(|joint| joint.name.clone()).collect();
                return Err(ModelError::UnknownJoint { joint: format!("number {}", joint + 1), known });
            };
            place.placement.translation = place.placement.translation.scale(factor);
        }
        let Self { name, base, tree, bodies, gravity, .. } = self;
        Self::new(&name, base, tree, bodies)?.with_gravity(gravity)
    }

    /// The same robot with its base rotated by roll, pitch, yaw (radians, fixed axes) relative to the world. Gravity in
    /// the base frame rotates in the opposite direction.
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
        if inertials.len() != self.body_count() {
            return Err(ModelError::Counts { joints: self.body_count(), bodies: inertials.len() });
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
        model.steps = steps(&model.tree, inertials);
        Ok(model)
    }

    /// The same robot with limits for joints whose limits are not known; `limits` gives them by the name of the joint.
    /// Known limits are kept, and `continuous` joints get no position limits.
    #[must_use]
    pub fn with_missing_limits(mut self, limits: impl Fn(&str) -> JointLimits) -> Self {
        for joint in self.tree.iter_mut().chain(&mut self.joints) {
            let (known, more) = (joint.limits, limits(&joint.name));
            let has_stops = joint.kind != JointKind::Continuous;
            joint.limits = JointLimits {
                lower: known.lower.or(more.lower.filter(|_| has_stops)),
                upper: known.upper.or(more.upper.filter(|_| has_stops)),
                velocity: known.velocity.or(more.velocity),
                effort: known.effort.or(more.effort),
            };
        }
        self
    }

    /// The same robot without some links. A fixed link is removed alone; a link that moves with a joint is removed
    /// together with all its descendants.
    ///
    /// # Errors
    /// An unknown link, or a mimic joint whose source would be removed.
    pub fn without_links(&self, links: &[String]) -> Result<Self, ModelError> {
        if links.is_empty() {
            return Ok(self.clone());
        }
        if links.is_empty() {
            return Ok(self.clone());
        }
        // The base keeps its first link, to which all other links are connected.
        let all = || self.bodies.iter().flat_map(|body| &body.links).chain(self.base.links.iter().skip(1));
        if let Some(link) = links.iter().find(|name| all().all(|link| link.name != **name)) {
            let known = all().map(|link| link.name.clone()).collect();
            return Err(ModelError::UnknownLink { link: link.clone(), known });
        }
        let is_kept = |link: &Link| !links.contains(&link.name);
        let mut base = self.base.clone();
        base.links.retain(is_kept);
        // New index of each remaining body.
        let mut stays: Vec<Option<usize>> = Vec::with_capacity(self.body_count());
        let (mut joints, mut bodies) = (Vec::new(), Vec::new());
        for (joint, body) in self.tree.iter().zip(&self.bodies) {
            let parent = joint.parent.map(|parent| stays[parent]);
            if parent == Some(None) || !is_kept(&body.links[0]) {
                stays.push(None);
                continue;
            }
            stays.push(Some(bodies.len()));
            joints.push(Joint { parent: parent.flatten(), ..joint.clone() });
            bodies.push(Body { links: body.links.iter().filter(|link| is_kept(link)).cloned().collect() });
        }
        let went = |name: &String| !joints.iter().any(|joint: &Joint| joint.name == *name);
        for joint in joints.iter().filter(|joint| self.joint_index(&joint.name).is_none()) {
            let sources = joint.mimic.iter().flat_map(|mimic| &mimic.sources);
            if let Some(source) = sources.map(|source| &source.joint).find(|name| went(name)) {
                let (joint, source) = (joint.name.clone(), source.clone());
                return Err(ModelError::LostSource { joint, source_joint: source });
            }
        }
        Self::new(&self.name, base, joints, bodies)?.with_gravity(self.gravity)
    }

    /// The same robot with all joints of the tree independent.
    #[must_use]
    pub fn without_followers(mut self) -> Self {
        for joint in &mut self.tree {
            joint.mimic = None;
        }
        self.joints.clone_from(&self.tree);
        self.coupling = None;
        self
    }

    /// The same robot with other mimic laws; `followers` names joints of the tree.
    ///
    /// # Errors
    /// An unknown name, a cycle of mimic joints, or a number that is not finite.
    pub fn with_followers(self, followers: &[(String, Mimic)]) -> Result<Self, ModelError> {
        if followers.is_empty() {
            return Ok(self);
        }
        let Self { name, gravity, mut tree, bodies, base, .. } = self;
        let known = || tree.iter().map(|joint| joint.name.clone()).collect::<Vec<_>>();
        let unknown = |joint: &str| ModelError::UnknownJoint { joint: joint.to_owned(), known: known() };
        let place = |name: &str| tree.iter().position(|joint| joint.name == name).ok_or_else(|| unknown(name));
        let mut places = Vec::with_capacity(followers.len());
        for (joint, mimic) in followers {
            places.push(place(joint)?);
            for source in &mimic.sources {
                place(&source.joint)?;
            }
        }
        for (place, (_, mimic)) in places.into_iter().zip(followers) {
            tree[place].mimic = Some(mimic.clone());
        }
        Self::new(&name, base, tree, bodies)?.with_gravity(gravity)
    }

    /// The same robot with the named joints locked at the given positions (rad or m): their bodies are merged into the
    /// parent bodies. A mimic joint whose sources are all locked is locked as well.
    ///
    /// # Errors
    /// If a name is unknown or given twice, or a position is not finite.
    pub fn locked(&self, positions: &[(String, f64)]) -> Result<Self, ModelError> {
        let mut position_of = vec![None; self.body_count()];
        for (name, position) in positions {
            let index = self.tree.iter().position(|joint| joint.name == *name).ok_or_else(|| {
                let known = self.tree.iter().map(|joint| joint.name.clone()).collect();
                ModelError::UnknownJoint { joint: name.clone(), known }
            })?;
            if !position.is_finite() {
                return Err(ModelError::NotFinite { what: format!("locked position of joint `{name}`") });
            }
            if position_of[index].replace(*position).is_some() {
                return Err(ModelError::DuplicateJoint { joint: name.clone() });
            }
        }
        let tree = self.following_the_rest(&mut position_of);
        // New index of each old body (`None`: base), and `new_from_old`.
        let mut went: Vec<(Option<usize>, Transform)> = Vec::with_capacity(self.body_count());
        let (mut joints, mut bodies, mut base) = (Vec::new(), Vec::<Body>::new(), self.base.clone());
        for (index, joint) in tree.iter().enumerate() {
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
        let held = Self::new(&self.name, base, joints, bodies)?.with_gravity(self.gravity)?;
        Ok(match self.other_convention() {
            Some((convention, other)) => held.with_other_convention(convention, other.locked(positions)?),
            None => held,
        })
    }

    /// Joints of the tree after locking those with a given position. A locked source becomes an offset of the mimic
    /// joints that follow it; a mimic joint without a free source is locked, too.
    fn following_the_rest(&self, position_of: &mut [Option<f64>]) -> Vec<Joint> {
        let mut tree = self.tree.clone();
        let Some(coupling) = &self.coupling else { return tree };
        let place = |name: &str| self.tree.iter().position(|joint| joint.name == *name);
        // A chain of mimic joints is at most as long as the tree.
        for _ in 0..tree.len() {
            for index in 0..tree.len() {
                if coupling.driving().contains(&index) || position_of[index].is_some() {
                    continue;
                }
                let Some(mimic) = &mut tree[index].mimic else { continue };
                let offset = &mut mimic.offset;
                mimic.sources.retain(|source| {
                    let held = place(&source.joint).and_then(|at| position_of[at]);
                    *offset += held.map_or(0.0, |position| source.multiplier * position);
                    held.is_none()
                });
                if mimic.sources.is_empty() {
                    position_of[index] = Some(*offset);
                }
            }
        }
        tree
    }
}
