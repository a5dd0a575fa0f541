//! Sample robots for tests, benchmarks and examples, with a small seeded random generator.

use crate::inertial::InertialParameters;
use crate::joint::{Joint, JointKind, JointLimits};
use crate::spatial::{Mat3, Transform, Vec3};
use crate::tree::{Body, Link, Model};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// SplitMix64 (Steele, Lea and Flood 2014): the same sequence on every platform.
#[derive(Clone, Debug)]
pub struct Random(SplitMix64);

impl Random {
    /// Generator with this seed.
    pub fn new(seed: u64) -> Self {
        Self(SplitMix64::seed_from_u64(seed))
    }

    /// Next 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0.next_u64()
    }

    /// Uniform between `low` and `high`.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        // Steps of 2^-53, so that every possible value is exact.
        low + (high - low) * ((self.bits() >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0))
    }

    /// Standard normal (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform(0.0, 1.0)).ln()).sqrt();
        radius * (core::f64::consts::TAU * self.uniform(0.0, 1.0)).cos()
    }

    /// Uniformly distributed unit vector.
    pub fn direction(&mut self) -> Vec3 {
        let v = Vec3([self.normal(), self.normal(), self.normal()]);
        v.scale(1.0 / v.norm())
    }

    /// A physically consistent body: positive principal moments that satisfy the triangle inequality, centre of mass
    /// within 0.3 m.
    pub fn body(&mut self) -> InertialParameters {
        let mass = self.uniform(0.2, 5.0);
        let second: [f64; 3] = core::array::from_fn(|_| mass * self.uniform(0.001, 0.04));
        let turn = Mat3::from_axis_angle(self.direction(), self.uniform(0.0, 3.0));
        let principal = Mat3([
            [second[1] + second[2], 0.0, 0.0],
            [0.0, second[0] + second[2], 0.0],
            [0.0, 0.0, second[0] + second[1]],
        ]);
        let inertia = turn.mul_mat(&principal).mul_mat(&turn.transpose());
        let com = Vec3(core::array::from_fn(|_| self.uniform(-0.3, 0.3)));
        InertialParameters::from_centre_of_mass(mass, com, &inertia)
    }
}

fn plain_joint(name: String, kind: JointKind, parent: Option<usize>, placement: Transform, axis: Vec3) -> Joint {
    Joint {
        name,
        kind,
        parent,
        placement,
        axis,
        limits: JointLimits::default(),
        damping: None,
        friction: None,
        drive_inertia: None,
        spring: None,
        mimic: None,
    }
}

fn plain_body(name: String, inertial: Option<InertialParameters>) -> Body {
    Body { links: vec![Link { name, placement: Transform::IDENTITY, inertial, collision: Vec::new() }] }
}

/// A random tree of `dof` joints: revolute and prismatic (one in four), general axes and placements, branches,
/// sometimes several trees on the base; physically consistent bodies; gravity in a general direction.
///
/// # Panics
/// It never panics: every part is valid by construction.
pub fn random_tree(seed: u64, dof: usize) -> Model {
    let mut random = Random::new(seed.wrapping_mul(0x1234_5678_9abc_def1).wrapping_add(7));
    let (mut joints, mut bodies) = (Vec::new(), Vec::new());
    for index in 0..dof {
        // Usually the last body, so that trees are deep; otherwise any earlier one or the base.
        let parent = if index > 0 && random.uniform(0.0, 1.0) < 0.7 {
            Some(index - 1)
        } else {
            (random.uniform(0.0, index as f64 + 1.0) as usize).min(index).checked_sub(1)
        };
        let kind = if random.uniform(0.0, 1.0) < 0.25 { JointKind::Prismatic } else { JointKind::Continuous };
        let placement = Transform {
            rotation: Mat3::from_axis_angle(random.direction(), random.uniform(0.0, 3.0)),
            translation: Vec3(core::array::from_fn(|_| random.uniform(-0.5, 0.5))),
        };
        let axis = random.direction();
        joints.push(plain_joint(format!("joint{}", index + 1), kind, parent, placement, axis));
        bodies.push(plain_body(format!("link{}", index + 1), Some(random.body())));
    }
    let gravity = random.direction().scale(9.81);
    Model::new("random tree", plain_body("base".to_owned(), None), joints, bodies)
        .and_then(|model| model.with_gravity(gravity))
        .expect("a random tree is valid by construction")
}

/// Planar arm with two revolute joints of parallel axes along z, first link of length `a1_m`, gravity along -y
/// (*Iterative Identification of Robot Dynamic Parameters Based on Logistic Function*, Fig. 1 and Table 1).
///
/// # Panics
/// It never panics: every part is valid by construction.
pub fn planar_2r(a1_m: f64, first: InertialParameters, second: InertialParameters) -> Model {
    let z = Vec3([0.0, 0.0, 1.0]);
    let elbow = Transform { rotation: Mat3::IDENTITY, translation: Vec3([a1_m, 0.0, 0.0]) };
    let joints = vec![
        plain_joint("joint1".to_owned(), JointKind::Continuous, None, Transform::IDENTITY, z),
        plain_joint("joint2".to_owned(), JointKind::Continuous, Some(0), elbow, z),
    ];
    let bodies = vec![plain_body("link1".to_owned(), Some(first)), plain_body("link2".to_owned(), Some(second))];
    Model::new("planar 2R", plain_body("base".to_owned(), None), joints, bodies)
        .and_then(|model| model.with_gravity(Vec3([0.0, -9.8, 0.0])))
        .expect("the planar arm is valid by construction")
}
