//! Inertia of a body together with its subtree.

use dynident_lanes::Scalar;
use dynident_model::{InertialParameters, Mat3, Transform, Vec3};

/// Mass, first moment and inertia about the frame origin of a rigid composite.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Composite<T> {
    pub(crate) mass: T,
    pub(crate) first_moment: Vec3<T>,
    /// Upper triangle by rows: xx, xy, xz, yy, yz, zz.
    pub(crate) inertia: [T; 6],
}

impl<T: Scalar> Composite<T> {
    pub(crate) const ZERO: Self = Self { mass: T::ZERO, first_moment: Vec3::ZERO, inertia: [T::ZERO; 6] };

    #[inline(always)]
    pub(crate) fn of(inertial: &InertialParameters) -> Self {
        let p = inertial.0.map(T::splat);
        Self { mass: p[0], first_moment: Vec3([p[1], p[2], p[3]]), inertia: [p[4], p[5], p[6], p[7], p[8], p[9]] }
    }

    #[inline(always)]
    pub(crate) fn inertia_matrix(&self) -> Mat3<T> {
        let i = &self.inertia;
        Mat3([[i[0], i[1], i[2]], [i[1], i[3], i[4]], [i[2], i[4], i[5]]])
    }

    /// Adds `child`, given in its own frame.
    #[inline(always)]
    pub(crate) fn add(&mut self, child: &Self, parent_from_child: &Transform<T>) {
        let Transform { rotation, translation: t } = parent_from_child;
        let h = rotation.mul_vec(child.first_moment);
        // R I Rᵀ, upper triangle only.
        let rows = rotation.mul_mat(&child.inertia_matrix());
        let r = &rotation.0;
        let entry = |a: usize, b: usize| {
            let row = &rows.0[a];
            row[2].mul_add(r[b][2], row[1].mul_add(r[b][1], row[0] * r[b][0]))
        };
        // Parallel axes about the new origin: I += 2 (t·h) 1 - t hᵀ - h tᵀ + m (t·t 1 - t tᵀ), with g = h + m t/2.
        let g = t.scale_add(child.mass * T::splat(0.5), h);
        let diagonal = t.dot(g) + t.dot(g);
        let shift = |a: usize, b: usize| t[a].mul_add(g[b], g[a] * t[b]);
        self.mass += child.mass;
        self.first_moment += t.scale_add(child.mass, h);
        self.inertia[0] += entry(0, 0) + diagonal - shift(0, 0);
        self.inertia[1] += entry(0, 1) - shift(0, 1);
        self.inertia[2] += entry(0, 2) - shift(0, 2);
        self.inertia[3] += entry(1, 1) + diagonal - shift(1, 1);
        self.inertia[4] += entry(1, 2) - shift(1, 2);
        self.inertia[5] += entry(2, 2) + diagonal - shift(2, 2);
    }
}
