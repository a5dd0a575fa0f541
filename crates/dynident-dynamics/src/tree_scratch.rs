//! Scratch memory for robots with coupled joints. The algorithms run over the joints of the tree: motions are
//! converted from the degrees of freedom by `q_tree = G q + q_0`, and torques back by `tau = Gᵀ tau_tree`
//! ([`JointCoupling`]). Empty and unused for other robots.

use crate::joint_matrices::MatrixRows;
use dynident_lanes::AlignedBuffer;
use dynident_model::terms::JointMotion;
use dynident_model::{JointCoupling, Model};

#[derive(Debug)]
pub(crate) struct TreeScratch {
    pub(crate) q: Vec<f64>,
    pub(crate) dq: Vec<f64>,
    pub(crate) ddq: Vec<f64>,
    pub(crate) tau: Vec<f64>,
    /// Square matrices over the joints of the tree, row-major.
    pub(crate) matrices: [Vec<f64>; 3],
    /// Regressor rows of the joints of the tree, ten columns per body.
    pub(crate) regressor: Vec<f64>,
}

impl TreeScratch {
    pub(crate) fn new(model: &Model) -> Self {
        let joints = if model.coupling().is_some() { model.body_count() } else { 0 };
        let zeros = || vec![0.0; joints];
        Self {
            q: zeros(),
            dq: zeros(),
            ddq: zeros(),
            tau: zeros(),
            matrices: core::array::from_fn(|_| vec![0.0; joints * joints]),
            regressor: vec![0.0; 10 * joints * joints],
        }
    }

    pub(crate) fn positions(&mut self, coupling: &JointCoupling, q: &[f64]) -> &[f64] {
        coupling.positions(q, 1, &mut self.q);
        &self.q
    }

    pub(crate) fn take_motion(&mut self, coupling: &JointCoupling, q: &[f64], dq: &[f64], ddq: &[f64]) {
        coupling.positions(q, 1, &mut self.q);
        coupling.rates(dq, 1, &mut self.dq);
        coupling.rates(ddq, 1, &mut self.ddq);
    }
}

/// Scratch memory for blocks of samples; grows to their size.
#[derive(Debug, Default)]
pub(crate) struct TreeBatch {
    /// Positions, velocities, accelerations.
    pub(crate) motion: [Vec<f64>; 3],
    /// Torques, or derivatives with respect to the motion.
    pub(crate) results: [Vec<f64>; 3],
    /// Square matrices over the joints of the tree, by entry.
    pub(crate) matrices: [Vec<f64>; 3],
    pub(crate) panels: Vec<AlignedBuffer>,
}

/// Motion of the joints of the tree, stored in `room`.
pub(crate) fn expanded<'r>(
    coupling: &JointCoupling,
    motion: &JointMotion<'_>,
    room: &'r mut [Vec<f64>; 3],
) -> JointMotion<'r> {
    let samples = motion.samples;
    let joints = coupling.joints();
    for (place, (to, from)) in room.iter_mut().zip([motion.q, motion.dq, motion.ddq]).enumerate() {
        to.resize(joints * samples, 0.0);
        if place == 0 {
            coupling.positions(from, samples, to);
        } else {
            coupling.rates(from, samples, to);
        }
    }
    let [q, dq, ddq] = room;
    JointMotion { samples, q, dq, ddq }
}

/// `Gᵀ A G` of the matrices of `samples` samples, entry `(i, k)` of sample `s` at `(i * dof + k) * samples + s`.
pub(crate) fn project_matrices(coupling: &JointCoupling, tree: &[f64], samples: usize, to: &mut MatrixRows<'_>) {
    let (joints, dof) = (coupling.joints(), coupling.dof());
    let MatrixRows { out, stride } = to;
    out.fill(0.0);
    for row in 0..joints {
        for column in 0..joints {
            let from = &tree[(row * joints + column) * samples..][..samples];
            for &(a, share_a) in coupling.row(row) {
                for &(b, share_b) in coupling.row(column) {
                    let to = &mut out[(a * dof + b) * *stride..][..samples];
                    for (to, from) in to.iter_mut().zip(from) {
                        *to += share_a * share_b * from;
                    }
                }
            }
        }
    }
}
