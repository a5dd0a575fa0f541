//! The equation of motion of several robots at once: one tree, and in every lane other bodies.

use crate::bodies::Bodies;
use crate::inverse_dynamics::newton_euler_of;
use crate::joint_matrices::MatrixRows;
use crate::mass_matrix::composite_rigid_bodies;
use crate::workspace::CoreScratch;
use dynident_lanes::{AlignedBuffer, Lane};
use dynident_model::{JointStep, Model, Vec3};

/// Robots of one tree side by side, each with its own inertial parameters and gravity, and scratch for their mass
/// matrices and bias torques: what a simulation of many robots at once steps with. Lanes do not touch each other.
///
/// It is used inside a [`Kernel`](dynident_lanes::Kernel), whose lane type it takes.
///
/// ```
/// use dynident_dynamics::{RobotLanes, Workspace, mass_matrix_and_bias};
/// use dynident_lanes::{Kernel, Lane, Level, dispatch};
/// use dynident_model::{InertialParameters, Mat3, Model, Vec3, sample::planar_2r};
///
/// /// How far lanes are from single robots: arm `k` has rods of `1 + k` kg.
/// struct Difference;
/// impl Kernel for Difference {
///     type Output = f64;
///     fn run<T: Lane>(self) -> f64 {
///         let rod = |kg| InertialParameters::from_centre_of_mass(kg, Vec3([0.5, 0.0, 0.0]), &Mat3::ZERO);
///         let arms: Vec<Model> = (1..=T::LANES).map(|kg| planar_2r(1.0, rod(kg as f64), rod(kg as f64))).collect();
///         let mut lanes = RobotLanes::<T>::new(&arms[0]).unwrap();
///         arms.iter().enumerate().for_each(|(lane, arm)| lanes.put(lane, arm));
///         let (q, dq) = ([0.3, -0.8], [0.5, 1.0]);
///         let (matrix, bias) = lanes.matrix_and_bias(&q.map(T::splat), &dq.map(T::splat));
///         let mut worst = 0.0_f64;
///         for (lane, arm) in arms.iter().enumerate() {
///             let mut workspace = Workspace::new(arm);
///             let (one, its_bias) = mass_matrix_and_bias(arm, &mut workspace, &q, &dq);
///             // Row 1, column 0 of the lower triangle, and the torque of joint 1.
///             worst = worst.max((matrix[2].lane(lane) - one[2]).abs());
///             worst = worst.max((bias[1].lane(lane) - its_bias[1]).abs());
///         }
///         worst
///     }
/// }
/// assert!(dispatch(Level::detect(), Difference) < 1e-12);
/// ```
#[derive(Debug)]
pub struct RobotLanes<T: Lane> {
    /// The tree; inertial parameters are in `bodies`.
    steps: Vec<JointStep>,
    bodies: Vec<LaneBody<T>>,
    /// Minus gravity: the acceleration of the base as bodies feel it.
    base: Vec3<T>,
    scratch: CoreScratch<T>,
    /// Entry by entry, a place for each lane.
    rows: AlignedBuffer,
    matrix: Vec<T>,
}

/// The inertial numbers of a [`JointStep`], lane by lane.
#[derive(Clone, Copy, Debug)]
struct LaneBody<T> {
    mass: T,
    first: Vec3<T>,
    second: [T; 6],
    subtree_mass: T,
}

impl<T: Lane> Bodies<T> for &[LaneBody<T>] {
    #[inline(always)]
    fn mass(self, index: usize) -> T {
        self[index].mass
    }
    #[inline(always)]
    fn first(self, index: usize) -> Vec3<T> {
        self[index].first
    }
    #[inline(always)]
    fn second(self, index: usize) -> [T; 6] {
        self[index].second
    }
    #[inline(always)]
    fn subtree_mass(self, index: usize) -> T {
        self[index].subtree_mass
    }
    #[inline(always)]
    fn is_massless(self, _: usize) -> bool {
        false
    }
}

impl<T: Lane> RobotLanes<T> {
    /// Lanes that all hold `model`; none where joints follow others ([`Model::coupling`]).
    pub fn new(model: &Model) -> Option<Self> {
        if model.coupling().is_some() {
            return None;
        }
        let (steps, joints) = (model.steps().to_vec(), model.steps().len());
        let body = |step: &JointStep| LaneBody {
            mass: T::splat(step.mass),
            first: step.first.splat(),
            second: step.second.map(T::splat),
            subtree_mass: T::splat(step.subtree_mass),
        };
        let mut rows = AlignedBuffer::new();
        rows.resize(joints * joints * T::LANES);
        rows.as_mut_slice().fill(0.0);
        Some(Self {
            bodies: steps.iter().map(body).collect(),
            base: (-model.gravity()).splat(),
            scratch: CoreScratch::new(joints),
            rows,
            matrix: vec![T::ZERO; joints * joints],
            steps,
        })
    }

    /// Puts a robot into a lane.
    ///
    /// # Panics
    /// If it has another tree ([`share_tree`]), or there is no such lane.
    pub fn put(&mut self, lane: usize, model: &Model) {
        assert!(same_steps(&self.steps, model.steps()), "robots side by side have one tree");
        let set = |to: &mut T, value: f64| *to = to.with_lane(lane, value);
        for (to, step) in self.bodies.iter_mut().zip(model.steps()) {
            set(&mut to.mass, step.mass);
            set(&mut to.subtree_mass, step.subtree_mass);
            for (to, value) in to.first.0.iter_mut().zip(step.first.0) {
                set(to, value);
            }
            for (to, value) in to.second.iter_mut().zip(step.second) {
                set(to, value);
            }
        }
        for (to, value) in self.base.0.iter_mut().zip((-model.gravity()).0) {
            set(to, value);
        }
    }

    /// The lower triangles of the mass matrices `M(q)` (row-major, dof × dof; what stands above the diagonal has no
    /// meaning), kg m² (kg, kg m), and the bias torques `C(q, q̇) q̇ + g(q)`, Nm (N): in every lane the numbers of
    /// [`mass_matrix_and_bias`](crate::mass_matrix_and_bias), whose algorithms these are.
    /// The caller may use them up.
    ///
    /// # Panics
    /// If a vector has not one entry per joint.
    #[inline(always)]
    pub fn matrix_and_bias(&mut self, q: &[T], dq: &[T]) -> (&mut [T], &mut [T]) {
        let Self { steps, bodies, base, scratch, rows, matrix } = self;
        let joints = steps.len();
        scratch.q.copy_from_slice(q);
        scratch.dq.copy_from_slice(dq);
        scratch.hinges.place(steps, &scratch.q);
        newton_euler_of(steps, &**bodies, *base, scratch);
        // Joints on different branches do not couple: what stands there is zero from the beginning.
        let out = &mut MatrixRows { out: rows.as_mut_slice(), stride: T::LANES };
        composite_rigid_bodies(steps, &**bodies, scratch, out, 0);
        for row in 0..joints {
            for entry in row * joints..=row * joints + row {
                matrix[entry] = T::load(&rows.as_slice()[entry * T::LANES..]);
            }
        }
        (matrix, &mut scratch.tau)
    }
}

/// Whether two robots can stand side by side in [`RobotLanes`]: joints of the same kinds at the same places of their
/// parents, with numbers that are equal, none of which follows another. Masses and gravity may differ.
///
/// ```
/// use dynident_dynamics::share_tree;
/// use dynident_model::{InertialParameters, Mat3, Vec3, sample::planar_2r};
/// let rod = |kg| InertialParameters::from_centre_of_mass(kg, Vec3([0.5, 0.0, 0.0]), &Mat3::ZERO);
/// let arm = planar_2r(1.0, rod(1.0), rod(1.0));
/// assert!(share_tree(&arm, &planar_2r(1.0, rod(2.0), rod(3.0))));
/// assert!(!share_tree(&arm, &planar_2r(1.1, rod(1.0), rod(1.0))));
/// ```
pub fn share_tree(one: &Model, other: &Model) -> bool {
    one.coupling().is_none() && other.coupling().is_none() && same_steps(one.steps(), other.steps())
}

/// Whether the steps differ in nothing but inertial numbers.
fn same_steps(one: &[JointStep], other: &[JointStep]) -> bool {
    let shape =
        |step: &JointStep| JointStep { mass: 0.0, first: Vec3::ZERO, second: [0.0; 6], subtree_mass: 0.0, ..*step };
    one.iter().map(shape).eq(other.iter().map(shape))
}
