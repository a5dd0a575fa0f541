//! Both sides of the equation of motion at once, for simulation.

use crate::inverse_dynamics::newton_euler_placed;
use crate::mass_matrix::composite_rigid_bodies_placed;
use crate::workspace::{AnyScratch, Workspace, take};
use dynident_lanes::{Kernel, Lane, dispatch_single};
use dynident_model::Model;

/// Mass matrix `M(q)` (row-major, dof × dof) and bias `C(q, q̇) q̇ + g(q)` (Nm, N) of the rigid bodies: `M q̈ + bias =
/// τ`.
///
/// The same numbers as [`mass_matrix`](crate::mass_matrix()) and [`inverse_dynamics`](crate::inverse_dynamics())
/// without acceleration, with the transforms of the joints made once. Allocation-free.
///
/// # Panics
/// If a vector's length is not the number of joints, or the workspace was made for another size.
#[doc(alias("nonlinear effects", "coriolis", "nle"))]
pub fn mass_matrix_and_bias<'w>(
    model: &Model,
    workspace: &'w mut Workspace,
    q: &[f64],
    dq: &[f64],
) -> (&'w [f64], &'w [f64]) {
    workspace.check(model, &[q, dq]);
    let Workspace { level, scratch, vector, matrices, .. } = workspace;
    dispatch_single(*level, Single { model, scratch, q, dq, matrix: &mut matrices[0], bias: vector });
    (&matrices[0], vector)
}

struct Single<'a> {
    model: &'a Model,
    scratch: &'a mut AnyScratch,
    q: &'a [f64],
    dq: &'a [f64],
    matrix: &'a mut [f64],
    bias: &'a mut [f64],
}

impl Kernel for Single<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self) {
        let scratch = &mut self.scratch.of::<T>().core;
        take(&mut scratch.q, self.q);
        take(&mut scratch.dq, self.dq);
        scratch.ddq.fill(T::ZERO);
        scratch.place(self.model.maps());
        newton_euler_placed(self.model, scratch);
        for (to, from) in self.bias.iter_mut().zip(&scratch.tau) {
            *to = from.lane(0);
        }
        composite_rigid_bodies_placed(self.model, scratch);
        for (to, from) in self.matrix.iter_mut().zip(&scratch.matrices[0]) {
            *to = from.lane(0);
        }
    }
}
