//! Mass matrix and bias of the equation of motion, for simulation.

use crate::inverse_dynamics::newton_euler_placed;
use crate::mass_matrix::matrix_of_sample;
use crate::sample_lanes::take;
use crate::tree_scratch::TreeScratch;
use crate::workspace::{AnyScratch, Scratch, Workspace};
use dynident_lanes::{Kernel, Lane, dispatch_single};
use dynident_model::Model;

/// Computes the mass matrix `M(q)` (row-major, dof × dof) and the bias `C(q, q̇) q̇ + g(q)` (Nm, N) of the rigid
/// bodies: `M q̈ + bias = τ`.
///
/// The same values as [`mass_matrix`](crate::mass_matrix()) and [`inverse_dynamics`](crate::inverse_dynamics()) with
/// zero acceleration, with the joint transforms computed once. Allocation-free.
///
/// # Panics
/// If a vector's length is not the number of joints, or for a workspace of another tree.
#[doc(alias("nonlinear effects", "coriolis", "nle"))]
pub fn mass_matrix_and_bias<'w>(
    model: &Model,
    workspace: &'w mut Workspace,
    q: &[f64],
    dq: &[f64],
) -> (&'w [f64], &'w [f64]) {
    workspace.check(model, &[q, dq]);
    workspace.check_tree(model);
    let Workspace { level, scratch, vector, matrices, tree, .. } = workspace;
    let matrix = &mut matrices[0];
    if let Some(coupling) = model.coupling() {
        let TreeScratch { q: tree_q, dq: tree_dq, tau, matrices: [tree_matrix, ..], .. } = tree;
        coupling.positions(q, 1, tree_q);
        coupling.rates(dq, 1, tree_dq);
        dispatch_single(*level, Single { model, scratch, q: tree_q, dq: tree_dq, matrix: tree_matrix, bias: tau });
        coupling.project_symmetric(tree_matrix, matrix);
        vector.fill(0.0);
        coupling.add_projected(tau, 1, vector);
    } else {
        dispatch_single(*level, Single { model, scratch, q, dq, matrix, bias: vector });
    }
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
        let Scratch { core, columns, .. } = self.scratch.of::<T>();
        take(&mut core.q, self.q);
        take(&mut core.dq, self.dq);
        core.ddq.fill(T::ZERO);
        core.hinges.place(self.model.steps(), &core.q);
        newton_euler_placed(self.model, core);
        for (to, from) in self.bias.iter_mut().zip(&core.tau) {
            *to = from.lane(0);
        }
        matrix_of_sample(self.model, core, columns, self.matrix);
    }
}
