//! Spatial quantities in the base frame only: axes, velocities and accelerations are twists at the base's origin, and
//! the inertia of a subtree is the sum of its bodies' inertias.
//!
//! Twists and wrenches are spatial vectors at one point in one frame, angular part first (Featherstone 2008, chapter
//! 2), so no change of frame is needed. Inertia is stored as mass `m`, first moment `h = ∫ x dm` and second moment `Σ
//! = ∫ x xᵀ dm` (the inertia tensor is `tr(Σ) 1 - Σ`; Wensing, Kim and Slotine, *Linear matrix inequalities for
//! physically consistent inertial parameter identification*, RA-L 2018, section III).

use crate::hinge::symmetric;
use dynident_lanes::Scalar;
use dynident_model::{JointStep, Mat3, Transform, Vec3};

/// A twist (angular, linear) or a wrench (moment, force) at the base's origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spatial<T> {
    pub(crate) angular: Vec3<T>,
    pub(crate) linear: Vec3<T>,
}

impl<T: Scalar> Spatial<T> {
    pub(crate) const ZERO: Self = Self { angular: Vec3::ZERO, linear: Vec3::ZERO };

    /// A joint's axis as a twist: `direction` in the base frame, through `point` for a revolute joint.
    #[inline(always)]
    pub(crate) fn axis(is_rotary: bool, direction: Vec3<T>, point: Vec3<T>) -> Self {
        if is_rotary {
            Self { angular: direction, linear: point.cross(direction) }
        } else {
            Self { angular: Vec3::ZERO, linear: direction }
        }
    }

    /// Power of a wrench on a twist.
    #[inline(always)]
    pub(crate) fn dot(&self, other: &Self) -> T {
        let (a, b) = (self.angular.0, other.angular.0);
        let (c, d) = (self.linear.0, other.linear.0);
        let angular = a[2].mul_add(b[2], a[1].mul_add(b[1], a[0] * b[0]));
        c[2].mul_add(d[2], c[1].mul_add(d[1], c[0].mul_add(d[0], angular)))
    }

    #[inline(always)]
    pub(crate) fn scale_add(&self, factor: T, addend: &Self) -> Self {
        Self {
            angular: self.angular.scale_add(factor, addend.angular),
            linear: self.linear.scale_add(factor, addend.linear),
        }
    }

    /// The twist `self × other`.
    #[inline(always)]
    pub(crate) fn cross(&self, other: &Self) -> Self {
        Self {
            angular: self.angular.cross(other.angular),
            linear: self.angular.cross_add(other.linear, self.linear.cross(other.angular)),
        }
    }

    /// The twist `self × other + addend`.
    #[inline(always)]
    pub(crate) fn cross_add(&self, other: &Self, addend: &Self) -> Self {
        Self {
            angular: self.angular.cross_add(other.angular, addend.angular),
            linear: self.angular.cross_add(other.linear, self.linear.cross_add(other.angular, addend.linear)),
        }
    }

    /// The wrench `self ×* wrench + addend`.
    #[inline(always)]
    pub(crate) fn cross_dual_add(&self, wrench: &Self, addend: &Self) -> Self {
        Self {
            angular: self.angular.cross_add(wrench.angular, self.linear.cross_add(wrench.linear, addend.angular)),
            linear: self.angular.cross_add(wrench.linear, addend.linear),
        }
    }
}

impl<T: Scalar> core::ops::AddAssign for Spatial<T> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        self.angular += other.angular;
        self.linear += other.linear;
    }
}

/// Mass moments of a body or subtree about the base's origin, in the base frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MassMoments<T> {
    pub(crate) mass: T,
    /// `h = ∫ x dm`.
    pub(crate) first: Vec3<T>,
    /// Upper triangle of `Σ = ∫ x xᵀ dm` by rows: xx, xy, xz, yy, yz, zz.
    pub(crate) second: [T; 6],
}

impl<T: Scalar> MassMoments<T> {
    pub(crate) const ZERO: Self = Self { mass: T::ZERO, first: Vec3::ZERO, second: [T::ZERO; 6] };

    /// Moments of a body whose inner frame is at `placement`.
    #[inline(always)]
    pub(crate) fn of(step: &JointStep, placement: &Transform<T>) -> Self {
        let Transform { rotation, translation: t } = placement;
        let rows = rotation.mul_mat(&symmetric(&step.second.map(T::splat))).0;
        let r = &rotation.0;
        let first = rotation.mul_vec(step.first.splat());
        if step.mass == 0.0 {
            Self { mass: T::ZERO, first, second: carried(&rows, r, *t, first) }
        } else {
            let mass = T::splat(step.mass);
            let g = t.scale_add(mass * T::splat(0.5), first);
            Self { mass, first: t.scale_add(mass, first), second: carried(&rows, r, *t, g) }
        }
    }

    /// The wrench `I w` of a twist: `n = (tr(Σ) 1 - Σ) w₁ + h × w₂`, `f = m w₂ + w₁ × h`.
    #[inline(always)]
    pub(crate) fn times(&self, twist: &Spatial<T>) -> Spatial<T> {
        self.times_add(twist, &Spatial::ZERO)
    }

    #[inline(always)]
    pub(crate) fn times_add(&self, twist: &Spatial<T>, addend: &Spatial<T>) -> Spatial<T> {
        let s = &self.second;
        let [x, y, z] = twist.angular.0;
        let (xx, yy, zz) = (s[3] + s[5], s[0] + s[5], s[0] + s[3]);
        let n = self.first.cross_add(twist.linear, addend.angular).0;
        let moment = Vec3([
            s[2].neg_mul_add(z, s[1].neg_mul_add(y, xx.mul_add(x, n[0]))),
            s[4].neg_mul_add(z, s[1].neg_mul_add(x, yy.mul_add(y, n[1]))),
            s[4].neg_mul_add(y, s[2].neg_mul_add(x, zz.mul_add(z, n[2]))),
        ]);
        let force = twist.angular.cross_add(self.first, twist.linear.scale_add(self.mass, addend.linear));
        Spatial { angular: moment, linear: force }
    }
}

impl<T: Scalar> core::ops::AddAssign for MassMoments<T> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        self.mass += other.mass;
        self.first += other.first;
        for (to, from) in self.second.iter_mut().zip(other.second) {
            *to += from;
        }
    }
}

/// Rates of the mass moments at the bodies' velocities: momentum `p = ∫ ẋ dm` and `G = ∫ ẋ xᵀ dm`. They give the
/// Coriolis matrix of Singh, Russell and Wensing (2022): see [`coriolis_add`](MomentRates::coriolis_add).
#[derive(Clone, Copy, Debug)]
pub(crate) struct MomentRates<T> {
    pub(crate) momentum: Vec3<T>,
    pub(crate) second: Mat3<T>,
}

impl<T: Scalar> MomentRates<T> {
    pub(crate) const ZERO: Self = Self { momentum: Vec3::ZERO, second: Mat3::ZERO };

    /// Rates of a body at velocity `(ω, u)`: `p = m u + ω × h`, `G = [ω]× Σ + u hᵀ`.
    #[inline(always)]
    pub(crate) fn of(moments: &MassMoments<T>, velocity: &Spatial<T>) -> Self {
        let Spatial { angular: w, linear: u } = *velocity;
        let (h, s) = (moments.first, symmetric(&moments.second).0);
        let a = w.cross_add(Vec3(s[0]), u.scale(h[0]));
        let b = w.cross_add(Vec3(s[1]), u.scale(h[1]));
        let c = w.cross_add(Vec3(s[2]), u.scale(h[2]));
        Self {
            momentum: w.cross_add(h, u.scale(moments.mass)),
            second: Mat3([[a[0], b[0], c[0]], [a[1], b[1], c[1]], [a[2], b[2], c[2]]]),
        }
    }

    /// The spatial momentum `I v`; its angular part `∫ x × ẋ dm` follows from G.
    #[inline(always)]
    pub(crate) fn spatial_momentum(&self) -> Spatial<T> {
        let g = &self.second.0;
        Spatial { angular: Vec3([g[2][1] - g[1][2], g[0][2] - g[2][0], g[1][0] - g[0][1]]), linear: self.momentum }
    }

    /// `B w + addend` for the twist's angular part, with `B = ½ ((v ×*) I - I (v ×) + (I v) ×̄*) = [tr(G) 1 - G, 0;
    /// -[p]×, 0]`.
    #[inline(always)]
    pub(crate) fn coriolis_add(&self, angular: Vec3<T>, addend: &Spatial<T>) -> Spatial<T> {
        let g = &self.second.0;
        let trace = g[0][0] + g[1][1] + g[2][2];
        let row = |k: usize| {
            let diagonal = angular[k].mul_add(trace, addend.angular[k]);
            g[k][2].neg_mul_add(angular[2], g[k][1].neg_mul_add(angular[1], g[k][0].neg_mul_add(angular[0], diagonal)))
        };
        Spatial { angular: Vec3([row(0), row(1), row(2)]), linear: angular.cross_add(self.momentum, addend.linear) }
    }

    /// Angular part of `Bᵀ y` (the linear part is zero): `(tr(G) 1 - Gᵀ) y₁ + p × y₂`.
    #[inline(always)]
    pub(crate) fn coriolis_transposed(&self, twist: &Spatial<T>) -> Vec3<T> {
        let g = &self.second.0;
        let trace = g[0][0] + g[1][1] + g[2][2];
        let y = twist.angular;
        let sum = y.scale_add(trace, self.momentum.cross(twist.linear));
        let row = |k: usize| g[2][k].neg_mul_add(y[2], g[1][k].neg_mul_add(y[1], g[0][k].neg_mul_add(y[0], sum[k])));
        Vec3([row(0), row(1), row(2)])
    }
}

impl<T: Scalar> core::ops::AddAssign for MomentRates<T> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        self.momentum += other.momentum;
        self.second = self.second + other.second;
    }
}

/// `R Σ Rᵀ + t gᵀ + g tᵀ`, upper triangle, from the rows of `R Σ`: with `g = h + m t/2` the second moment about
/// another point. A function, because a closure would not be compiled for the processor level.
#[inline(always)]
fn carried<T: Scalar>(rows: &[[T; 3]; 3], r: &[[T; 3]; 3], t: Vec3<T>, g: Vec3<T>) -> [T; 6] {
    macro_rules! entry {
        ($a:literal, $b:literal) => {{
            let shift = t[$a].mul_add(g[$b], g[$a] * t[$b]);
            let (row, column) = (&rows[$a], &r[$b]);
            row[2].mul_add(column[2], row[1].mul_add(column[1], row[0].mul_add(column[0], shift)))
        }};
    }
    [entry!(0, 0), entry!(0, 1), entry!(0, 2), entry!(1, 1), entry!(1, 2), entry!(2, 2)]
}
