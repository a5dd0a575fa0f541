//! Identification from 10,000 samples: regressor and triangular factors of every joint.

use super::clock::Report;
use super::motion::Motion;
use dynident_dynamics::{
    BaseParameterSettings, BaseParameters, BatchWorkspace, Column, PanelLayout, Panels, all_columns,
    inverse_dynamics_batch, regressor_panels,
};
use dynident_estimation::factor::FactorWorkspace;
use dynident_estimation::{EstimationError, TriangularFactor};
use dynident_model::Model;
use std::hint::black_box;

const SAMPLES: usize = 10_000;

/// Samples per block: panels of several hundred kilobytes stay in the second-level cache, and a column is an odd
/// number of cache lines.
const BLOCK: usize = 248;

/// Times both for 10,000 samples of a smooth motion. Torques are computed beforehand, as in the compared Python
/// program.
pub(crate) fn time_all(model: &Model, report: &Report<'_>) -> Result<(), EstimationError> {
    let blocks = Motion::fourier(model, SAMPLES, 10.0).blocks(BLOCK);
    let mut workspace = BatchWorkspace::with_level(model, report.level);
    let torques: Vec<Vec<f64>> = blocks
        .iter()
        .map(|block| {
            let mut tau = vec![0.0; model.dof() * block.samples];
            inverse_dynamics_batch(model, &mut workspace, &block.view(), &mut tau);
            tau
        })
        .collect();
    let mut panels = Panels::default();

    let layout = PanelLayout::new(model, all_columns(model, &[]));
    report.time("regressor_10000", 1, || {
        for block in &blocks {
            regressor_panels(model, &mut workspace, &layout, &block.view(), &mut panels);
            black_box(&panels);
        }
    });

    let columns: Vec<Column> = BaseParameters::new(model, &[], &BaseParameterSettings::default()).base_columns();
    let layout = PanelLayout::new(model, columns);
    let mut factor_workspace = FactorWorkspace::new(report.level);
    let mut failed = None;
    report.time("factors_10000", 1, || {
        let mut factors: Vec<TriangularFactor> =
            (0..model.dof()).map(|joint| TriangularFactor::new(layout.joint_columns(joint).len())).collect();
        for (block, tau) in blocks.iter().zip(&torques) {
            regressor_panels(model, &mut workspace, &layout, &block.view(), &mut panels);
            for (joint, factor) in factors.iter_mut().enumerate() {
                panels.torque_mut(joint).copy_from_slice(&tau[joint * block.samples..(joint + 1) * block.samples]);
                failed = failed
                    .take()
                    .or(factor.absorb_with(&mut factor_workspace, panels.joint(joint), block.samples).err());
            }
        }
        black_box(&factors);
    });
    failed.map_or(Ok(()), Err)
}
