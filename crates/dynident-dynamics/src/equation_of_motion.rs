//! The equation of motion at one state, for simulation: mass matrix and bias torque together.
//!
//! Bias: recursive Newton-Euler without joint accelerations (Featherstone 2008, section 5.3). Matrix: composite rigid
//! bodies (section 6.2). Both go over the model's inner frames ([`JointStep`]), by the steps that
//! [`inverse_dynamics`](crate::inverse_dynamics()) and [`mass_matrix`](crate::mass_matrix()) explain.
//!
//! One robot ([`crate::mass_matrix_and_bias`]) and many side by side ([`crate::RobotLanes`]) run this same code, so that
//! their numbers are the same to the last bit.

use crate::columns::ColumnScratch;
use crate::hinge::{BundledHinges, Hinge, Hinges, PlacedHinges, with_hinge};
use dynident_lanes::Lane;
use dynident_model::{JointStep, Mat3, Model, Vec3};

/// Where the inertial numbers of the steps' bodies come from.
pub(crate) trait Bodies<T: Lane>: Copy {
    /// See [`JointStep::mass`].
    fn mass(self, index: usize) -> T;
    /// See [`JointStep::first`].
    fn first(self, index: usize) -> Vec3<T>;
    /// See [`JointStep::second`].
    fn second(self, index: usize) -> [T; 6];
    /// See [`JointStep::subtree_mass`].
    fn subtree_mass(self, index: usize) -> T;
}

/// All lanes hold the bodies of one model.
impl<T: Lane> Bodies<T> for &[JointStep] {
    #[inline(always)]
    fn mass(self, index: usize) -> T {
        T::splat(self[index].mass)
    }
    #[inline(always)]
    fn first(self, index: usize) -> Vec3<T> {
        self[index].first.splat()
    }
    #[inline(always)]
    fn second(self, index: usize) -> [T; 6] {
        self[index].second.map(T::splat)
    }
    #[inline(always)]
    fn subtree_mass(self, index: usize) -> T {
        T::splat(self[index].subtree_mass)
    }
}

/// Force, and moment about the frame's origin.
type Wrench<T> = (Vec3<T>, Vec3<T>);
/// First moment, and upper triangle by rows of the second moment.
type Moments<T> = (Vec3<T>, [T; 6]);

/// Scratch of an evaluation, for one tree.
#[derive(Debug)]
pub(crate) struct EquationScratch<T: Lane> {
    hinges: Hinges<T>,
    /// Of bodies on which others than the next one hang.
    motions: Vec<Motion<T>>,
    /// Force and moment that each body needs, with all that hangs on it.
    wrenches: Vec<Wrench<T>>,
    /// First and second moments of bodies on which others than the next one hang, with all that hangs on them.
    moments: Vec<Moments<T>>,
    pub(crate) columns: ColumnScratch<T>,
    links: Vec<Link>,
}

/// How a body hangs in the tree.
#[derive(Clone, Copy, Debug)]
struct Link {
    /// On the body before it: what goes from one to the other stays in registers.
    follows: bool,
    /// Others than the next one hang on it.
    branches: bool,
}

/// How a body moves, in its inner frame.
#[derive(Clone, Copy, Debug)]
struct Motion<T> {
    omega: Vec3<T>,
    alpha: Vec3<T>,
    /// Of the frame's origin, minus gravity.
    acceleration: Vec3<T>,
    /// `[α]× + [ω]× [ω]×`.
    spin: Mat3<T>,
}

impl<T: Lane> EquationScratch<T> {
    pub(crate) fn new(model: &Model) -> Self {
        let (steps, joints) = (model.steps(), model.steps().len());
        let link = |index: usize| Link {
            follows: index > 0 && steps[index].parent == Some(index - 1),
            branches: steps.iter().skip(index + 2).any(|step| step.parent == Some(index)),
        };
        let rest = Motion { omega: Vec3::ZERO, alpha: Vec3::ZERO, acceleration: Vec3::ZERO, spin: Mat3::ZERO };
        Self {
            hinges: Hinges::new(joints),
            motions: vec![rest; joints],
            wrenches: vec![(Vec3::ZERO, Vec3::ZERO); joints],
            moments: vec![(Vec3::ZERO, [T::ZERO; 6]); joints],
            columns: ColumnScratch::new(model),
            links: (0..joints).map(link).collect(),
        }
    }

    /// Whether no two joints are on different branches: every entry of the mass matrix is then written.
    pub(crate) fn is_chain(&self) -> bool {
        self.links.iter().skip(1).all(|link| link.follows)
    }
}

/// The bias torques at `q` and `dq` into `bias`, and the entries of the mass matrix into the rows of `scratch.columns`.
/// `base` is the base's acceleration: minus gravity.
#[inline(always)]
pub(crate) fn equation_of_motion<T: Lane, B: Bodies<T>>(
    (steps, bodies, base): (&[JointStep], B, Vec3<T>),
    scratch: &mut EquationScratch<T>,
    (q, dq): (&[T], &[T]),
    bias: &mut [T],
) {
    let joints = steps.len();
    let EquationScratch { hinges, motions, wrenches, moments, columns, links } = scratch;
    hinges.place(steps, q);
    let hinges = hinges.placed(joints);
    let (dq, bias, links) = (&dq[..joints], &mut bias[..joints], &links[..joints]);
    let (motions, wrenches, moments) = (&mut motions[..joints], &mut wrenches[..joints], &mut moments[..joints]);
    newton_euler((steps, bodies, base), links, hinges, (motions, wrenches), dq, bias);
    if T::PER_BUNDLE > 1 {
        columns.force.fill(Vec3::ZERO);
        columns.moment.fill(Vec3::ZERO);
    }
    let mut next = (Vec3::ZERO, [T::ZERO; 6]);
    for index in (0..joints).rev() {
        let step = &steps[index];
        let (h, s) = if links.get(index + 1).is_some_and(|link| link.follows) {
            next
        } else if step.is_tip {
            (bodies.first(index), bodies.second(index))
        } else {
            moments[index]
        };
        if T::PER_BUNDLE == 1 {
            column_to_base(steps, bodies, hinges, (&h, &s), columns, index);
        } else {
            columns_inward(step, bodies, hinges, (&h, &s), columns, index);
        }
        let Some(parent) = step.parent else { continue };
        let (h, s) = with_hinge!(hinges, *step, index, |hinge| (hinge.up(h), hinge.up_symmetric(&s)));
        // A body takes its own moments when the first of its children comes.
        let mut sum = if step.is_last_child { (bodies.first(parent), bodies.second(parent)) } else { moments[parent] };
        add(&mut sum, h, &s, bodies.subtree_mass(index), hinges.translation(step, index));
        if links[index].follows {
            next = sum;
        } else {
            moments[parent] = sum;
        }
    }
}

/// The bias torques: outward the motion, inward the wrenches.
#[inline(always)]
fn newton_euler<T: Lane, B: Bodies<T>>(
    (steps, bodies, base): (&[JointStep], B, Vec3<T>),
    links: &[Link],
    hinges: PlacedHinges<'_, T>,
    (motions, wrenches): (&mut [Motion<T>], &mut [Wrench<T>]),
    dq: &[T],
    bias: &mut [T],
) {
    let base = Motion { omega: Vec3::ZERO, alpha: Vec3::ZERO, acceleration: base, spin: Mat3::ZERO };
    let mut motion = base;
    for (index, step) in steps.iter().enumerate() {
        if !links[index].follows {
            motion = step.parent.map_or(base, |parent| motions[parent]);
        }
        let origin = motion.spin.mul_vec(hinges.translation(step, index)) + motion.acceleration;
        let arriving = with_hinge!(hinges, *step, index, |hinge| {
            [hinge.down(motion.omega), hinge.down(motion.alpha), hinge.down(origin)]
        });
        motion = moved(step.turns, arriving, dq[index]);
        wrenches[index] = wrench(step.turns, bodies, index, &motion);
        if links[index].branches {
            motions[index] = motion;
        }
    }
    let mut next = (Vec3::ZERO, Vec3::ZERO);
    for (index, step) in steps.iter().enumerate().rev() {
        let (force, moment) =
            if links.get(index + 1).is_some_and(|link| link.follows) { next } else { wrenches[index] };
        bias[index] = if step.turns { moment[2] } else { force[2] };
        let Some(parent) = step.parent else { continue };
        let (force, moment) = with_hinge!(hinges, *step, index, |hinge| (hinge.up(force), hinge.up(moment)));
        let own = wrenches[parent];
        let sum = (own.0 + force, hinges.translation(step, index).cross_add(force, own.1) + moment);
        if links[index].follows {
            next = sum;
        } else {
            wrenches[parent] = sum;
        }
    }
}

/// One step outward without joint acceleration, from angular velocity, angular acceleration and acceleration that arrive
/// from the parent.
#[inline(always)]
fn moved<T: Lane>(turns: bool, arriving: [Vec3<T>; 3], dq: T) -> Motion<T> {
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
    Motion { omega, alpha, acceleration, spin }
}

/// `f = m a + Γ h` and, about the frame's origin, `n = h × a + ∫ x × Γ x dm`.
#[inline(always)]
fn wrench<T: Lane, B: Bodies<T>>(turns: bool, bodies: B, index: usize, motion: &Motion<T>) -> Wrench<T> {
    let g = &motion.spin.0;
    let [ax, ay, az] = motion.acceleration.0;
    let [hx, hy, hz] = bodies.first(index).0;
    let [xx, xy, xz, yy, yz, zz] = bodies.second(index);
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
        f = motion.acceleration.scale_add(bodies.mass(index), along.scale_add(hz, f));
        n.0[0] = g[1][2].neg_mul_add(zz, hz.neg_mul_add(ay, n[0]));
        n.0[1] = g[0][2].mul_add(zz, hz.mul_add(ax, n[1]));
    }
    (f, n)
}

/// Where lanes are samples: a column goes all the way to the base in registers.
#[inline(always)]
fn column_to_base<T: Lane, B: Bodies<T>>(
    steps: &[JointStep],
    bodies: B,
    hinges: PlacedHinges<'_, T>,
    (h, s): (&Vec3<T>, &[T; 6]),
    columns: &mut ColumnScratch<T>,
    index: usize,
) {
    let (bundles, lanes) = (columns.force.len(), <T::Bundle as Lane>::LANES);
    let (own, _) = columns.place[index];
    let (mut f, mut n) = if steps[index].turns {
        (Vec3([-h[1], h[0], T::ZERO]), Vec3([-s[2], -s[4], s[0] + s[3]]))
    } else {
        (Vec3([T::ZERO, T::ZERO, bodies.subtree_mass(index)]), Vec3([h[1], -h[0], T::ZERO]))
    };
    let mut at = index;
    loop {
        let work = if steps[at].turns { n[2] } else { f[2] };
        work.store(&mut columns.rows[(at * bundles + own) * lanes..]);
        let Some(parent) = steps[at].parent else { break };
        (f, n) = with_hinge!(hinges, steps[at], at, |hinge| (hinge.up(f), hinge.up(n)));
        n = hinges.translation(&steps[at], at).cross_add(f, n);
        at = parent;
    }
}

/// Where a lane is a joint: the columns of the whole subtree take one step inward, several in a bundle.
#[inline(always)]
fn columns_inward<T: Lane, B: Bodies<T>>(
    step: &JointStep,
    bodies: B,
    hinges: PlacedHinges<'_, T>,
    (h, s): (&Vec3<T>, &[T; 6]),
    columns: &mut ColumnScratch<T>,
    index: usize,
) {
    let lanes = <T::Bundle as Lane>::LANES;
    let ColumnScratch { place, end, force, moment, rows, .. } = columns;
    let bundles = force.len();
    let (own, lane) = place[index];
    let (f, n) = (&mut force[own].0, &mut moment[own].0);
    if step.turns {
        (-h[1]).add_at(&mut f[0], lane);
        h[0].add_at(&mut f[1], lane);
        (-s[2]).add_at(&mut n[0], lane);
        (-s[4]).add_at(&mut n[1], lane);
        (s[0] + s[3]).add_at(&mut n[2], lane);
    } else {
        bodies.subtree_mass(index).add_at(&mut f[2], lane);
        h[1].add_at(&mut n[0], lane);
        (-h[0]).add_at(&mut n[1], lane);
    }
    let (force, moment) = (&mut force[own..end[index]], &mut moment[own..end[index]]);
    let row = rows[(index * bundles + own) * lanes..].chunks_exact_mut(lanes);
    for (column, to) in (if step.turns { &*moment } else { &*force }).iter().zip(row) {
        column[2].store(to);
    }
    if step.parent.is_some() {
        let bundled = BundledHinges(hinges);
        let translation = bundled.translation(step, index);
        with_hinge!(bundled, *step, index, |hinge| {
            for (f, n) in force.iter_mut().zip(moment) {
                *f = hinge.up(*f);
                *n = translation.cross_add(*f, hinge.up(*n));
            }
        });
    }
}

/// Adds moments `(m, h, Σ)` about the point `t` to moments `(h, Σ)` about the origin: `h + m t` and, with `g = h + m
/// t/2`, `Σ + t gᵀ + g tᵀ`.
#[inline(always)]
fn add<T: Lane>(sum: &mut Moments<T>, h: Vec3<T>, s: &[T; 6], mass: T, t: Vec3<T>) {
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
