//! Mass moments of a joint's subtree: first moment `h` and second moment Σ about the origin of the joint's inner
//! frame. The mass is constant.

use crate::hinge::{Hinge, PlacedHinges, with_hinge};
use dynident_lanes::Scalar;
use dynident_model::{JointStep, Shift, Vec3};

/// First moment, and upper triangle by rows of the second moment.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CompositeMoments<T> {
    pub(crate) first: Vec3<T>,
    pub(crate) second: [T; 6],
}

impl<T: Scalar> CompositeMoments<T> {
    pub(crate) const ZERO: Self = Self { first: Vec3::ZERO, second: [T::ZERO; 6] };

    #[inline(always)]
    pub(crate) fn own(step: &JointStep) -> Self {
        Self { first: step.first.splat(), second: step.second.map(T::splat) }
    }

    #[inline(always)]
    pub(crate) fn add(&mut self, other: &Self) {
        self.first += other.first;
        for k in 0..6 {
            self.second[k] += other.second[k];
        }
    }

    /// Moments in the frame of the parent. If the parent rotates about an axis at rest, only `Σ_xx + Σ_yy` matters;
    /// it is stored in `Σ_xx`.
    #[inline(always)]
    pub(crate) fn up(&self, step: &JointStep, hinges: PlacedHinges<'_, T>, index: usize) -> Self {
        let (first, second) =
            with_hinge!(hinges, *step, index, |hinge| (hinge.up(self.first), hinge.up_symmetric(&self.second)));
        let moved = Self { first, second }.about_shifted(step, hinges.translation(step, index));
        if step.hang.on_resting_axis {
            let mut polar = Self::ZERO;
            polar.second[0] = moved.second[0] + moved.second[3];
            polar
        } else {
            moved
        }
    }

    /// Moments about a point at `-t` from the origin: first moment `h + m t` and, with `g = h + m t/2`, second moment
    /// `Σ + t gᵀ + g tᵀ`.
    #[inline(always)]
    fn about_shifted(self, step: &JointStep, t: Vec3<T>) -> Self {
        let Self { first, second: s } = self;
        let (mut h, mut g) = (first, first);
        if step.subtree_mass != 0.0 {
            let mass = T::splat(step.subtree_mass);
            h = t.scale_add(mass, first);
            g = t.scale_add(T::splat(0.5) * mass, first);
        }
        macro_rules! along {
            ($k:literal: $xx:literal, $a:literal, $xa:literal, $b:literal, $xb:literal) => {{
                let mut s = s;
                s[$xx] = (t[$k] + t[$k]).mul_add(g[$k], s[$xx]);
                s[$xa] = t[$k].mul_add(g[$a], s[$xa]);
                s[$xb] = t[$k].mul_add(g[$b], s[$xb]);
                s
            }};
        }
        macro_rules! entry {
            ($k:literal, $a:literal, $b:literal) => {
                t[$a].mul_add(g[$b], t[$b].mul_add(g[$a], s[$k]))
            };
        }
        let second = match step.shift {
            Shift::None => s,
            Shift::X => along!(0: 0, 1, 1, 2, 2),
            Shift::Y => along!(1: 3, 0, 1, 2, 4),
            Shift::Z => along!(2: 5, 0, 2, 1, 4),
            Shift::Any => {
                [entry!(0, 0, 0), entry!(1, 0, 1), entry!(2, 0, 2), entry!(3, 1, 1), entry!(4, 1, 2), entry!(5, 2, 2)]
            }
        };
        Self { first: h, second }
    }
}

/// Inward step: moments of joint `index` and its subtree. `next` contains the moments from the next body, in
/// registers, `kept` the moments of the other children and of the body itself.
#[inline(always)]
pub(crate) fn gathered<T: Scalar>(
    step: &JointStep,
    index: usize,
    kept: &[CompositeMoments<T>],
    next: &CompositeMoments<T>,
) -> CompositeMoments<T> {
    let mut all = if step.branches { kept[index] } else { CompositeMoments::own(step) };
    if !step.is_tip {
        all.add(next);
    }
    all
}

/// Passes the moments of joint `index` to its parent: in `next` if it is the previous body, else in memory.
#[inline(always)]
pub(crate) fn handed_on<T: Scalar>(
    steps: &[JointStep],
    index: usize,
    moved: CompositeMoments<T>,
    kept: &mut [CompositeMoments<T>],
    next: &mut CompositeMoments<T>,
) {
    let step = &steps[index];
    if step.hang.follows {
        *next = moved;
        return;
    }
    *next = CompositeMoments::ZERO;
    let Some(parent) = step.parent else { return };
    // A body adds its own moments together with those of its first child.
    let mut sum = if step.hang.is_last_child { CompositeMoments::own(&steps[parent]) } else { kept[parent] };
    sum.add(&moved);
    kept[parent] = sum;
}
