//! Forward dynamics: the articulated-body algorithm.

use crate::inverse_dynamics::{inertial_wrench, outward};
use crate::workspace::{AnyScratch, CoreScratch, Workspace, take};
use dynident_lanes::{Kernel, Lane, Scalar, dispatch_single};
use dynident_model::{Mat3, Model, Transform, Vec3};

/// Joint accelerations `q̈ = M(q)⁻¹ (τ - C(q, q̇) q̇ - g(q))` of the rigid bodies, rad/s² (m/s²).
///
/// Articulated-body algorithm: Featherstone (2008), section 7.3, with the velocity terms taken from the outward recursion of the inverse
/// dynamics. Allocation-free. Where a joint moves no inertia at all (massless tip), its acceleration is undefined and comes out infinite
/// or not a number: check [`Model::bodies_without_prior`] first.
///
/// # Panics
/// If a vector's length is not the number of joints, or the workspace was made for another size.
pub fn forward_dynamics<'w>(
    model: &Model,
    workspace: &'w mut Workspace,
    q: &[f64],
    dq: &[f64],
    tau: &[f64],
) -> &'w [f64] {
    workspace.check(model, &[q, dq, tau]);
    let Workspace { level, scratch, vector, .. } = workspace;
    dispatch_single(*level, Single { model, scratch, q, dq, tau, ddq: vector });
    vector
}

struct Single<'a> {
    model: &'a Model,
    scratch: &'a mut AnyScratch,
    q: &'a [f64],
    dq: &'a [f64],
    tau: &'a [f64],
    ddq: &'a mut [f64],
}

impl Kernel for Single<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self) {
        let scratch = &mut self.scratch.of::<T>().core;
        take(&mut scratch.q, self.q);
        take(&mut scratch.dq, self.dq);
        take(&mut scratch.tau, self.tau);
        articulated_bodies(self.model, scratch);
        for (to, from) in self.ddq.iter_mut().zip(&scratch.ddq) {
            *to = from.lane(0);
        }
    }
}

/// Articulated-body inertia of a subtree about its root's frame: `moment = rotation α + coupling a`, `force = couplingᵀ α + mass a`; and what
/// its joint needs of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Articulated<T> {
    /// Symmetric; upper triangle by rows.
    rotation: [T; 6],
    coupling: Mat3<T>,
    /// Symmetric; upper triangle by rows.
    mass: [T; 6],
    /// Column of the articulated inertia along the joint: (moment, force).
    column: (Vec3<T>, Vec3<T>),
    inverse_inertia: T,
    rest_torque: T,
}

impl<T: Scalar> Articulated<T> {
    pub(crate) const ZERO: Self = Self {
        rotation: [T::ZERO; 6],
        coupling: Mat3::ZERO,
        mass: [T::ZERO; 6],
        column: (Vec3::ZERO, Vec3::ZERO),
        inverse_inertia: T::ZERO,
        rest_torque: T::ZERO,
    };
}

#[inline(always)]
fn full<T: Scalar>(s: &[T; 6]) -> Mat3<T> {
    Mat3([[s[0], s[1], s[2]], [s[1], s[3], s[4]], [s[2], s[4], s[5]]])
}

/// Upper triangle of `M - v vᵀ · factor`.
#[inline(always)]
fn less_outer<T: Scalar>(m: &[T; 6], v: Vec3<T>, factor: T) -> [T; 6] {
    let w = v.scale(factor);
    [
        v[0].neg_mul_add(w[0], m[0]),
        v[0].neg_mul_add(w[1], m[1]),
        v[0].neg_mul_add(w[2], m[2]),
        v[1].neg_mul_add(w[1], m[3]),
        v[1].neg_mul_add(w[2], m[4]),
        v[2].neg_mul_add(w[2], m[5]),
    ]
}

/// Upper triangle of `R S Rᵀ`, S symmetric.
#[inline(always)]
fn rotated<T: Scalar>(r: &Mat3<T>, s: &[T; 6]) -> [T; 6] {
    let rows = r.mul_mat(&full(s)).0;
    let entry =
        |a: usize, b: usize| rows[a][2].mul_add(r.0[b][2], rows[a][1].mul_add(r.0[b][1], rows[a][0] * r.0[b][0]));
    [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)]
}

/// From `q`, `dq`, `tau` of the scratch to its `ddq`.
#[inline(always)]
pub(crate) fn articulated_bodies<T: Scalar>(model: &Model, scratch: &mut CoreScratch<T>) {
    let maps = model.maps();
    scratch.place(maps);
    // With q̈ = 0 the outward recursion gives every body's velocity-dependent and gravity acceleration; the wrench that goes with it is the
    // bias. What is left is linear in the joint accelerations alone.
    scratch.ddq.fill(T::ZERO);
    outward(model, scratch);
    for ((body, articulated), inertial) in
        scratch.bodies.iter_mut().zip(&mut scratch.articulated).zip(model.inertials())
    {
        (body.force, body.moment) = inertial_wrench(inertial, body.omega, body.alpha, body.acceleration);
        let p = inertial.0.map(T::splat);
        articulated.rotation = [p[4], p[5], p[6], p[7], p[8], p[9]];
        articulated.coupling = Mat3::skew(Vec3([p[1], p[2], p[3]]));
        articulated.mass = [p[0], T::ZERO, T::ZERO, p[0], T::ZERO, p[0]];
    }
    for index in (0..maps.len()).rev() {
        let map = &maps[index];
        let axis = map.axis.splat::<T>();
        let body = scratch.bodies[index];
        let own = &mut scratch.articulated[index];
        let column = if map.turns {
            (full(&own.rotation).mul_vec(axis), own.coupling.transpose_mul_vec(axis))
        } else {
            (own.coupling.mul_vec(axis), full(&own.mass).mul_vec(axis))
        };
        let along = |moment: Vec3<T>, force: Vec3<T>| axis.dot(if map.turns { moment } else { force });
        own.column = column;
        own.inverse_inertia = along(column.0, column.1).recip();
        own.rest_torque = scratch.tau[index] - along(body.moment, body.force);
        let Some(parent) = map.parent else { continue };
        // What the parent feels: the inertia that the joint cannot follow freely, and the bias with the joint torque's share.
        let share = own.rest_torque * own.inverse_inertia;
        let moment = column.0.scale_add(share, body.moment);
        let force = column.1.scale_add(share, body.force);
        let rotation = less_outer(&own.rotation, column.0, own.inverse_inertia);
        let mass = less_outer(&own.mass, column.1, own.inverse_inertia);
        let scaled = column.0.scale(own.inverse_inertia);
        let coupling = Mat3(core::array::from_fn(|i| {
            core::array::from_fn(|j| scaled[i].neg_mul_add(column.1[j], own.coupling.0[i][j]))
        }));
        let Transform { rotation: r, translation: t } = body.parent_from_body;
        let force = r.mul_vec(force);
        let parent_body = &mut scratch.bodies[parent];
        parent_body.force += force;
        parent_body.moment = r.mul_vec_add(moment, t.cross_add(force, parent_body.moment));
        // Move to the parent's axes, then to its origin: with T = [t]× the blocks become
        // M' = M, H' = H + T M, J' = J + T Hᵀ + H Tᵀ + T M Tᵀ = J + T Hᵀ - H' T (T is skew).
        let j = rotated(&r, &rotation);
        let m = rotated(&r, &mass);
        let h = r.mul_mat(&coupling).mul_mat(&r.transpose());
        let m_full = full(&m);
        let cross_rows = |matrix: &Mat3<T>| {
            // T M column by column: t × column.
            let columns: [Vec3<T>; 3] =
                core::array::from_fn(|c| t.cross(Vec3([matrix.0[0][c], matrix.0[1][c], matrix.0[2][c]])));
            Mat3(core::array::from_fn(|i| core::array::from_fn(|c| columns[c][i])))
        };
        let h_new = h + cross_rows(&m_full);
        let left = cross_rows(&h.transpose());
        // H' T row by row: (row)ᵀ T = -(t × row)ᵀ, so - H' T has rows t × row.
        let right: [Vec3<T>; 3] = core::array::from_fn(|i| t.cross(Vec3(h_new.0[i])));
        let parent_inertia = &mut scratch.articulated[parent];
        let pairs = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
        for (k, (a, b)) in pairs.into_iter().enumerate() {
            parent_inertia.rotation[k] += j[k] + left.0[a][b] + right[a][b];
            parent_inertia.mass[k] += m[k];
        }
        parent_inertia.coupling = parent_inertia.coupling + h_new;
    }
    // Outward again, with what the joint accelerations add to each body's acceleration.
    for index in 0..maps.len() {
        let map = &maps[index];
        let axis = map.axis.splat::<T>();
        let Transform { rotation, translation } = scratch.bodies[index].parent_from_body;
        let (alpha, acceleration) = map.parent.map_or((Vec3::ZERO, Vec3::ZERO), |parent| {
            let parent = &scratch.bodies[parent];
            (
                rotation.transpose_mul_vec(parent.alpha),
                rotation.transpose_mul_vec(parent.alpha.cross_add(translation, parent.acceleration)),
            )
        });
        let own = &scratch.articulated[index];
        let pull = own.column.0.dot(alpha) + own.column.1.dot(acceleration);
        let ddq = (own.rest_torque - pull) * own.inverse_inertia;
        scratch.ddq[index] = ddq;
        // From here on alpha and acceleration of the bodies hold only what the joint accelerations cause.
        let body = &mut scratch.bodies[index];
        if map.turns {
            body.alpha = axis.scale_add(ddq, alpha);
            body.acceleration = acceleration;
        } else {
            body.alpha = alpha;
            body.acceleration = axis.scale_add(ddq, acceleration);
        }
    }
}
