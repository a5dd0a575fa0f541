//! Batches of samples: nanoseconds per sample.

use super::clock::Report;
use super::motion::{Motion, STATES};
use dynident_dynamics::{
    BatchWorkspace, JointMatrices, PanelLayout, Panels, all_columns, inverse_dynamics_batch,
    inverse_dynamics_derivative_matrices, mass_matrices, regressor_panels,
};
use dynident_model::Model;
use std::hint::black_box;

/// Times inverse dynamics, mass matrix, derivatives and the full regressor (ten columns for every body of every joint)
/// in batches.
pub(crate) fn time_all(model: &Model, report: &Report<'_>, block: usize) {
    let blocks = Motion::random(model, STATES / block * block).blocks(block);
    let samples = blocks.len() * block;
    let mut workspace = BatchWorkspace::with_level(model, report.level);
    let mut tau = vec![0.0; model.dof() * block];
    report.time("rnea_batch", samples, || {
        for block in &blocks {
            inverse_dynamics_batch(model, &mut workspace, &block.view(), &mut tau);
            black_box(&tau);
        }
    });
    let mut matrices = [(); 3].map(|()| JointMatrices::new(model));
    report.time("crba_batch", samples, || {
        for motion in &blocks {
            mass_matrices(model, &mut workspace, &motion.q, block, &mut matrices[0]);
            black_box(&matrices);
        }
    });
    report.time("rnea_derivatives_batch", samples, || {
        for motion in &blocks {
            inverse_dynamics_derivative_matrices(model, &mut workspace, &motion.view(), &mut matrices);
            black_box(&matrices);
        }
    });
    let layout = PanelLayout::new(model, all_columns(model, &[]));
    let mut panels = Panels::default();
    report.time("regressor_batch", samples, || {
        for block in &blocks {
            regressor_panels(model, &mut workspace, &layout, &block.view(), &mut panels);
            black_box(&panels);
        }
    });
}
