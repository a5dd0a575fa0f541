//! Vectors, rotations and rigid transforms over any [`Scalar`].

use core::ops::{Add, AddAssign, Index, IndexMut, Neg, Sub};
use dynident_lanes::Scalar;

/// A vector of three components.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vec3<T = f64>(pub [T; 3]);

impl<T: Scalar> Vec3<T> {
    /// The zero vector.
    pub const ZERO: Self = Self([T::ZERO; 3]);

    /// The vector `(x, y, z)`.
    #[inline(always)]
    pub fn new(x: T, y: T, z: T) -> Self {
        Self([x, y, z])
    }

    /// `self · other`.
    #[inline(always)]
    pub fn dot(self, other: Self) -> T {
        let (a, b) = (self.0, other.0);
        a[2].mul_add(b[2], a[1].mul_add(b[1], a[0] * b[0]))
    }

    /// `self × other`.
    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        let (a, b) = (self.0, other.0);
        Self([
            a[1].mul_add(b[2], -(a[2] * b[1])),
            a[2].mul_add(b[0], -(a[0] * b[2])),
            a[0].mul_add(b[1], -(a[1] * b[0])),
        ])
    }

    /// `self · factor`.
    #[inline(always)]
    pub fn scale(self, factor: T) -> Self {
        Self([self.0[0] * factor, self.0[1] * factor, self.0[2] * factor])
    }

    /// `self · factor + addend`.
    #[inline(always)]
    pub fn scale_add(self, factor: T, addend: Self) -> Self {
        Self([
            self.0[0].mul_add(factor, addend.0[0]),
            self.0[1].mul_add(factor, addend.0[1]),
            self.0[2].mul_add(factor, addend.0[2]),
        ])
    }

    /// `self × other + addend`.
    #[inline(always)]
    pub fn cross_add(self, other: Self, addend: Self) -> Self {
        let (a, b, c) = (self.0, other.0, addend.0);
        Self([
            a[1].mul_add(b[2], a[2].neg_mul_add(b[1], c[0])),
            a[2].mul_add(b[0], a[0].neg_mul_add(b[2], c[1])),
            a[0].mul_add(b[1], a[1].neg_mul_add(b[0], c[2])),
        ])
    }
}

impl Vec3<f64> {
    /// The Euclidean norm.
    pub fn norm(self) -> f64 {
        self.dot(self).sqrt()
    }

    /// The same vector, with constants of another scalar type.
    #[inline(always)]
    pub fn splat<T: Scalar>(self) -> Vec3<T> {
        Vec3([T::splat(self.0[0]), T::splat(self.0[1]), T::splat(self.0[2])])
    }
}

impl<T: Scalar> Add for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self([self.0[0] + other.0[0], self.0[1] + other.0[1], self.0[2] + other.0[2]])
    }
}
impl<T: Scalar> AddAssign for Vec3<T> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}
impl<T: Scalar> Sub for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self([self.0[0] - other.0[0], self.0[1] - other.0[1], self.0[2] - other.0[2]])
    }
}
impl<T: Scalar> Neg for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self([-self.0[0], -self.0[1], -self.0[2]])
    }
}
impl<T> Index<usize> for Vec3<T> {
    type Output = T;
    #[inline(always)]
    fn index(&self, index: usize) -> &T {
        &self.0[index]
    }
}
impl<T> IndexMut<usize> for Vec3<T> {
    #[inline(always)]
    fn index_mut(&mut self, index: usize) -> &mut T {
        &mut self.0[index]
    }
}

/// Explicit entries keep the matrix in registers; `array::from_fn` does not on wide lanes.
macro_rules! by_entry {
    ($entry:expr) => {{
        let entry = $entry;
        [
            [entry(0, 0), entry(0, 1), entry(0, 2)],
            [entry(1, 0), entry(1, 1), entry(1, 2)],
            [entry(2, 0), entry(2, 1), entry(2, 2)],
        ]
    }};
}

/// A 3 × 3 matrix, by rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mat3<T = f64>(pub [[T; 3]; 3]);

impl<T: Scalar> Mat3<T> {
    /// The zero matrix.
    pub const ZERO: Self = Self([[T::ZERO; 3]; 3]);

    /// The identity.
    pub const IDENTITY: Self =
        Self([[T::ONE, T::ZERO, T::ZERO], [T::ZERO, T::ONE, T::ZERO], [T::ZERO, T::ZERO, T::ONE]]);

    /// `M v`.
    #[inline(always)]
    pub fn mul_vec(&self, v: Vec3<T>) -> Vec3<T> {
        let m = &self.0;
        Vec3(core::array::from_fn(|i| m[i][2].mul_add(v.0[2], m[i][1].mul_add(v.0[1], m[i][0] * v.0[0]))))
    }

    /// `M v + addend`.
    #[inline(always)]
    pub fn mul_vec_add(&self, v: Vec3<T>, addend: Vec3<T>) -> Vec3<T> {
        let m = &self.0;
        let entry = |i: usize| m[i][2].mul_add(v.0[2], m[i][1].mul_add(v.0[1], m[i][0].mul_add(v.0[0], addend.0[i])));
        Vec3([entry(0), entry(1), entry(2)])
    }

    /// `Mᵀ v`.
    #[inline(always)]
    pub fn transpose_mul_vec(&self, v: Vec3<T>) -> Vec3<T> {
        let m = &self.0;
        Vec3(core::array::from_fn(|i| m[2][i].mul_add(v.0[2], m[1][i].mul_add(v.0[1], m[0][i] * v.0[0]))))
    }

    /// `M N`.
    #[inline(always)]
    pub fn mul_mat(&self, other: &Self) -> Self {
        let (a, b) = (&self.0, &other.0);
        let entry = |i: usize, j: usize| a[i][2].mul_add(b[2][j], a[i][1].mul_add(b[1][j], a[i][0] * b[0][j]));
        Self(by_entry!(entry))
    }

    /// `Mᵀ`.
    #[inline(always)]
    pub fn transpose(&self) -> Self {
        let m = &self.0;
        Self(by_entry!(|i: usize, j: usize| m[j][i]))
    }

    /// `[v]×`, the matrix with `[v]× w = v × w`.
    #[inline(always)]
    pub fn skew(v: Vec3<T>) -> Self {
        let [x, y, z] = v.0;
        Self([[T::ZERO, -z, y], [z, T::ZERO, -x], [-y, x, T::ZERO]])
    }

    /// `v wᵀ`.
    #[inline(always)]
    pub fn outer(v: Vec3<T>, w: Vec3<T>) -> Self {
        Self(by_entry!(|i: usize, j: usize| v.0[i] * w.0[j]))
    }

    /// `M · factor`.
    #[inline(always)]
    pub fn scale(&self, factor: T) -> Self {
        Self(by_entry!(|i: usize, j: usize| self.0[i][j] * factor))
    }
}

impl<T: Scalar> Add for Mat3<T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(by_entry!(|i: usize, j: usize| self.0[i][j] + other.0[i][j]))
    }
}
impl<T: Scalar> Sub for Mat3<T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(by_entry!(|i: usize, j: usize| self.0[i][j] - other.0[i][j]))
    }
}

impl Mat3<f64> {
    /// Rotation by fixed-axis roll, pitch, yaw in radians (URDF): `R = Rz(yaw) Ry(pitch) Rx(roll)`.
    pub fn from_roll_pitch_yaw(roll: f64, pitch: f64, yaw: f64) -> Self {
        let ((sr, cr), (sp, cp), (sy, cy)) = (roll.sin_cos(), pitch.sin_cos(), yaw.sin_cos());
        Self([
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ])
    }

    /// Rotation of the unit quaternion `x y z w`.
    pub fn from_quaternion(quaternion: [f64; 4]) -> Self {
        let [x, y, z, w] = quaternion;
        Self([
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ])
    }

    /// Rotation by `angle` radians about the unit vector `axis` (Rodrigues).
    pub fn from_axis_angle(axis: Vec3, angle: f64) -> Self {
        let (sin, cos) = angle.sin_cos();
        let outer = Self::outer(axis, axis);
        outer + (Self::IDENTITY - outer).scale(cos) + Self::skew(axis).scale(sin)
    }
}

/// A rigid transform `parent_from_child`: a point `p` of the child frame is at `rotation · p + translation` in the
/// parent frame.
#[doc(alias("se3", "placement"))]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform<T = f64> {
    /// Columns are the child's axes in the parent frame.
    pub rotation: Mat3<T>,
    /// The child's origin in the parent frame, in metres.
    pub translation: Vec3<T>,
}

impl<T: Scalar> Transform<T> {
    /// Identity transform.
    pub const IDENTITY: Self = Self { rotation: Mat3::IDENTITY, translation: Vec3::ZERO };

    /// `a_from_b.then(&b_from_c)` is `a_from_c`.
    #[inline(always)]
    pub fn then(&self, next: &Self) -> Self {
        Self {
            rotation: self.rotation.mul_mat(&next.rotation),
            translation: self.rotation.mul_vec_add(next.translation, self.translation),
        }
    }

    /// The inverse transform.
    #[inline(always)]
    pub fn inverse(&self) -> Self {
        Self { rotation: self.rotation.transpose(), translation: -self.rotation.transpose_mul_vec(self.translation) }
    }

    /// The point `p` of the child frame, in the parent frame.
    #[inline(always)]
    pub fn point(&self, p: Vec3<T>) -> Vec3<T> {
        self.rotation.mul_vec_add(p, self.translation)
    }
}
