//! The equation of motion of several robots at once: one tree, and in every lane other bodies.

use crate::hinge::{Hinge, Hinges, with_hinge};
use crate::states::LinkState;
use dynident_lanes::Lane;
use dynident_model::{JointStep, Mat3, Model, Vec3};

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
pub struct RobotLanes<T> {
    /// The tree; inertial parameters are in `bodies`.
    steps: Vec<JointStep>,
    bodies: Vec<LaneBody<T>>,
    /// Minus gravity: the acceleration of the base as bodies feel it.
    base: Vec3<T>,
    hinges: Hinges<T>,
    links: Vec<LinkState<T>>,
    moments: Vec<(Vec3<T>, [T; 6])>,
    matrix: Vec<T>,
    /// Whether every joint hangs on the one before: the matrix then has no entry that is always zero.
    is_one_run: bool,
    bias: Vec<T>,
}

/// The inertial numbers of a [`JointStep`], lane by lane.
#[derive(Clone, Copy, Debug)]
struct LaneBody<T> {
    mass: T,
    first: Vec3<T>,
    second: [T; 6],
    subtree_mass: T,
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
        Some(Self {
            bodies: steps.iter().map(body).collect(),
            base: (-model.gravity()).splat(),
            hinges: Hinges::new(joints),
            links: vec![LinkState::REST; joints],
            moments: vec![(Vec3::ZERO, [T::ZERO; 6]); joints],
            matrix: vec![T::ZERO; joints * joints],
            is_one_run: steps.iter().enumerate().all(|(index, step)| step.parent == index.checked_sub(1)),
            bias: vec![T::ZERO; joints],
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
        self.hinges.place(&self.steps, q);
        self.newton_euler(dq);
        self.composite_bodies();
        (&mut self.matrix, &mut self.bias)
    }

    /// Inverse dynamics without acceleration (Featherstone 2008, section 5.3) into `bias`.
    #[inline(always)]
    fn newton_euler(&mut self, dq: &[T]) {
        let joints = self.steps.len();
        let (steps, bodies, hinges) = (&self.steps[..joints], &self.bodies[..joints], self.hinges.placed(joints));
        let (links, bias, dq) = (&mut self.links[..joints], &mut self.bias[..joints], &dq[..joints]);
        let base = LinkState { acceleration: self.base, ..LinkState::REST };
        for index in 0..joints {
            let step = &steps[index];
            let (inner, outer) = links.split_at_mut(index);
            let parent = step.parent.map_or(&base, |parent| &inner[parent]);
            let origin = parent.spin.mul_vec(hinges.translation(step, index)) + parent.acceleration;
            let arriving = with_hinge!(hinges, *step, index, |hinge| {
                [hinge.down(parent.omega), hinge.down(parent.alpha), hinge.down(origin)]
            });
            let link = &mut outer[0];
            moved(step.turns, arriving, dq[index], link);
            (link.force, link.moment) = wrench(step.turns, &bodies[index], link);
        }
        for index in (0..joints).rev() {
            let step = &steps[index];
            let (inner, outer) = links.split_at_mut(index);
            let link = &outer[0];
            bias[index] = if step.turns { link.moment[2] } else { link.force[2] };
            if let Some(parent) = step.parent {
                let parent = &mut inner[parent];
                let (force, moment) =
                    with_hinge!(hinges, *step, index, |hinge| (hinge.up(link.force), hinge.up(link.moment)));
                parent.force += force;
                parent.moment = hinges.translation(step, index).cross_add(force, parent.moment) + moment;
            }
        }
    }

    /// Composite rigid bodies (Featherstone 2008, section 6.2) into the lower triangle of `matrix`.
    #[inline(always)]
    fn composite_bodies(&mut self) {
        let joints = self.steps.len();
        let (steps, bodies, hinges) = (&self.steps[..joints], &self.bodies[..joints], self.hinges.placed(joints));
        let moments = &mut self.moments[..joints];
        if !self.is_one_run {
            self.matrix.fill(T::ZERO);
        }
        for index in (0..joints).rev() {
            let (step, body) = (&steps[index], &bodies[index]);
            let (inner, outer) = moments.split_at_mut(index);
            if step.is_tip {
                outer[0] = (body.first, body.second);
            }
            let (h, s) = &outer[0];
            let row = &mut self.matrix[index * joints..][..=index];
            let (mut f, mut n) = if step.turns {
                (Vec3([-h[1], h[0], T::ZERO]), Vec3([-s[2], -s[4], s[0] + s[3]]))
            } else {
                (Vec3([T::ZERO, T::ZERO, body.subtree_mass]), Vec3([h[1], -h[0], T::ZERO]))
            };
            let mut at = index;
            loop {
                row[at] = if steps[at].turns { n[2] } else { f[2] };
                let Some(parent) = steps[at].parent else { break };
                (f, n) = with_hinge!(hinges, steps[at], at, |hinge| (hinge.up(f), hinge.up(n)));
                n = hinges.translation(&steps[at], at).cross_add(f, n);
                at = parent;
            }
            let Some(parent) = step.parent else { continue };
            let (h, s) = with_hinge!(hinges, *step, index, |hinge| (hinge.up(*h), hinge.up_symmetric(s)));
            let own = &bodies[parent];
            // A body takes its own moments when the first of its children comes.
            let mut sum = if step.is_last_child { (own.first, own.second) } else { inner[parent] };
            add(&mut sum, h, &s, body.subtree_mass, hinges.translation(step, index));
            inner[parent] = sum;
        }
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

/// One step outward without joint acceleration: see the inverse dynamics.
#[inline(always)]
fn moved<T: Lane>(turns: bool, arriving: [Vec3<T>; 3], dq: T, link: &mut LinkState<T>) {
    let [mut omega, mut alpha, mut acceleration] = arriving;
    let [wx, wy, _] = omega.0;
    if turns {
        alpha = Vec3([wy.mul_add(dq, alpha[0]), wx.neg_mul_add(dq, alpha[1]), alpha[2]]);
        omega.0[2] += dq;
    } else {
        let twice = dq + dq;
        let [x, y, z] = acceleration.0;
        acceleration = Vec3([wy.mul_add(twice, x), wx.neg_mul_add(twice, y), z]);
    }
    let ([wx, wy, wz], [ax, ay, az]) = (omega.0, alpha.0);
    let (xx, yy, zz) = (wx * wx, wy * wy, wz * wz);
    let spin = Mat3([
        [-(yy + zz), wx.mul_add(wy, -az), wx.mul_add(wz, ay)],
        [wx.mul_add(wy, az), -(xx + zz), wy.mul_add(wz, -ax)],
        [wx.mul_add(wz, -ay), wy.mul_add(wz, ax), -(xx + yy)],
    ]);
    (link.omega, link.alpha, link.acceleration, link.spin) = (omega, alpha, acceleration, spin);
}

/// The wrench that a body needs by itself: see the inverse dynamics.
#[inline(always)]
fn wrench<T: Lane>(turns: bool, body: &LaneBody<T>, link: &LinkState<T>) -> (Vec3<T>, Vec3<T>) {
    let g = &link.spin.0;
    let [ax, ay, az] = link.acceleration.0;
    let [hx, hy, hz] = body.first.0;
    let [xx, xy, xz, yy, yz, zz] = body.second;
    let mut f =
        Vec3([g[0][1].mul_add(hy, g[0][0] * hx), g[1][1].mul_add(hy, g[1][0] * hx), g[2][1].mul_add(hy, g[2][0] * hx)]);
    let mut n = Vec3([hy * az, -(hx * az), hx.mul_add(ay, -(hy * ax))]);
    n.0[0] = g[1][1].neg_mul_add(yz, g[1][0].neg_mul_add(xz, n[0]));
    n.0[0] = g[2][2].mul_add(yz, g[2][1].mul_add(yy, g[2][0].mul_add(xy, n[0])));
    n.0[1] = g[2][2].neg_mul_add(xz, g[2][1].neg_mul_add(xy, g[2][0].neg_mul_add(xx, n[1])));
    n.0[1] = g[0][1].mul_add(yz, g[0][0].mul_add(xz, n[1]));
    n.0[2] = g[1][2].mul_add(xz, g[1][1].mul_add(xy, g[1][0].mul_add(xx, n[2])));
    n.0[2] = g[0][2].neg_mul_add(yz, g[0][1].neg_mul_add(yy, g[0][0].neg_mul_add(xy, n[2])));
    if !turns {
        let along = Vec3([g[0][2], g[1][2], g[2][2]]);
        f = link.acceleration.scale_add(body.mass, along.scale_add(hz, f));
        n.0[0] = g[1][2].neg_mul_add(zz, hz.neg_mul_add(ay, n[0]));
        n.0[1] = g[0][2].mul_add(zz, hz.mul_add(ax, n[1]));
    }
    (f, n)
}

/// Adds moments `(m, h, Σ)` about the point `t` to moments `(h, Σ)` about the origin: see the mass matrix.
#[inline(always)]
fn add<T: Lane>(sum: &mut (Vec3<T>, [T; 6]), h: Vec3<T>, s: &[T; 6], mass: T, t: Vec3<T>) {
    let (first, second) = sum;
    *first += h;
    *first += t.scale(mass);
    let g = t.scale_add(T::splat(0.5) * mass, h);
    macro_rules! entry {
        ($k:literal, $a:literal, $b:literal) => {
            second[$k] += t[$a].mul_add(g[$b], t[$b].mul_add(g[$a], s[$k]));
        };
    }
    entry!(0, 0, 0);
    entry!(1, 0, 1);
    entry!(2, 0, 2);
    entry!(3, 1, 1);
    entry!(4, 1, 2);
    entry!(5, 2, 2);
}
