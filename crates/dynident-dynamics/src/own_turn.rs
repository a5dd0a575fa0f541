//! Change of frame over one joint in the bodies' own frames, like [`crate::hinge`] for inner frames. If the joint
//! axis is a coordinate axis of both its frame and the parent's, the rotation changes two entries of a vector and
//! copies the third: five products instead of nine.

use dynident_lanes::{Lane, Scalar};
use dynident_model::{JointMap, Mat3, Vec3};

/// The rotation `parent_from_body` of one joint, and its axis.
pub(crate) trait OwnTurn<T: Scalar>: Copy {
    /// `Rᵀ v`.
    fn down(self, v: Vec3<T>) -> Vec3<T>;
    /// Adds a rotation about the axis at rate `dq` and acceleration `ddq` to angular velocity and acceleration.
    fn rates(self, omega: Vec3<T>, alpha: Vec3<T>, dq: T, ddq: T) -> (Vec3<T>, Vec3<T>);
}

/// A joint whose axis is axis `PARENT` of the parent's frame and axis `CHILD` of its own.
#[derive(Clone, Copy)]
pub(crate) struct Along<T, const PARENT: usize, const CHILD: usize> {
    /// Entries of the rotation in the other two rows and columns.
    pub(crate) block: [[T; 2]; 2],
    /// Entry of the rotation along the axis, plus or minus one.
    pub(crate) across: T,
    /// Direction of the axis along `CHILD`: plus or minus one.
    pub(crate) axis: T,
}

/// The two other axes, in order.
const fn others(axis: usize) -> [usize; 2] {
    [(axis == 0) as usize, 2 - (axis == 2) as usize]
}

impl<T: Scalar, const PARENT: usize, const CHILD: usize> Along<T, PARENT, CHILD> {
    const ROWS: [usize; 2] = others(PARENT);
    const COLUMNS: [usize; 2] = others(CHILD);

    #[inline(always)]
    pub(crate) fn new(map: &JointMap, sine: T, cosine: T) -> Self {
        let ([a, b], [c, d]) = (Self::ROWS, Self::COLUMNS);
        macro_rules! entry {
            ($row:expr, $column:expr) => {
                sine.mul_add(T::splat(map.sine.0[$row][$column]), cosine * T::splat(map.cosine.0[$row][$column]))
            };
        }
        Self {
            block: [[entry!(a, c), entry!(a, d)], [entry!(b, c), entry!(b, d)]],
            across: T::splat(map.constant.0[PARENT][CHILD]),
            axis: T::splat(map.axis[CHILD]),
        }
    }
}

impl<T: Lane, const PARENT: usize, const CHILD: usize> Along<T, PARENT, CHILD> {
    #[inline(always)]
    pub(crate) fn bundled(self) -> Along<T::Bundle, PARENT, CHILD> {
        let [[a, b], [c, d]] = self.block;
        Along {
            block: [[a.bundle(), b.bundle()], [c.bundle(), d.bundle()]],
            across: self.across.bundle(),
            axis: self.axis.bundle(),
        }
    }
}

impl<T: Scalar, const PARENT: usize, const CHILD: usize> OwnTurn<T> for Along<T, PARENT, CHILD> {
    #[inline(always)]
    fn down(self, v: Vec3<T>) -> Vec3<T> {
        let ([a, b], [c, d]) = (Self::ROWS, Self::COLUMNS);
        let mut out = Vec3::ZERO;
        out.0[c] = self.block[1][0].mul_add(v.0[b], self.block[0][0] * v.0[a]);
        out.0[d] = self.block[1][1].mul_add(v.0[b], self.block[0][1] * v.0[a]);
        out.0[CHILD] = self.across * v.0[PARENT];
        out
    }
    #[inline(always)]
    fn rates(self, omega: Vec3<T>, alpha: Vec3<T>, dq: T, ddq: T) -> (Vec3<T>, Vec3<T>) {
        let rate = self.axis * dq;
        // ω × axis q̇, entry by entry in cyclic order.
        let (next, last) = ((CHILD + 1) % 3, (CHILD + 2) % 3);
        let (mut omega, mut alpha) = (omega, alpha);
        alpha.0[next] = omega.0[last].mul_add(rate, alpha.0[next]);
        alpha.0[last] = omega.0[next].neg_mul_add(rate, alpha.0[last]);
        alpha.0[CHILD] = self.axis.mul_add(ddq, alpha.0[CHILD]);
        omega.0[CHILD] += rate;
        (omega, alpha)
    }
}

#[derive(Clone, Copy)]
pub(crate) struct GeneralTurn<T> {
    pub(crate) rotation: Mat3<T>,
    pub(crate) axis: Vec3<T>,
}

impl<T: Lane> GeneralTurn<T> {
    #[inline(always)]
    pub(crate) fn bundled(self) -> GeneralTurn<T::Bundle> {
        let [a, b, c] = self.rotation.0;
        GeneralTurn { rotation: Mat3([bundles(a), bundles(b), bundles(c)]), axis: Vec3(bundles(self.axis.0)) }
    }
}

impl<T: Scalar> OwnTurn<T> for GeneralTurn<T> {
    #[inline(always)]
    fn down(self, v: Vec3<T>) -> Vec3<T> {
        self.rotation.transpose_mul_vec(v)
    }
    #[inline(always)]
    fn rates(self, omega: Vec3<T>, alpha: Vec3<T>, dq: T, ddq: T) -> (Vec3<T>, Vec3<T>) {
        let own = self.axis.scale(dq);
        (omega + own, self.axis.scale_add(ddq, omega.cross_add(own, alpha)))
    }
}

#[inline(always)]
pub(crate) fn bundles<T: Lane>(values: [T; 3]) -> [T::Bundle; 3] {
    [values[0].bundle(), values[1].bundle(), values[2].bundle()]
}

/// Runs `$body` with the rotation of one joint as `$turn`: compiled once for each pair of axes.
macro_rules! with_own_turn {
    ($map:expr, $q:expr, $sine:expr, $cosine:expr, |$turn:ident| $body:expr) => {
        with_own_turn!(
            $map, $q, $sine, $cosine, |$turn| $body,
            (0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2), (2, 0), (2, 1), (2, 2)
        )
    };
    ($map:expr, $q:expr, $sine:expr, $cosine:expr, |$turn:ident| $body:expr, $(($parent:literal, $child:literal)),*) => {
        match $map.along {
            $(Some(($parent, $child)) => {
                let $turn = $crate::own_turn::Along::<_, $parent, $child>::new($map, $sine, $cosine);
                $body
            })*
            _ => {
                let rotation = $crate::workspace::joint_transform($map, $q, $sine, $cosine).rotation;
                let $turn = $crate::own_turn::GeneralTurn { rotation, axis: $map.axis.splat() };
                $body
            }
        }
    };
}
pub(crate) use with_own_turn;
