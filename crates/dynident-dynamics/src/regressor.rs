//! The torque regressor of the bodies: joint torques as a linear function of the inertial parameters.
//!
//! Row `j`, block of body `i` (a body that joint `j` moves): power of the body's wrench along the joint's axis, `Y_ji
//! = e_jᵀ N_i + l_jᵀ F_i`. `(e_j, l_j)` is the axis as a twist at the frame of body `i`; `N_i` and `F_i` (3 × 10) are
//! moment and force of the body as functions of its ten parameters. Axes are transformed outward from frame to frame
//! with the bodies (Atkeson, An and Hollerbach 1986 in the form of Featherstone's spatial vectors), so a serial arm
//! costs one small rotation and one 6 × 10 product per pair.

use crate::hinge::{minus_cross_shift, times_shift};
use crate::own_turn::{OwnTurn, bundles, with_own_turn};
use crate::sample_lanes::take;
use crate::states::{AxisScratch, LinkMotion};
use crate::tree_scratch::TreeScratch;
use crate::workspace::{AnyScratch, CoreScratch, Workspace};
use dynident_lanes::{Kernel, Lane, Scalar, dispatch_single};
use dynident_model::{Mat3, Model, Vec3};

/// Computes the regressor `Y(q, q̇, q̈)` with `Y π = τ`, row-major, dof rows × 10·bodies columns: column `10 i + k`
/// is parameter `k` of body `i` in the order of [`INERTIAL_NAMES`](dynident_model::INERTIAL_NAMES). Unit: Nm (N) per
/// unit of the parameter. Does not depend on the model's own inertial parameters.
///
/// Allocation-free.
///
/// # Panics
/// If a vector's length is not the number of joints, or for a workspace of another tree.
#[doc(alias("joint torque regressor", "observation matrix", "idm"))]
pub fn torque_regressor<'w>(
    model: &Model,
    workspace: &'w mut Workspace,
    q: &[f64],
    dq: &[f64],
    ddq: &[f64],
) -> &'w [f64] {
    workspace.check(model, &[q, dq, ddq]);
    workspace.check_tree(model);
    let Workspace { level, scratch, regressor, tree, .. } = workspace;
    if let Some(coupling) = model.coupling() {
        tree.take_motion(coupling, q, dq, ddq);
        let TreeScratch { q, dq, ddq, regressor: out, .. } = tree;
        dispatch_single(*level, Single { model, scratch, q, dq, ddq, out });
        // One row is treated like the samples of one joint, with ten values per body.
        regressor.fill(0.0);
        coupling.add_projected(&tree.regressor, 10 * model.body_count(), regressor);
    } else {
        dispatch_single(*level, Single { model, scratch, q, dq, ddq, out: regressor });
    }
    regressor
}

struct Single<'a> {
    model: &'a Model,
    scratch: &'a mut AnyScratch,
    q: &'a [f64],
    dq: &'a [f64],
    ddq: &'a [f64],
    out: &'a mut [f64],
}

impl Kernel for Single<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self) {
        let scratch = self.scratch.of::<T>();
        take(&mut scratch.core.q, self.q);
        take(&mut scratch.core.dq, self.dq);
        take(&mut scratch.core.ddq, self.ddq);
        // Entries of joints that do not move a body are never written and remain zero.
        let mut sink = DenseRows { columns: 10 * self.model.body_count(), out: self.out };
        regressor_blocks(self.model, &mut scratch.core, &mut scratch.axes, &mut sink);
    }
}

/// Destination of the regressor blocks. A trait instead of a closure, because only methods are reliably inlined into
/// the code of each processor level.
pub(crate) trait BlockSink<T: Lane> {
    /// Called before the entries of body `body`.
    #[inline(always)]
    fn begin(&mut self, _body: usize) {}

    /// Receives the ten entries of body `body` for the joints `path[bundle * PER_BUNDLE..]`, one joint per lane group.
    fn put(&mut self, body: usize, path: &[u32], bundle: usize, work: &impl Entries<T::Bundle>);
}

struct DenseRows<'a> {
    columns: usize,
    out: &'a mut [f64],
}

impl<T: Lane> BlockSink<T> for DenseRows<'_> {
    #[inline(always)]
    fn put(&mut self, body: usize, path: &[u32], bundle: usize, work: &impl Entries<T::Bundle>) {
        let joints = &path[bundle * T::PER_BUNDLE..];
        if T::PER_BUNDLE == 4 {
            // Ten entries as three overlapping groups of four.
            let first = T::Bundle::transposed([work.of::<0>(), work.of::<1>(), work.of::<2>(), work.of::<3>()]);
            let (w6, w7) = (work.of::<6>(), work.of::<7>());
            let middle = T::Bundle::transposed([work.of::<4>(), work.of::<5>(), w6, w7]);
            let last = T::Bundle::transposed([w6, w7, work.of::<8>(), work.of::<9>()]);
            // Unrolled, because a loop would first write all entries to memory.
            macro_rules! rows {
                ($($place:literal)*) => {
                    $(if let Some(&joint) = joints.get($place) {
                        let row = &mut self.out[joint as usize * self.columns + 10 * body..][..10];
                        first[$place].store(&mut row[..4]);
                        middle[$place].store(&mut row[4..8]);
                        last[$place].store(&mut row[6..]);
                    })*
                };
            }
            rows!(0 1 2 3);
            return;
        }
        let mut lanes = [[0.0; 8]; 10];
        macro_rules! store {
            ($($parameter:literal)*) => { $(work.of::<$parameter>().store(&mut lanes[$parameter]);)* };
        }
        store!(0 1 2 3 4 5 6 7 8 9);
        for (place, &joint) in joints.iter().take(T::PER_BUNDLE).enumerate() {
            let row = &mut self.out[joint as usize * self.columns + 10 * body..][..10];
            for (to, column) in row.iter_mut().zip(&lanes) {
                *to = column[place];
            }
        }
    }
}

/// Computes the ten entries of all bodies and bundles of axes and passes them to `sink`.
#[inline(always)]
pub(crate) fn regressor_blocks<T: Lane>(
    model: &Model,
    core: &mut CoreScratch<T>,
    axes: &mut AxisScratch<T>,
    sink: &mut impl BlockSink<T>,
) {
    let (maps, steps) = (model.maps(), model.steps());
    let joints = maps.len();
    T::sin_cos_all(&core.q, &mut core.sine, &mut core.cosine);
    let (steps, motions) = (&steps[..joints], &mut core.motions[..joints]);
    let (q, dq, ddq) = (&core.q[..joints], &core.dq[..joints], &core.ddq[..joints]);
    let (sine, cosine) = (&core.sine[..joints], &core.cosine[..joints]);
    let base = LinkMotion { acceleration: (-model.gravity()).splat(), ..LinkMotion::REST };
    // Motion of the previous body: along a chain it stays in registers.
    let mut motion = base;
    for index in 0..joints {
        let (map, step) = (&maps[index], &steps[index]);
        if !step.hang.follows {
            motion = map.parent.map_or(base, |parent| motions[parent]);
        }
        let path = &axes.path[axes.path_start[index]..axes.path_start[index + 1]];
        let start = axes.bundle_start[index];
        let inherited = map.parent.map_or(0..0, |parent| axes.bundle_start[parent]..axes.bundle_start[parent + 1]);
        let translation = if map.is_rotary {
            map.translation.splat()
        } else {
            map.slide.splat().scale_add(q[index], map.translation.splat())
        };
        let origin = times_shift(map.shift, translation, &motion.spin, motion.acceleration);
        let bundled_translation = Vec3(bundles(translation.0));
        // Axes of earlier bodies, including the parent, and of this body.
        let (angular, own_angular) = axes.angular.split_at_mut(start);
        let (linear, own_linear) = axes.linear.split_at_mut(start);
        let above = angular[inherited.clone()].iter().zip(&linear[inherited]);
        let below = own_angular.iter_mut().zip(own_linear);
        let (omega, alpha, acceleration) = with_own_turn!(map, q[index], sine[index], cosine[index], |turn| {
            let bundled = turn.bundled();
            for ((angular, linear), (to_angular, to_linear)) in above.zip(below) {
                let linear = minus_cross_shift(map.shift, bundled_translation, *angular, *linear);
                (*to_angular, *to_linear) = (bundled.down(*angular), bundled.down(linear));
            }
            let arriving = (turn.down(motion.omega), turn.down(motion.alpha), turn.down(origin));
            if map.is_rotary {
                let (omega, alpha) = turn.rates(arriving.0, arriving.1, dq[index], ddq[index]);
                (omega, alpha, arriving.2)
            } else {
                arriving
            }
        });
        motion = LinkMotion { omega, alpha, acceleration, spin: spin(omega, alpha) };
        let axis = map.axis.splat::<T>();
        if !map.is_rotary {
            let coriolis = omega.cross(axis.scale(dq[index]));
            motion.acceleration = axis.scale_add(ddq[index], acceleration + coriolis + coriolis);
        }
        if step.branches {
            motions[index] = motion;
        }
        // The joint's own axis is the last one of the path.
        let (bundle, place) = ((path.len() - 1) / T::PER_BUNDLE, (path.len() - 1) % T::PER_BUNDLE);
        if place == 0 {
            axes.angular[start + bundle] = Vec3::ZERO;
            axes.linear[start + bundle] = Vec3::ZERO;
        }
        let own = if map.is_rotary { &mut axes.angular } else { &mut axes.linear };
        for k in 0..3 {
            axis[k].add_at(&mut own[start + bundle].0[k], place);
        }
        let wrench = WrenchBasis::new(&motion);
        sink.begin(index);
        let mut rest = axes.bundle_start[index + 1] - start;
        if T::PER_BUNDLE == 1 && map.is_rotary {
            // The joint's own axis passes through the frame's origin: no linear part.
            rest -= 1;
            macro_rules! along {
                ($child:literal) => {
                    sink.put(index, path, rest, &OwnWork::<_, $child> { wrench: &wrench, axis: axis[$child].bundle() })
                };
            }
            match map.along {
                Some((_, 0)) => along!(0),
                Some((_, 1)) => along!(1),
                Some((_, 2)) => along!(2),
                _ => sink.put(index, path, rest, &Work::new(&wrench, axes.angular[start + rest], Vec3::ZERO)),
            }
        }
        for k in 0..rest {
            let (angular, linear) = (axes.angular[start + k], axes.linear[start + k]);
            sink.put(index, path, k, &Work::new(&wrench, angular, linear));
        }
    }
}

/// `[α]× + [ω]× [ω]×`: maps a point of the body to its acceleration relative to the origin.
#[inline(always)]
fn spin<T: Scalar>(omega: Vec3<T>, alpha: Vec3<T>) -> Mat3<T> {
    let ([wx, wy, wz], [ax, ay, az]) = (omega.0, alpha.0);
    let (xx, yy, zz) = (wx * wx, wy * wy, wz * wz);
    let (xy, xz, yz) = (wx * wy, wx * wz, wy * wz);
    Mat3([[-(yy + zz), xy - az, xz + ay], [xy + az, -(xx + zz), yz - ax], [xz - ay, yz + ax, -(xx + yy)]])
}

/// A body's wrench as a function of its ten parameters at one motion, in the fewest values, so that they stay in
/// registers for all joints of a batch.
struct WrenchBasis<B> {
    /// Acceleration of the origin minus gravity: the force per unit of mass.
    acceleration: Vec3<B>,
    alpha: Vec3<B>,
    /// `[α]× + [ω]× [ω]×`: the force per unit of the first moment.
    spin: Mat3<B>,
    /// `ω_y ω_z, ω_x ω_z, ω_x ω_y`.
    products: Vec3<B>,
    /// `ω_y² - ω_z², ω_z² - ω_x², ω_x² - ω_y²`.
    squares: Vec3<B>,
}

impl<B: Lane> WrenchBasis<B> {
    #[inline(always)]
    fn new<T: Lane<Bundle = B>>(motion: &LinkMotion<T>) -> Self {
        let LinkMotion { omega, alpha, acceleration, spin } = motion;
        let [wx, wy, wz] = omega.0;
        // Products shared with the spin.
        let (xx, yy, zz) = (wx * wx, wy * wy, wz * wz);
        Self {
            acceleration: Vec3(bundles(acceleration.0)),
            alpha: Vec3(bundles(alpha.0)),
            spin: Mat3([bundles(spin.0[0]), bundles(spin.0[1]), bundles(spin.0[2])]),
            products: Vec3(bundles([wy * wz, wx * wz, wx * wy])),
            squares: Vec3(bundles([yy - zz, zz - xx, xx - yy])),
        }
    }

    /// Entry `AXIS` of `I α + ω × I ω` for a unit of inertia entry `ENTRY`, upper triangle by rows.
    #[inline(always)]
    fn moment<const AXIS: usize, const ENTRY: usize>(&self) -> B {
        let Self { alpha, spin: Mat3(g), products: p, squares, .. } = self;
        match (AXIS, ENTRY) {
            (0, 0) => alpha[0],
            (0, 1) => -g[2][0],
            (0, 2) => g[1][0],
            (0, 3) => -p[0],
            (0, 4) => squares[0],
            (0, _) => p[0],
            (1, 0) => p[1],
            (1, 1) => g[2][1],
            (1, 2) => squares[1],
            (1, 3) => alpha[1],
            (1, 4) => -g[0][1],
            (1, _) => -p[1],
            (_, 0) => -p[2],
            (_, 1) => squares[2],
            (_, 2) => -g[1][2],
            (_, 3) => p[2],
            (_, 4) => g[0][2],
            _ => alpha[2],
        }
    }
}

/// Power of a body's wrench on a twist, for each parameter.
pub(crate) trait Entries<B> {
    /// Power per unit of parameter `PARAMETER`.
    fn of<const PARAMETER: usize>(&self) -> B;
}

/// Power on any twist.
struct Work<'a, B> {
    wrench: &'a WrenchBasis<B>,
    angular: Vec3<B>,
    linear: Vec3<B>,
    /// h contributes the force (α× + ω×ω×) h and the moment h × a: e·(h × a) = h·(a × e); this is a × e.
    turned: Vec3<B>,
}

impl<'a, B: Lane> Work<'a, B> {
    #[inline(always)]
    fn new(wrench: &'a WrenchBasis<B>, angular: Vec3<B>, linear: Vec3<B>) -> Self {
        Self { wrench, angular, linear, turned: wrench.acceleration.cross(angular) }
    }
}

impl<B: Lane> Entries<B> for Work<'_, B> {
    #[inline(always)]
    fn of<const PARAMETER: usize>(&self) -> B {
        let Self { wrench, angular, linear, turned } = self;
        match PARAMETER {
            0 => wrench.acceleration.dot(*linear),
            1..=3 => {
                let (k, force) = (PARAMETER - 1, &wrench.spin.0);
                let addend = force[0][k].mul_add(linear[0], turned[k]);
                force[2][k].mul_add(linear[2], force[1][k].mul_add(linear[1], addend))
            }
            // The rows of `moment` times the axis, with signs folded in.
            _ => {
                let ([x, y, z], WrenchBasis { alpha, spin: Mat3(g), products: p, squares, .. }) = (angular.0, *wrench);
                match PARAMETER {
                    4 => z.neg_mul_add(p[2], y.mul_add(p[1], x * alpha[0])),
                    5 => x.neg_mul_add(g[2][0], z.mul_add(squares[2], y * g[2][1])),
                    6 => z.neg_mul_add(g[1][2], y.mul_add(squares[1], x * g[1][0])),
                    7 => x.neg_mul_add(p[0], z.mul_add(p[2], y * alpha[1])),
                    8 => y.neg_mul_add(g[0][1], z.mul_add(g[0][2], x * squares[0])),
                    _ => y.neg_mul_add(p[1], z.mul_add(alpha[2], x * p[0])),
                }
            }
        }
    }
}

/// Power on a rotation about axis `AXIS` of the body's frame.
struct OwnWork<'a, B, const AXIS: usize> {
    wrench: &'a WrenchBasis<B>,
    /// Plus or minus one.
    axis: B,
}

impl<B: Lane, const AXIS: usize> Entries<B> for OwnWork<'_, B, AXIS> {
    #[inline(always)]
    fn of<const PARAMETER: usize>(&self) -> B {
        let Self { wrench, axis } = self;
        let a = &wrench.acceleration;
        match PARAMETER {
            1..=3 if PARAMETER - 1 == (AXIS + 1) % 3 => a[(AXIS + 2) % 3] * *axis,
            1..=3 if PARAMETER - 1 == (AXIS + 2) % 3 => -(a[(AXIS + 1) % 3] * *axis),
            0..=3 => B::ZERO,
            4 => wrench.moment::<AXIS, 0>() * *axis,
            5 => wrench.moment::<AXIS, 1>() * *axis,
            6 => wrench.moment::<AXIS, 2>() * *axis,
            7 => wrench.moment::<AXIS, 3>() * *axis,
            8 => wrench.moment::<AXIS, 4>() * *axis,
            _ => wrench.moment::<AXIS, 5>() * *axis,
        }
    }
}
