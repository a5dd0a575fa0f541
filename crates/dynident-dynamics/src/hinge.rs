//! Change of frame over one joint with the model's steps ([`JointStep`]). All joint axes are z, and most constant
//! rotations are the identity or a quarter turn about x, so that rotating a vector takes four products instead of
//! nine.

use dynident_lanes::{Lane, Scalar};
use dynident_model::{JointStep, Mat3, Shift, Vec3};

/// The rotation `parent_from_body` of one joint at its position.
pub(crate) trait Hinge<T: Scalar>: Copy {
    /// `R v`.
    fn up(self, v: Vec3<T>) -> Vec3<T>;
    /// `Rᵀ v`.
    fn down(self, v: Vec3<T>) -> Vec3<T>;
    /// `R S Rᵀ` of a symmetric matrix, upper triangles by rows.
    fn up_symmetric(self, s: &[T; 6]) -> [T; 6];
    /// `R M Rᵀ`.
    fn up_matrix(self, m: &Mat3<T>) -> Mat3<T>;
    /// `M R`.
    fn after(self, m: &Mat3<T>) -> Mat3<T>;
}

/// `Rz(q)`.
#[derive(Clone, Copy)]
pub(crate) struct AboutZ<T> {
    pub(crate) cosine: T,
    pub(crate) sine: T,
}

impl<T: Scalar> Hinge<T> for AboutZ<T> {
    #[inline(always)]
    fn up(self, v: Vec3<T>) -> Vec3<T> {
        let Self { cosine: c, sine: s } = self;
        Vec3([s.neg_mul_add(v[1], c * v[0]), s.mul_add(v[0], c * v[1]), v[2]])
    }
    #[inline(always)]
    fn down(self, v: Vec3<T>) -> Vec3<T> {
        let Self { cosine: c, sine: s } = self;
        Vec3([c.mul_add(v[0], s * v[1]), s.neg_mul_add(v[0], c * v[1]), v[2]])
    }
    #[inline(always)]
    fn up_symmetric(self, m: &[T; 6]) -> [T; 6] {
        let Self { cosine: c, sine: s } = self;
        let [xx, xy, xz, yy, yz, zz] = *m;
        // First row of Rz M; the trace of the upper block is constant.
        let (a, b) = (s.neg_mul_add(xy, c * xx), s.neg_mul_add(yy, c * xy));
        let first = s.neg_mul_add(b, c * a);
        [first, s.mul_add(a, c * b), s.neg_mul_add(yz, c * xz), (xx + yy) - first, s.mul_add(xz, c * yz), zz]
    }
    #[inline(always)]
    fn up_matrix(self, m: &Mat3<T>) -> Mat3<T> {
        let Self { cosine: c, sine: s } = self;
        let [x, y, z] = m.0;
        let row = |k: usize| (s.neg_mul_add(y[k], c * x[k]), s.mul_add(x[k], c * y[k]));
        let (a, b, d) = (row(0), row(1), row(2));
        let columns = |p: T, q: T, r: T| [s.neg_mul_add(q, c * p), s.mul_add(p, c * q), r];
        Mat3([columns(a.0, b.0, d.0), columns(a.1, b.1, d.1), columns(z[0], z[1], z[2])])
    }
    #[inline(always)]
    fn after(self, m: &Mat3<T>) -> Mat3<T> {
        let Self { cosine: c, sine: s } = self;
        let row = |r: [T; 3]| [c.mul_add(r[0], s * r[1]), s.neg_mul_add(r[0], c * r[1]), r[2]];
        Mat3([row(m.0[0]), row(m.0[1]), row(m.0[2])])
    }
}

/// `Rx(90°) Rz(q)`.
#[derive(Clone, Copy)]
pub(crate) struct AfterQuarter<T>(pub(crate) AboutZ<T>);

impl<T: Scalar> Hinge<T> for AfterQuarter<T> {
    #[inline(always)]
    fn up(self, v: Vec3<T>) -> Vec3<T> {
        let [x, y, z] = self.0.up(v).0;
        Vec3([x, -z, y])
    }
    #[inline(always)]
    fn down(self, v: Vec3<T>) -> Vec3<T> {
        self.0.down(Vec3([v[0], v[2], -v[1]]))
    }
    #[inline(always)]
    fn up_symmetric(self, m: &[T; 6]) -> [T; 6] {
        let [xx, xy, xz, yy, yz, zz] = self.0.up_symmetric(m);
        [xx, -xz, xy, zz, -yz, yy]
    }
    #[inline(always)]
    fn up_matrix(self, m: &Mat3<T>) -> Mat3<T> {
        let [x, y, z] = self.0.up_matrix(m).0;
        Mat3([[x[0], -x[2], x[1]], [-z[0], z[2], -z[1]], [y[0], -y[2], y[1]]])
    }
    #[inline(always)]
    fn after(self, m: &Mat3<T>) -> Mat3<T> {
        let row = |r: [T; 3]| [r[0], r[2], -r[1]];
        self.0.after(&Mat3([row(m.0[0]), row(m.0[1]), row(m.0[2])]))
    }
}

/// A general rotation.
#[derive(Clone, Copy)]
pub(crate) struct Turned<T>(pub(crate) Mat3<T>);

impl<T: Scalar> Hinge<T> for Turned<T> {
    #[inline(always)]
    fn up(self, v: Vec3<T>) -> Vec3<T> {
        self.0.mul_vec(v)
    }
    #[inline(always)]
    fn down(self, v: Vec3<T>) -> Vec3<T> {
        self.0.transpose_mul_vec(v)
    }
    #[inline(always)]
    fn up_symmetric(self, m: &[T; 6]) -> [T; 6] {
        let rows = self.0.mul_mat(&symmetric(m)).0;
        let r = &self.0.0;
        let entry = |a: usize, b: usize| rows[a][2].mul_add(r[b][2], rows[a][1].mul_add(r[b][1], rows[a][0] * r[b][0]));
        [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)]
    }
    #[inline(always)]
    fn up_matrix(self, m: &Mat3<T>) -> Mat3<T> {
        self.0.mul_mat(m).mul_mat(&self.0.transpose())
    }
    #[inline(always)]
    fn after(self, m: &Mat3<T>) -> Mat3<T> {
        m.mul_mat(&self.0)
    }
}

/// Full symmetric matrix from an upper triangle by rows.
#[inline(always)]
pub(crate) fn symmetric<T: Scalar>(s: &[T; 6]) -> Mat3<T> {
    Mat3([[s[0], s[1], s[2]], [s[1], s[3], s[4]], [s[2], s[4], s[5]]])
}

#[derive(Debug)]
pub(crate) struct Hinges<T> {
    cosine: Vec<T>,
    sine: Vec<T>,
    /// Positions of prismatic joints; revolute ones include their offsets.
    position: Vec<T>,
}

impl<T: Scalar> Hinges<T> {
    pub(crate) fn new(joints: usize) -> Self {
        // Rounded up to whole bundles: sines and cosines of several joints are computed together.
        let zeros = || vec![T::ZERO; joints.next_multiple_of(T::ANGLES_AT_ONCE)];
        Self { cosine: zeros(), sine: zeros(), position: zeros() }
    }

    #[inline(always)]
    pub(crate) fn place(&mut self, steps: &[JointStep], q: &[T]) {
        for ((to, step), q) in self.position.iter_mut().zip(steps).zip(q) {
            *to = *q + T::splat(step.offset);
        }
        T::sin_cos_all(&self.position, &mut self.sine, &mut self.cosine);
    }

    /// Computes the placements of joints with a parent only, for results that do not depend on the base's
    /// orientation.
    #[inline(always)]
    pub(crate) fn place_below_base(&mut self, steps: &[JointStep], q: &[T]) {
        let joints = steps.len();
        let (position, sine, cosine) =
            (&mut self.position[..joints], &mut self.sine[..joints], &mut self.cosine[..joints]);
        for (index, (step, q)) in steps.iter().zip(&q[..joints]).enumerate() {
            if step.parent.is_none() {
                continue;
            }
            if step.is_rotary {
                (sine[index], cosine[index]) = (*q + T::splat(step.offset)).sin_cos();
            } else {
                position[index] = *q;
            }
        }
    }

    /// Slices of known equal lengths, so that loops over `joints` joints need no bounds checks.
    #[inline(always)]
    pub(crate) fn placed(&self, joints: usize) -> PlacedHinges<'_, T> {
        PlacedHinges { cosine: &self.cosine[..joints], sine: &self.sine[..joints], position: &self.position[..joints] }
    }
}

#[derive(Clone, Copy)]
pub(crate) struct PlacedHinges<'a, T> {
    cosine: &'a [T],
    sine: &'a [T],
    position: &'a [T],
}

impl<T: Scalar> PlacedHinges<'_, T> {
    #[inline(always)]
    pub(crate) fn about_z(&self, index: usize) -> AboutZ<T> {
        AboutZ { cosine: self.cosine[index], sine: self.sine[index] }
    }

    #[inline(always)]
    pub(crate) fn turned(&self, constant: &Mat3, step: &JointStep, index: usize) -> Turned<T> {
        let splat = |row: [f64; 3]| [T::splat(row[0]), T::splat(row[1]), T::splat(row[2])];
        let constant = Mat3([splat(constant.0[0]), splat(constant.0[1]), splat(constant.0[2])]);
        Turned(if step.is_rotary { self.about_z(index).after(&constant) } else { constant })
    }

    /// Origin of body `index` in its parent's frame.
    #[inline(always)]
    pub(crate) fn translation(&self, step: &JointStep, index: usize) -> Vec3<T> {
        let translation = step.translation.splat();
        if step.is_rotary { translation } else { step.slide.splat().scale_add(self.position[index], translation) }
    }
}

/// `M t + addend` with the origin `t` of a body; `shift` gives its nonzero entries.
#[inline(always)]
pub(crate) fn times_shift<T: Scalar>(shift: Shift, t: Vec3<T>, m: &Mat3<T>, addend: Vec3<T>) -> Vec3<T> {
    macro_rules! along {
        ($k:literal) => {
            Vec3([m.0[0][$k], m.0[1][$k], m.0[2][$k]]).scale_add(t[$k], addend)
        };
    }
    match shift {
        Shift::None => addend,
        Shift::X => along!(0),
        Shift::Y => along!(1),
        Shift::Z => along!(2),
        // The addend comes last, because it is computed last.
        Shift::Any => m.mul_vec(t) + addend,
    }
}

/// `t × v + addend` with the origin `t` of a body; `shift` gives its nonzero entries.
#[inline(always)]
pub(crate) fn cross_shift<T: Scalar>(shift: Shift, t: Vec3<T>, v: Vec3<T>, addend: Vec3<T>) -> Vec3<T> {
    let [x, y, z] = addend.0;
    match shift {
        Shift::None => addend,
        Shift::X => Vec3([x, t[0].neg_mul_add(v[2], y), t[0].mul_add(v[1], z)]),
        Shift::Y => Vec3([t[1].mul_add(v[2], x), y, t[1].neg_mul_add(v[0], z)]),
        Shift::Z => Vec3([t[2].neg_mul_add(v[1], x), t[2].mul_add(v[0], y), z]),
        Shift::Any => t.cross_add(v, addend),
    }
}

/// `v × t + addend` with the origin `t` of a body; `shift` gives its nonzero entries.
#[inline(always)]
pub(crate) fn minus_cross_shift<T: Scalar>(shift: Shift, t: Vec3<T>, v: Vec3<T>, addend: Vec3<T>) -> Vec3<T> {
    let [x, y, z] = addend.0;
    match shift {
        Shift::None => addend,
        Shift::X => Vec3([x, t[0].mul_add(v[2], y), t[0].neg_mul_add(v[1], z)]),
        Shift::Y => Vec3([t[1].neg_mul_add(v[2], x), y, t[1].mul_add(v[0], z)]),
        Shift::Z => Vec3([t[2].mul_add(v[1], x), t[2].neg_mul_add(v[0], y), z]),
        Shift::Any => v.cross_add(t, addend),
    }
}

/// The same hinges for bundles: the rotated vectors are in several SIMD lanes.
#[derive(Clone, Copy)]
pub(crate) struct BundledHinges<'a, T>(pub(crate) PlacedHinges<'a, T>);

impl<T: Lane> BundledHinges<'_, T> {
    #[inline(always)]
    pub(crate) fn about_z(&self, index: usize) -> AboutZ<T::Bundle> {
        let AboutZ { cosine, sine } = self.0.about_z(index);
        AboutZ { cosine: cosine.bundle(), sine: sine.bundle() }
    }

    #[inline(always)]
    pub(crate) fn turned(&self, constant: &Mat3, step: &JointStep, index: usize) -> Turned<T::Bundle> {
        let [a, b, c] = self.0.turned(constant, step, index).0.0;
        Turned(Mat3([bundles(a), bundles(b), bundles(c)]))
    }

    #[inline(always)]
    pub(crate) fn translation(&self, step: &JointStep, index: usize) -> Vec3<T::Bundle> {
        Vec3(bundles(self.0.translation(step, index).0))
    }
}

#[inline(always)]
fn bundles<T: Lane>(values: [T; 3]) -> [T::Bundle; 3] {
    [values[0].bundle(), values[1].bundle(), values[2].bundle()]
}

/// Runs `$body` with the hinge of one joint as `$hinge`: compiled once for each type of rotation.
macro_rules! with_hinge {
    ($hinges:expr, $step:expr, $index:expr, |$hinge:ident| $body:expr) => {
        match $step.rotation {
            dynident_model::StepRotation::Aligned => {
                let $hinge = $hinges.about_z($index);
                $body
            }
            dynident_model::StepRotation::Quarter => {
                let $hinge = $crate::hinge::AfterQuarter($hinges.about_z($index));
                $body
            }
            dynident_model::StepRotation::General(constant) => {
                let $hinge = $hinges.turned(&constant, &$step, $index);
                $body
            }
        }
    };
}
pub(crate) use with_hinge;
